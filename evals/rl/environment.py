"""One team around one target as a gymnasium environment, for others to train on.

    gymnasium.make("formup.evals.rl.environment:formup/PatternFormation-v0", category="infill")

Gymnasium comes with the extra `rl` and has no types here.
"""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...tools.errors import InputError
from ...tools.geometry.outline import FloatArray, make_outline
from .teams import CATEGORIES, FAR, SEEN, STEPS, Teams, outline_points, random_outlines

_gymnasium: Any = import_module("gymnasium")
ID = "formup/PatternFormation-v0"


class PatternFormation(_gymnasium.Env):
    """Robots that share a reward: the mean of each one's reward, which `info` has too.

    An action is a move of each robot, (robots, 2), away from the target's centre and
    counter-clockwise about it, in strides; an observation is what each sees, (robots, 14): see
    Teams.

    Args:
        category: general, infill or caging.
        robots: of the team.
        outline: of the target, (n, 2); by default each episode draws another shape.

    Raises:
        InputError: no such category, no robot, or no outline.
    """

    metadata: Mapping[str, Any] = {"render_modes": []}

    def __init__(
        self, category: str = "caging", robots: int = 8, outline: ArrayLike | None = None
    ) -> None:
        if category not in CATEGORIES or robots < 1:
            raise InputError(
                f"There is no environment for {robots} robots and the category {category!r}: give "
                f"one robot or more, and one of {', '.join(CATEGORIES)}."
            )
        spaces = _gymnasium.spaces
        self.observation_space = spaces.Box(-FAR, FAR, (robots, SEEN), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (robots, 2), np.float32)
        self._category, self._robots = category, robots
        self._outline = (
            None if outline is None else outline_points(make_outline(outline).polygon)[0]
        )

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, FloatArray]]:
        """Begin an episode with robots at random places about the target."""
        super().reset(seed=seed)
        random = self.np_random
        outlines = random_outlines(1, random) if self._outline is None else self._outline[None]
        self._teams = Teams(self._category, self._robots, outlines, random)
        return self._teams.seen()[0], self._info()

    def step(
        self, action: FloatArray
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, FloatArray]]:
        """Move all robots at once; `gymnasium.make` cuts an episode off after 32 moves."""
        self._teams.move(np.asarray(action, dtype=float)[None])
        info = self._info()
        return self._teams.seen()[0], float(info["rewards"].mean()), False, False, info

    def _info(self) -> dict[str, FloatArray]:
        """Return where robots stand, in units of the target's size, and the reward of each."""
        return {"places": self._teams.places[0].copy(), "rewards": self._teams.rewards()[0]}


_gymnasium.register(ID, f"{__name__}:PatternFormation", max_episode_steps=STEPS)
