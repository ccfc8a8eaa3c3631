"""The gymnasium environment, as others make it; without gymnasium skipped, and saying so."""

from importlib import import_module
from typing import Any

import numpy as np
import pytest
from formup.evals.rl.teams import CATEGORIES, SEEN, STEPS
from formup.tools.errors import InputError

gymnasium: Any = pytest.importorskip("gymnasium", reason="needs formup[rl]: make test-torch")
NAME = "formup.evals.rl.environment:formup/PatternFormation-v0"
TRIANGLE = [(10, 10), (90, 20), (40, 80)]


@pytest.mark.parametrize("category", CATEGORIES)
@pytest.mark.parametrize("outline", [None, TRIANGLE])
def test_gymnasiums_own_check_passes(category: str, outline: Any) -> None:
    made = gymnasium.make(NAME, category=category, robots=3, outline=outline)
    import_module("gymnasium.utils.env_checker").check_env(made.unwrapped)
    assert made.observation_space.shape == (3, SEEN)


def test_an_episode_is_the_same_for_the_same_seed_and_ends_by_time() -> None:
    ends = list[Any]()
    for _ in range(2):
        made = gymnasium.make(NAME, category="caging", robots=4)
        seen, _ = made.reset(seed=5)
        made.action_space.seed(5)
        for step in range(STEPS):
            seen, reward, over, cut, info = made.step(made.action_space.sample())
            assert reward == pytest.approx(info["rewards"].mean())
            assert (over, cut) == (False, step == STEPS - 1)
        ends.append(seen)
    assert np.array_equal(*ends)


def test_what_there_is_no_environment_for() -> None:
    with pytest.raises(InputError, match=r"'herd': give .* general, infill, caging"):
        gymnasium.make(NAME, category="herd")
    with pytest.raises(InputError, match="for 0 robots"):
        gymnasium.make(NAME, robots=0)
    with pytest.raises(InputError, match="An outline needs 3 or more"):
        gymnasium.make(NAME, outline=[(0, 0), (1, 1)])
