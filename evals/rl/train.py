"""PPO with one policy for all robots, by stable-baselines3: the only module that runs it and torch.

To PPO each robot of each team is an environment of its own. Loaded by the command that trains.
"""

import hashlib
import io
from importlib import import_module, metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...tools.store import write_whole
from .policy import Checkpoint, Policy
from .teams import SEEN, STEPS, Category, Teams, random_outlines

_torch: Any = import_module("torch")
_baselines: Any = import_module("stable_baselines3")
_vec: Any = import_module("stable_baselines3.common.vec_env")
_spaces: Any = import_module("gymnasium.spaces")
Floats = NDArray[np.float32]
TEAMS, POOL, JUDGED = 64, 512, 64
"""Teams that learn at once, outlines they meet, and teams that are scored."""
ROLLOUTS = 4
"""Episodes of all teams between two scores."""
PATIENCE, GAIN = 8, 0.01
"""Plateau: the mean of so many scores exceeds that of as many before them by less than this."""
SETTINGS: dict[str, Any] = {
    "n_steps": STEPS,
    "batch_size": 2048,
    "n_epochs": 5,
    "learning_rate": 1e-3,
    "gamma": 0.95,
    "gae_lambda": 0.9,
    "policy_kwargs": {"net_arch": [64, 64], "log_std_init": -0.5},
}


def train(category: Category, robots: int, seed: int, budget: int, folder: Path) -> Checkpoint:
    """Train a policy until its scores level off or the budget is spent, and store it.

    Args:
        category: the one it is rewarded for.
        robots: of a team.
        seed: of all randomness in training.
        budget: steps of robots after which no more episodes are begun.
        folder: for its files; weights are written at each scoring.
    """
    _torch.set_num_threads(1)  # networks this small are slower on several
    env, curve = Robots(category, robots, seed), list[tuple[int, float]]()
    model = _baselines.PPO("MlpPolicy", env, seed=seed, device="cpu", **SETTINGS)
    converged, kept = False, ""
    while not converged and model.num_timesteps < budget:
        model.learn(ROLLOUTS * STEPS * env.num_envs, reset_num_timesteps=not curve)
        policy = actor(model)
        curve.append((int(model.num_timesteps), round(score(policy, category, robots), 4)))
        converged = plateau([value for _, value in curve])
        kept = _keep(policy, folder / f"{category}-{seed}.npz")
    made = Checkpoint(
        category=category,
        seed=seed,
        robots=robots,
        budget=budget,
        converged=converged,
        sha256=kept,
        curve=tuple(curve),
        versions={n: metadata.version(n) for n in ("stable_baselines3", "torch", "numpy")},
    )
    write_whole(folder / f"{made.name}.json", made.model_dump_json(indent=1).encode())
    return made


def score(policy: Policy, category: str, robots: int) -> float:
    """Return the mean reward at the end of an episode, on outlines and starts not trained on."""
    random = np.random.default_rng(1 << 40)
    teams = Teams(category, robots, random_outlines(JUDGED, random), random)
    policy.play(teams)
    return float(teams.rewards().mean())


def plateau(scores: list[float]) -> bool:
    """Return whether scores no longer rise."""
    late, early = scores[-PATIENCE:], scores[-2 * PATIENCE : -PATIENCE]
    return len(early) == PATIENCE and float(np.mean(late) - np.mean(early)) < GAIN


def actor(model: Any) -> Policy:
    """Return the part of PPO's network that acts, as arrays."""
    net = model.policy
    linear = [*(m for m in net.mlp_extractor.policy_net if hasattr(m, "weight")), net.action_net]
    return Policy(
        tuple((m.weight.detach().numpy().copy(), m.bias.detach().numpy().copy()) for m in linear)
    )


def _keep(policy: Policy, path: Path) -> str:
    """Write weights; return the hash of the file, in which nothing depends on the time."""
    file, named = io.BytesIO(), dict[str, Any]()
    for i, (weights, biases) in enumerate(policy.layers):
        named |= {f"w{i}": weights, f"b{i}": biases}
    np.savez(file, **named)
    write_whole(path, file.getvalue())
    return hashlib.sha256(file.getvalue()).hexdigest()


class Robots(_vec.VecEnv):
    """All robots of all teams as a vectorised environment; an episode ends for all at once."""

    def __init__(self, category: str, robots: int, seed: int) -> None:
        self._random = np.random.default_rng(seed)
        self._pool = random_outlines(POOL, self._random)
        self._category, self._robots = category, robots
        seen = _spaces.Box(-np.inf, np.inf, (SEEN,), np.float32)
        super().__init__(TEAMS * robots, seen, _spaces.Box(-1, 1, (2,), np.float32))

    def reset(self) -> Floats:
        """Begin an episode around other targets."""
        outlines = self._pool[self._random.integers(POOL, size=TEAMS)]
        self._teams = Teams(self._category, self._robots, outlines, self._random)
        self._left = STEPS
        return self._seen

    def step_async(self, actions: Floats) -> None:
        """Move all robots."""
        self._teams.move(np.asarray(actions, dtype=float).reshape(TEAMS, self._robots, 2))
        self._left -= 1

    def step_wait(self) -> tuple[Floats, Floats, NDArray[np.bool_], list[dict[str, Any]]]:
        """Return what robots see and their rewards; after the last step another episode begins.

        Nothing of the one that ended is lost: `infos` has its last observation, marked as cut off.
        """
        rewards, seen = self._teams.rewards().ravel().astype(np.float32), self._seen
        infos: list[dict[str, Any]] = [{} for _ in rewards]
        if not self._left:
            infos = [{"terminal_observation": o, "TimeLimit.truncated": True} for o in seen]
        done = np.full(len(rewards), not self._left)
        return (self.reset() if done.all() else seen), rewards, done, infos

    @property
    def _seen(self) -> Floats:
        return self._teams.seen().reshape(-1, SEEN)

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return None for each environment; they have no attributes of their own."""
        return [None] * self.num_envs

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return False for each environment; none is wrapped."""
        return [False] * self.num_envs

    def close(self) -> None:
        """Do nothing, as nothing is open."""

    set_attr = env_method = get_attr
