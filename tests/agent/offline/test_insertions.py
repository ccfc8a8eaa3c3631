"""Nouns, numbers and clauses that no rule knows, put into known instructions: none is dropped."""

import random
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import formup
from formup.agent.first_message import Task
from formup.agent.offline.accounting import read_instruction
from formup.agent.offline.drafting import question_of
from formup.agent.offline.lexicon import fillers
from formup.agent.offline.reading import Reading
from formup.agent.offline.tagging import in_use, stem, tokens, word_classes

OFFLINE = Path(formup.__file__).parent / "agent/offline"
INSERTIONS, SEED = 3_000, 17
MOST_SLIPPED = 1 / 500
NOUNS = (
    *("giraffe", "marzipan", "trombone", "volcano", "parsley", "zebra", "lasagne", "glacier"),
    *("walrus", "saxophone", "broccoli", "comet", "pyjamas", "octopus", "thimble", "waffle"),
    *(
        "harpsichord",
        "iceberg",
        "mongoose",
        "teaspoon",
        "meringue",
        "yodel",
        "cauliflower",
        "bassoon",
    ),
    *("turnip", "custard", "poodle", "tambourine", "gherkin", "obelisk", "sombrero", "didgeridoo"),
)
NUMBERS = (
    *("seven", "thirteen", "forty-two", "17", "3.5", "99", "1,250", "0.8", "five hundred", "-9"),
    *("sixty-one", "a dozen", "two thirds", "12 furlongs", "30 px", "4 m", "half a mile", "3 x 3"),
    *("eleven parsecs", "200 grams", "45 degrees", "9 %", "six or seven", "20-30"),
)
CLAUSES = (
    *("while the orchestra tunes", "because garlic disagrees with my aunt", "whose lids rattle"),
    *("as the tide recedes", "until the kettle whistles", "where the moss thickens"),
    *("for the glory of the empire", "so the walrus may sing", "if the souffl\u00e9 collapses"),
    *("after the third sonata", "with their hats askew", "in memory of a goldfish"),
    *("like penguins", "singing softly", "under a tarpaulin", "wearing galoshes", "via the cellar"),
    *("and bake a cake", "but whistle first", "avoiding puddles", "by candlelight", "at supper"),
    *("without socks", "except Tuesdays", "two of them blindfolded", "each holding a lantern"),
    *("in alphabetical order", "painted purple", "unless the bishop objects"),
)
INSTRUCTIONS = (
    "Surround [the car] with 8 robots",
    "Put 6 robots around [the coin]",
    "Cage [the coin] with 9 robots",
    "Fill [the pool] with 7 robots",
    "Line up 5 robots along the left side of [the car]",
    "Place 4 robots at the corners of [the court]",
    "Put 12 robots around [the lid], 20 px away",
    "Form a ring of 10 robots around [the tank]",
    "Spread 9 robots over [the field], evenly",
    "Lock [the sweet] in with 10 robots so that it cannot escape",
    "Gather 3 robots at the centre of [the court]",
    "Could you put eight robots round [the tree], please?",
    "Draw a star around [the coin] with 15 robots",
    "Put 8 robots around [the car], all facing it",
    "Surround [the boat] with 8 robots, at least 15 px apart",
    "I want 6 robots standing around [the bunker]",
    "Station 10 bots around [the pool], 20 px from its edge",
    "Ring [the fountain] with twelve robots and leave a gap at the top",
    "Put 4 robots in a row on the right side of [the truck]",
    "Enclose [the goat] with 12 robots",
)
"""The thing that is pointed at stands in brackets: nothing is put into it."""


def is_unknown(word: str) -> bool:
    """Whether no rule, no class and no command that was trained on knows a word."""
    rules = (OFFLINE / "demands.yaml").read_text("utf-8")
    known = stem(word) in in_use().words or word in fillers() or bool(word_classes([word])[0])
    return not known and word not in rules


def question(text: str, reading: Reading) -> str | None:
    count = reading.robots or (reading.form.robots if reading.form else None)
    return question_of(Task(text, None, (), ("t1",), True, None), reading, count)


def contract(reading: Reading) -> str:
    """What becomes of a reading: all but its quotes and how likely it is."""
    fields = asdict(reading) | {"meanings": reading.relation}
    return repr([v for k, v in fields.items() if k not in ("things", "background")])


@dataclass(frozen=True)
class Known:
    """A known instruction, its reading, and where something may be put into it."""

    text: str
    reading: Reading
    spots: tuple[int, ...]


def known(instruction: str) -> Known:
    text = instruction.replace("[", "").replace("]", "")
    first, last = instruction.index("["), instruction.index("]") - 1
    reading = read_instruction(text)
    assert question(text, reading) is None, text
    starts = [w.start for w in tokens(text) if not first < w.start < last]
    return Known(text, reading, (*starts, len(text)))


def insertions(count: int, seed: int) -> Iterator[tuple[Known, str]]:
    """Known instructions, each with an instruction that has something more in it."""
    rng = random.Random(seed)
    bases = [known(text) for text in INSTRUCTIONS]
    nouns = [noun for noun in NOUNS if is_unknown(noun)]
    clauses = [c for c in CLAUSES if any(is_unknown(w) for w in c.split())]
    assert len(nouns) >= 20
    assert len(clauses) >= 20
    for _ in range(count):
        base = rng.choice(bases)
        more = rng.choice(
            [
                rng.choice(["a ", "the ", "", "some "]) + rng.choice(nouns),
                rng.choice(NUMBERS),
                rng.choice(clauses),
            ]
        )
        at = rng.choice(base.spots)
        before, after = base.text[:at].rstrip(" ?"), base.text[at:]
        joint = rng.choice([" ", ", ", ". "])
        if not before:
            yield base, f"{more}{joint}{after}"
        elif not after:
            yield base, f"{before}{joint}{more}"
        else:
            yield base, f"{before} {more} {after}"


def fate(base: Known, text: str) -> str:
    """What becomes of an instruction with something more in it."""
    reading = read_instruction(text)
    if question(text, reading) is not None:
        return "asked"
    if contract(reading) != contract(base.reading):
        return "contract"
    if reading.background != base.reading.background:
        return "background"
    return "slipped" if reading.things == base.reading.things else "things"


def test_at_most_1_in_500_insertions_changes_nothing() -> None:
    fates = [(fate(base, text), text) for base, text in insertions(INSERTIONS, SEED)]
    slipped = [text for what, text in fates if what == "slipped"]
    counts = Counter(what for what, _ in fates)
    assert len(slipped) <= MOST_SLIPPED * INSERTIONS, "\n".join([f"{counts}", *slipped])


def test_most_insertions_are_asked_about() -> None:
    fates = Counter(fate(base, text) for base, text in insertions(300, SEED + 1))
    assert fates["asked"] > 300 / 2
