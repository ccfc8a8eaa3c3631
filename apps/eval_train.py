"""`formup eval train-rl`: trains policies for the reinforcement learning row of table 1."""

from pathlib import Path
from typing import Annotated

import typer

from ..evals.rl.curve import picture, summary
from ..evals.rl.policy import Checkpoint, read_checkpoints
from ..evals.rl.teams import CATEGORIES, Category
from ..tools.errors import InputError
from ..tools.store import write_whole
from . import arguments as inputs
from .terminal import say

CURVE = "curve.png"
Folder = Annotated[
    Path,
    typer.Option("--out", help="Folder for checkpoints; policies already trained there are kept."),
]
Categories = Annotated[
    list[str] | None,
    typer.Option(
        "--category",
        help="Category to train: general, infill or caging; repeatable.",
        show_default="all",
    ),
]
Robots = Annotated[
    str, typer.Option("--robots", "-n", help="Number of robots in each trained team.")
]
Seeds = Annotated[
    str, typer.Option("--seeds", help="Number of policies per category, each with its own seed.")
]
Steps = Annotated[str, typer.Option("--steps", help="Maximum number of robot steps per policy.")]


def train_rl(
    out: Folder,
    category: Categories = None,
    robots: Robots = "8",
    seeds: Seeds = "5",
    steps: Steps = "3,000,000",
) -> None:
    """Train policies with PPO, for the method rl.

    Training ends when scores level off or the budget of steps is spent. Each category has one
    reward; a policy drives all robots of a team, and one is trained per seed. To continue a killed
    training, give its folder again; formup eval table 1 --checkpoints evaluates the policies.
    """
    size = inputs.whole("--robots", robots, least=1, most=100)
    chosen: list[Category] = [c for c in CATEGORIES if category is None or c in category]
    wrong = sorted(set(category or ()) - set(CATEGORIES))
    if wrong:
        raise InputError(f"Unknown category {wrong[0]!r}. There are: {', '.join(CATEGORIES)}.")
    budget = inputs.whole("--steps", steps, least=1, most=1_000_000_000)
    count = inputs.whole("--seeds", seeds, least=1, most=100)
    known = {c.name: c for c in read_checkpoints(out)}
    other = sorted({c.robots for c in known.values()} - {size})
    if other:
        raise InputError(
            f"{out} holds policies for teams of {other[0]}, not {size}; use another folder."
        )
    try:
        from ..evals.rl.train import train
    except ImportError:
        raise InputError("Training needs an extra: pip install 'formup[rl]'.") from None

    out.mkdir(parents=True, exist_ok=True)
    for name in chosen:
        for seed in range(count):
            made = known.get(f"{name}-{seed}")
            if made is None or not (made.converged or made.budget >= budget):
                made = train(name, size, seed, budget, out)
            _print(made)
    made = read_checkpoints(out)
    write_whole(out / CURVE, picture(made))
    for name in CATEGORIES:
        _print_category(name, [c for c in made if c.category == name])
    say(f"{out / CURVE}\nTo evaluate them: formup eval table 1 --method rl --checkpoints {out}")


def _print(made: Checkpoint) -> None:
    steps, score = made.curve[-1]
    end = "converged" if made.converged else "unconverged: the budget ended it"
    say(f"{made.name}: {score:.3f} after {steps:,} steps, {end}; weights {made.sha256[:12]}")


def _print_category(name: str, own: list[Checkpoint]) -> None:
    if own:
        _, mean, (low, high) = summary(own)
        ends = f" (95 %: {low[-1]:.3f} to {high[-1]:.3f} by bootstrap)" if len(own) > 1 else ""
        say(f"{name}: {mean[-1]:.3f}{ends}, interquartile mean of seeds: {len(own)}")
