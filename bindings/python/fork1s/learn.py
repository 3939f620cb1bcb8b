"""Environments of Gymnasium on batches of simulations: one, or many that step as one.

    import gymnasium, fork1s.learn
    env = gymnasium.make("fork1s/GraspLift-v0")
    many = gymnasium.make_vec("fork1s/Quadruped-v0", num_envs=64)       # a fork1s.Batch inside

docs/learning.md explains them from the beginning. Needs `pip install 'fork1s[learn]'`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

try:
    import gymnasium
except ModuleNotFoundError:
    raise ModuleNotFoundError("fork1s.learn needs gymnasium: pip install 'fork1s[learn]'") from None

from ._core import Batch
from ._errors import UsageError
from ._load import load, scene
from ._tasks import TASKS, GraspLift, Now, PegInsertion, Quadruped, Task

__all__ = [
    "Environment",
    "GraspLift",
    "Now",
    "PegInsertion",
    "Quadruped",
    "Task",
    "VectorEnvironment",
    "TASKS",
]

Randomise = Mapping[str, tuple[float, float]] | bool
_LARGEST = 10.0  # of what is observed


class _Members:
    """A task on a batch: what both kinds of environment are made of."""

    def __init__(
        self,
        task: type[Task],
        count: int,
        randomise: Randomise,
        threads: int | None,
        model: Any,
        observe: Sequence[str],
    ) -> None:
        self.model = load(scene(task.scene) if model is None else model, **task.load)
        ranges = task.randomise if randomise is True else randomise or None
        # Drawn at every reset, by seeds from the generator of the environment.
        drawn = {} if ranges is None else {"seeds": 0, "randomise": ranges}
        self.batch = Batch(self.model, count, dt=task.dt, threads=threads or 0, **drawn)
        self.task = task(count, self.batch.controls)
        self.observed = self._sensors_of(observe)
        self.asked = dict.fromkeys((*task.sensors, *self.observed))
        self.limit = task.seconds
        self.now = self._read()
        width = task.observations + sum(self.now.sensors[name].shape[1] for name in self.observed)
        self.observation_space = gymnasium.spaces.Box(-_LARGEST, _LARGEST, (width,), np.float32)
        self.action_space = gymnasium.spaces.Box(-1, 1, (task.actions,), np.float32)

    def _sensors_of(self, observe: Sequence[str]) -> list[str]:
        """Names after "sensor:". Refuses others, and sensors that never have a value."""
        if isinstance(observe, str):
            raise UsageError(f"observe is one text, '{observe}'; give a list of texts")
        names = []
        for entry in observe:
            kind, _, name = entry.partition(":")
            if kind != "sensor" or not name:
                raise UsageError(f"observe has '{entry}'; give entries such as 'sensor:NAME'")
            sensors = self.batch.sensors
            sensors[name]  # UnknownNameError
            if name in sensors.missing:
                raise UsageError(f"observe has '{entry}', which has no value: {sensors.missing[name]}")
            names.append(name)
        return names

    def _read(self) -> Now:
        names = self.task.bodies
        poses, velocities = self.batch.poses(*names), self.batch.velocities(*names)
        return Now(
            {name: poses[:, i] for i, name in enumerate(names)},
            {name: velocities[:, i] for i, name in enumerate(names)},
            self.batch.joint_displacements,
            self.batch.joint_rates,
            self.batch.time,
            self._read_sensors(),
        )

    def _read_sensors(self) -> dict[str, npt.NDArray[np.float64]]:
        if not self.asked:
            return {}
        sensors = self.batch.sensors
        return {name: sensors[name] for name in self.asked}

    def begin(self, mask: npt.NDArray[np.bool_], rng: np.random.Generator) -> None:
        seeds = None
        if len(self.batch.seeds):
            seeds = np.zeros(len(mask), dtype=np.int64)
            seeds[mask] = rng.integers(2**63 - 1, size=int(mask.sum()))
        self.task.begin(mask, rng)
        self.batch.reset(mask, seeds=seeds)
        self.now = self._read()

    def observation(self) -> npt.NDArray[np.float32]:
        # Means over a step have no value before the first one.
        measured = [np.nan_to_num(self.now.sensors[name], nan=0.0) for name in self.observed]
        seen = np.hstack([self.task.observe(self.now), *measured])
        return np.clip(seen, -_LARGEST, _LARGEST).astype(np.float32)

    def advance(self, actions: npt.ArrayLike) -> tuple[npt.NDArray[np.float64], ...]:
        """Reward, terminated, truncated, done what was asked, numbers finite: (n,) each."""
        action = np.clip(np.asarray(actions, dtype=float).reshape(self.task.count, self.task.actions), -1, 1)
        if not np.isfinite(action).all():
            raise UsageError("actions must be finite")
        before = self.now
        report = self.batch.step(self.task.act(action), steps=self.task.steps)
        self.now = self._read()
        reward, terminated, success = self.task.judge(before, self.now, action)
        # A step whose numbers were not finite was undone; nothing is to be learnt from it.
        terminated = terminated | ~report.finite
        return reward, terminated, self.now.time > self.limit - 1e-9, success, report.finite

    def info(self) -> dict[str, npt.NDArray[np.float64]]:
        return self.batch.factors


class Environment(gymnasium.Env):
    """One member.

    Args:
        task: a class of TASKS, or one of your own.
        randomise: what is drawn anew at every reset, as of `fork1s.Batch`; True: the task's own, False: nothing.
        model: what `load` takes in place of the task's scene.
        observe: "sensor:NAME" of sensors of the model, whose values come after what the task observes, in the units
            of the file, clipped to ±10; 0 before the first step of means over a step. Raises UsageError for those
            without a value, UnknownNameError for those that there are not.
    """

    metadata = {"render_modes": []}

    def __init__(
        self,
        task: type[Task],
        *,
        randomise: Randomise = True,
        model: Any = None,
        observe: Sequence[str] = (),
        render_mode: None = None,
    ) -> None:
        self.render_mode = render_mode
        self.members = _Members(task, 1, randomise, 1, model, observe)
        self.observation_space = self.members.observation_space
        self.action_space = self.members.action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.members.begin(np.ones(1, dtype=bool), self.np_random)
        return self.members.observation()[0], {k: float(v[0]) for k, v in self.members.info().items()}

    def step(self, action: npt.ArrayLike) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        reward, terminated, truncated, success, finite = self.members.advance(action)
        info = {"success": bool(success[0]), "finite": bool(finite[0])}
        return self.members.observation()[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]), info


class VectorEnvironment(gymnasium.vector.VectorEnv):
    """Many members that step as one, on threads; a member that is done starts anew in the step after.

    Args:
        num_envs: members.
        threads: of the batch; default: as many as there are cores.
        task: as of Environment.
        randomise: as of Environment; drawn for each member.
        model: as of Environment.
        observe: as of Environment.
    """

    metadata = {"render_modes": [], "autoreset_mode": gymnasium.vector.AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        num_envs: int,
        task: type[Task],
        *,
        randomise: Randomise = True,
        threads: int | None = None,
        model: Any = None,
        observe: Sequence[str] = (),
        render_mode: None = None,
    ) -> None:
        self.num_envs = num_envs
        self.render_mode = render_mode
        self.members = _Members(task, num_envs, randomise, threads, model, observe)
        self.single_observation_space = self.members.observation_space
        self.single_action_space = self.members.action_space
        self.observation_space = gymnasium.vector.utils.batch_space(self.single_observation_space, num_envs)
        self.action_space = gymnasium.vector.utils.batch_space(self.single_action_space, num_envs)
        self._ended = np.zeros(num_envs, dtype=bool)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        mask = np.ones(self.num_envs, dtype=bool)
        if options and "reset_mask" in options:
            mask = np.asarray(options["reset_mask"], dtype=bool)
        self.members.begin(mask, self.np_random)
        self._ended[mask] = False
        return self.members.observation(), self.members.info()

    def step(self, actions: npt.ArrayLike) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        again = self._ended
        reward, terminated, truncated, success, finite = self.members.advance(actions)
        if again.any():
            self.members.begin(again, self.np_random)
            reward, terminated, truncated, success = (
                np.where(again, 0, a) for a in (reward, terminated, truncated, success)
            )
        terminated, truncated = terminated.astype(bool), truncated.astype(bool)
        self._ended = terminated | truncated
        return (
            self.members.observation(),
            reward,
            terminated,
            truncated,
            {"success": success.astype(bool), "finite": finite},
        )


for _task in TASKS:
    gymnasium.register(
        f"fork1s/{_task.name}-v0",
        entry_point="fork1s.learn:Environment",
        vector_entry_point="fork1s.learn:VectorEnvironment",
        kwargs={"task": _task},
    )
