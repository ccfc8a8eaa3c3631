"""`python -m formup.evals.wordings`: train the model that reads instructions, and judge it."""

from collections import Counter
from dataclasses import replace
from importlib import resources
from pathlib import Path

from .judge import by_author, temperature, verdicts
from .sentences import shipped_sentences
from .train import known_words, store, train

NAMES = ("right", "asked", "wrong", "rightly asked")


def main() -> None:
    """Print verdicts by author, each unseen in training; write the weights trained on all."""
    sentences = shipped_sentences()
    folds = list(by_author(sentences))
    print(f"{'author':12}{'sentences':>10}" + "".join(f"{name:>15}" for name in NAMES))  # noqa: T201
    total: Counter[str] = Counter()
    for author, model, own in folds:
        found = verdicts(model, own)
        total += found
        _print_verdicts(author, found)
    _print_verdicts("all", total)
    cooled = temperature([(model, own) for _, model, own in folds])
    model = replace(train(sentences), temperature=cooled, words=known_words(sentences))
    path = Path(str(resources.files("formup.agent.offline"))) / "tagging.npz"
    store(path, model)
    print(f"temperature {cooled:.2f}; {path.stat().st_size / 1000:.0f} kB written to {path.name}")  # noqa: T201


def _print_verdicts(name: str, found: Counter[str]) -> None:
    count = sum(found.values())
    shares = "".join(f"{found[key] / count:15.3f}" for key in NAMES)
    print(f"{name:12}{count:10}{shares}")  # noqa: T201


if __name__ == "__main__":
    main()
