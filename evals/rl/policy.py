"""A trained policy as plain arrays: read, hashed and run without torch, and never unpickled.

A folder holds a policy for each category and seed, CATEGORY-SEED.npz, with how it was trained
beside it in a .json.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ValidationError

from ...tools.errors import InputError
from ...tools.geometry.outline import FloatArray
from ...tools.store import read_bytes
from ..tasks.task import Goal
from .teams import CATEGORIES, STEPS, Category, Teams, outline_points

RL = "rl"
"""Name of the method."""
TRAIN = "formup eval train-rl"


@dataclass(frozen=True)
class Policy:
    """A network of layers, weights (out, in) and biases (out,), tanh between them."""

    layers: tuple[tuple[FloatArray, FloatArray], ...]

    def __call__(self, seen: ArrayLike) -> FloatArray:
        """Return the move of each robot for what it sees, (..., SEEN) to (..., 2)."""
        value = np.asarray(seen, dtype=float)
        for i, (weights, biases) in enumerate(self.layers):
            value = (np.tanh(value) if i else value) @ weights.T + biases
        return np.clip(value, -1, 1)

    def play(self, teams: Teams) -> FloatArray:
        """Move teams through an episode; return where robots stand at its end."""
        for _ in range(STEPS):
            teams.move(self(teams.seen()))
        return teams.places


class Checkpoint(BaseModel, frozen=True, extra="forbid"):
    """How a policy was trained.

    Attributes:
        robots: of the teams it was trained in.
        budget: most steps of robots that training might take.
        converged: whether its scores levelled off before the budget ended.
        sha256: of its weights' file.
        curve: (steps taken, mean reward at the end of an episode).
        versions: of the packages that trained it.
    """

    category: Category
    seed: int
    robots: int
    budget: int
    converged: bool
    sha256: str
    curve: tuple[tuple[int, float], ...]
    versions: dict[str, str]

    @property
    def name(self) -> str:
        """Name of its files, without an extension."""
        return f"{self.category}-{self.seed}"


@dataclass(frozen=True)
class Trained:
    """All policies of a folder; `sha256` is of all their weights."""

    checkpoints: tuple[Checkpoint, ...]
    policies: dict[str, tuple[Policy, ...]]
    sha256: str

    @property
    def unconverged(self) -> list[str]:
        """Categories in which the budget ended the training of a policy."""
        found = {c.category for c in self.checkpoints if not c.converged}
        return [category for category in CATEGORIES if category in found]

    @property
    def description(self) -> str:
        """Description in words, for the heading of a row."""
        sizes = " and ".join(sorted({str(c.robots) for c in self.checkpoints}))
        seeds = min(map(len, self.policies.values()))
        words = f"PPO on true outlines, teams of {sizes}, {seeds} seed{'s'[: seeds > 1]}"
        late = ", ".join(self.unconverged)
        return f"{words}; unconverged in {late}, not the paper's" if late else words


def read_checkpoints(folder: Path) -> list[Checkpoint]:
    """Return how the policies of a folder were trained, sorted by category and seed.

    Raises:
        InputError: one of its files cannot be read.
    """
    found = list[Checkpoint]()
    for path in sorted(folder.glob("*-*.json")):
        try:
            found.append(Checkpoint.model_validate_json(read_bytes(path)))
        except ValidationError as error:
            what = error.errors()[0]["msg"]
            raise InputError(f"{path} does not say how a policy was trained: {what}.") from None
    return sorted(found, key=lambda c: (CATEGORIES.index(c.category), c.seed))


@lru_cache(maxsize=4)
def trained(folder: Path) -> Trained:
    """Return the policies of a folder.

    Raises:
        InputError: a category has none, or weights are not the ones that were trained.
    """
    checkpoints = read_checkpoints(folder)
    policies = {
        category: tuple(_policy(folder, c) for c in checkpoints if c.category == category)
        for category in CATEGORIES
    }
    lacking = [category for category, own in policies.items() if not own]
    if lacking:
        options = "".join(f" --category {category}" for category in lacking)
        raise InputError(
            f"{folder} holds no policy for {', '.join(lacking)}; train it with "
            f"{TRAIN} --out {folder}{options}."
        )
    hashes = "".join(c.sha256 for c in checkpoints)
    return Trained(tuple(checkpoints), policies, hashlib.sha256(hashes.encode()).hexdigest())


def _policy(folder: Path, checkpoint: Checkpoint) -> Policy:
    path = folder / f"{checkpoint.name}.npz"
    if hashlib.sha256(read_bytes(path)).hexdigest() != checkpoint.sha256:
        raise InputError(f"{path} is not the file that was trained; train it again with {TRAIN}.")
    with np.load(path, allow_pickle=False) as held:
        count = len(held.files) // 2
        return Policy(tuple((held[f"w{i}"], held[f"b{i}"]) for i in range(count)))


def places(folder: Path, category: str, goals: Sequence[Goal], trial: int, seed: int) -> FloatArray:
    """Return where trained robots, which know where the thing is, go, (N, 2) px.

    Args:
        folder: of checkpoints; each try takes the policy of the next seed.
        category: of the task.
        goals: of the task.
        trial: number of the try.
        seed: for where the robots start.
    """
    policies, random = trained(folder).policies[category], np.random.default_rng(seed)
    policy, found = policies[trial % len(policies)], list[FloatArray]()
    for goal in goals:
        outline, centre, size = outline_points(goal.target.region)
        team = Teams(category, goal.robots, outline[None], random)
        found.append(centre + size * policy.play(team)[0])
    return np.concatenate(found)
