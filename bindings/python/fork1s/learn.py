"""Environments of Gymnasium on batches of simulations: one, or many that step as one.

    import gymnasium, fork1s.learn
    env = gymnasium.make("fork1s/GraspLift-v0")
    many = gymnasium.make_vec("fork1s/Quadruped-v0", num_envs=64)       # a fork1s.Batch inside

docs/learning.md explains them from the beginning. Needs `pip install 'fork1s[learn]'`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np
import numpy.typing as npt

try:
    import gymnasium
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(
        "fork1s.learn needs gymnasium: pip install 'fork1s[learn]'", name=error.name
    ) from None

from ._core import Batch
from ._errors import UsageError
from ._load import load, scene
from ._render import Renderer
from ._sb3 import adapter_class
from ._tasks import TASKS, GraspLift, Now, PegInsertion, Quadruped, Task

if TYPE_CHECKING:
    from typing_extensions import Unpack  # that of typing is of Python 3.11

__all__ = [
    "Environment",
    "EnvironmentOptions",
    "GraspLift",
    "Now",
    "PegInsertion",
    "Picture",
    "Quadruped",
    "Task",
    "VectorEnvironment",
    "TASKS",
    "sb3",
]

Randomise = Mapping[str, tuple[float, float]] | bool
# Of one generator for all members, or one for each.
Generators = np.random.Generator | Sequence[np.random.Generator]
_LARGEST = 10.0  # of what is observed


@dataclass(frozen=True)
class Picture:
    """What `render` returns with render_mode "rgb_array": pixels, and the camera of the model, None for a free one."""

    height: int = 360
    width: int = 480
    camera: str | None = None


class EnvironmentOptions(TypedDict, total=False):
    """Arguments of every kind of environment; Environment explains them."""

    randomise: Randomise
    model: Any
    observe: Sequence[str]
    max_episode_steps: int | None
    integrator: str | None
    render_mode: str | None
    picture: Picture | None


class _Members:
    """A task on a batch: what both kinds of environment are made of."""

    def __init__(
        self,
        task: type[Task],
        count: int,
        threads: int | None,
        /,
        *,
        randomise: Randomise = True,
        model: Any = None,
        observe: Sequence[str] = (),
        max_episode_steps: int | None = None,
        integrator: str | None = None,
        render_mode: str | None = None,
        picture: Picture | None = None,
        **unknown: Any,
    ) -> None:
        if "dt" in unknown:
            raise UsageError(
                f"dt is the task's, {task.dt:.4g} s in {task.steps} steps an action: "
                f"class Finer({task.__name__}): dt = {task.dt / 2:.4g}; steps = {2 * task.steps}"
            )
        if unknown:
            raise TypeError(f"an environment has no option '{next(iter(unknown))}'")
        if render_mode not in (None, "rgb_array"):
            raise UsageError(f"render_mode is {render_mode!r}; give 'rgb_array' or None")
        if max_episode_steps is not None and (
            isinstance(max_episode_steps, bool)
            or not isinstance(max_episode_steps, (int, np.integer))
            or max_episode_steps < 1
        ):
            raise UsageError(
                f"max_episode_steps is {max_episode_steps!r}; give a whole number from 1 on, or None"
            )
        self.max_steps = max_episode_steps
        self.steps_made = np.zeros(count, dtype=np.int64)
        self.has_begun = False
        self.model = load(scene(task.scene) if model is None else model, **task.load)
        ranges = task.randomise if randomise is True else randomise or None
        # Drawn at every reset, by seeds from the generator of the environment.
        drawn: dict[str, Any] = {} if ranges is None else {"seeds": 0, "randomise": ranges}
        self.batch = Batch(
            self.model, count, dt=task.dt, threads=threads or 0, integrator=integrator, **drawn
        )
        self.task = task(count, self.batch.controls)
        self.observed = self._sensors_of(observe)
        self.asked = dict.fromkeys((*task.sensors, *self.observed))
        self.limit = task.seconds
        self.now = self._read()
        width = task.observations + sum(self.now.sensors[name].shape[1] for name in self.observed)
        self.observation_space = gymnasium.spaces.Box(-_LARGEST, _LARGEST, (width,), np.float32)
        self.action_space = gymnasium.spaces.Box(-1, 1, (task.actions,), np.float32)
        self.render_mode = render_mode
        self.picture = Picture() if picture is None else picture
        self.renderer = (
            None
            if render_mode is None
            else Renderer(self.model, self.picture.height, self.picture.width, self.picture.camera)
        )
        self.metadata = {"render_modes": ["rgb_array"], "render_fps": round(1 / (task.dt * task.steps))}

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

    def begin(
        self,
        mask: npt.NDArray[np.bool_],
        generators: Generators,
        factors: Mapping[str, npt.ArrayLike] | None = None,
    ) -> None:
        seeds = np.zeros(len(mask), dtype=np.int64) if len(self.batch.seeds) else None
        if isinstance(generators, np.random.Generator):
            draws = [(mask, generators)]
        else:  # as if each were the only one
            draws = [(np.arange(len(mask)) == i, generators[int(i)]) for i in np.flatnonzero(mask)]
        for members, rng in draws:
            if seeds is not None:
                seeds[members] = rng.integers(2**63 - 1, size=int(members.sum()))
            self.task.begin(members, rng)
        if seeds is None:  # without seeds a batch keeps factors that a reset before gave
            factors = {**dict.fromkeys(self.batch.factors, 1.0), **(factors or {})}
        self.batch.reset(mask, seeds=seeds, factors=factors)
        self.steps_made[mask] = 0
        self.has_begun = True
        self.now = self._read()

    def _of_task(
        self, what: str, value: Any, shape: tuple[int, ...], because: str
    ) -> npt.NDArray[np.float64]:
        """What a method of the task returned, as numbers of this shape. Refuses all else."""
        task = f"task '{self.task.name or type(self.task).__name__}': {what}"
        try:
            array = np.asarray(value)
        except ValueError as error:
            raise UsageError(
                f"{task} returned no array ({error}); return one of shape {shape}, {because}"
            ) from error
        if array.dtype.kind not in "biuf":
            raise UsageError(f"{task} returned an array of dtype {array.dtype}; return real numbers")
        if array.shape != shape:
            raise UsageError(
                f"{task} returned an array of shape {array.shape}; {shape} is expected, {because}"
            )
        finite = np.isfinite(array)
        if not finite.all():
            first = tuple(int(i) for i in np.argwhere(~finite)[0])
            at = f"member {first[0]}" + (f", entry {first[1]}" if len(first) > 1 else "")
            raise UsageError(f"{task} returned {array[first]} for {at}; return finite numbers")
        return array.astype(np.float64)

    def observation(self) -> npt.NDArray[np.float32]:
        count, width = self.task.count, self.task.observations
        observed = self._of_task(
            "observe", self.task.observe(self.now), (count, width), f"(members, Task.observations = {width})"
        )
        # Means over a step have no value before the first one.
        measured = [np.nan_to_num(self.now.sensors[name], nan=0.0) for name in self.observed]
        seen = np.hstack([observed, *measured])
        return np.clip(seen, -_LARGEST, _LARGEST).astype(np.float32)

    def advance(
        self, actions: npt.ArrayLike
    ) -> tuple[
        npt.NDArray[np.float64],
        npt.NDArray[np.bool_],
        npt.NDArray[np.bool_],
        npt.NDArray[np.bool_],
        npt.NDArray[np.bool_],
    ]:
        """Reward, terminated, truncated, done what was asked, numbers finite: (n,) each."""
        if not self.has_begun:
            raise UsageError("step was called before reset; call reset first")
        given = np.asarray(actions, dtype=float)
        shape = (self.task.count, self.task.actions)
        if given.shape != shape and not (shape[0] == 1 and given.shape == shape[1:]):
            raise UsageError(
                f"actions have shape {given.shape}; {shape} is expected, (members, Task.actions)"
            )
        action = np.clip(given.reshape(shape), -1, 1)
        if not np.isfinite(action).all():
            raise UsageError("actions must be finite")
        before = self.now
        report = self.batch.step(self.task.act(action), steps=self.task.steps)
        self.now = self._read()
        judged = self.task.judge(before, self.now, action)
        if not isinstance(judged, tuple) or len(judged) != 3:
            raise UsageError(
                f"task '{self.task.name}': judge must return reward, whether done, and whether it has done it"
            )
        reward, terminated, success = (
            self._of_task(f"judge, {what},", value, (self.task.count,), "(members,)")
            for what, value in zip(("reward", "done", "success"), judged)
        )
        self.steps_made += 1
        truncated = self.now.time > self.limit - 1e-9
        if self.max_steps is not None:
            truncated = truncated | (self.steps_made >= self.max_steps)
        finite = report.finite.astype(bool)
        # A step whose numbers were not finite was undone; nothing is to be learnt from it.
        return reward, (terminated != 0) | ~finite, truncated, success != 0, finite

    def frames(self) -> tuple[npt.NDArray[np.uint8], ...] | None:
        """A picture of each member, (height, width, 3); None without a render_mode."""
        if self.renderer is None:
            return None
        return tuple(self.renderer.draw(poses) for poses in self.batch.poses())

    def close(self) -> None:
        if self.renderer is not None:
            self.renderer.close()
        self.renderer = None

    def info(self) -> dict[str, npt.NDArray[np.float64]]:
        return self.batch.factors


class Environment(gymnasium.Env):
    """One member.

    Args:
        task: a class of TASKS, or one of your own.
        randomise: what is drawn again at every reset, as of `fork1s.Batch`; True: the task's own, False: nothing.
        model: what `load` takes in place of the task's scene.
        observe: "sensor:NAME" of sensors of the model, whose values come after what the task observes, in the units
            of the file, clipped to ±10; 0 before the first step of means over a step. Raises UsageError for those
            without a value, UnknownNameError for those that there are not.
        max_episode_steps: steps after which an episode is truncated, beside the task's own seconds.
        integrator: as of `fork1s.Batch`; "euler" takes half the time of "two-stage", the default, or less, and errs more.
        render_mode: "rgb_array": `render` returns a picture by MuJoCo's renderer, for which the package mujoco and OpenGL
            must be there (`MUJOCO_GL=egl` without a display).
        picture: its size and camera.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 30}

    def __init__(self, task: type[Task], **options: Unpack[EnvironmentOptions]) -> None:
        self.members = _Members(task, 1, 1, **options)
        self.render_mode = self.members.render_mode
        self.metadata = self.members.metadata
        self.observation_space = self.members.observation_space
        self.action_space = self.members.action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """options: `factors`, in place of those drawn, as of `fork1s.Batch.reset`: {"mass:cube": 2}."""
        super().reset(seed=seed)
        self.members.begin(np.ones(1, dtype=bool), self.np_random, _factors_of(options))
        return self.members.observation()[0], {k: float(v[0]) for k, v in self.members.info().items()}

    def step(self, action: npt.ArrayLike) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        reward, terminated, truncated, success, finite = self.members.advance(action)
        info = {"success": bool(success[0]), "finite": bool(finite[0])}
        return self.members.observation()[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]), info

    def render(self) -> Any:
        """(height, width, 3), RGB; None without a render_mode."""
        frames = self.members.frames()
        return None if frames is None else frames[0]

    def close(self) -> None:
        self.members.close()


class VectorEnvironment(gymnasium.vector.VectorEnv):
    """Many members that step as one, on threads; a member that is done starts again in the step after.

    Args:
        num_envs: members.
        threads: of the batch; default: as many as there are cores.
        task: as of Environment.
        randomise: as of Environment; drawn for each member.
        model: as of Environment.
        observe: as of Environment.
        max_episode_steps, integrator, render_mode, picture: as of Environment; `render` returns a picture of each member.
    """

    metadata = {
        "render_modes": ["rgb_array"],
        "render_fps": 30,
        "autoreset_mode": gymnasium.vector.AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int,
        task: type[Task],
        *,
        threads: int | None = None,
        **options: Unpack[EnvironmentOptions],
    ) -> None:
        self.num_envs = num_envs
        self.members = _Members(task, num_envs, threads, **options)
        self.render_mode = self.members.render_mode
        self.metadata = {**self.metadata, **self.members.metadata}
        self.single_observation_space = self.members.observation_space
        self.single_action_space = self.members.action_space
        self.observation_space = gymnasium.vector.utils.batch_space(self.single_observation_space, num_envs)
        self.action_space = gymnasium.vector.utils.batch_space(self.single_action_space, num_envs)
        self._ended = np.zeros(num_envs, dtype=bool)
        self._generators: list[np.random.Generator] | None = None  # of each, where seeds were a list

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """seed: a number for all members together; or a list with one for each, which then does bit by bit, in all its
        episodes, what an Environment of that seed does, and None for a member that goes on with its own.
        options: `factors`, in place of those drawn, a number or (n,) each, as of `fork1s.Batch.reset`; `reset_mask`."""
        mask = np.ones(self.num_envs, dtype=bool)
        if options and "reset_mask" in options:
            mask = np.asarray(options["reset_mask"], dtype=bool)
            if not self.members.has_begun and not mask.all():
                raise UsageError(
                    "reset_mask leaves members out that have not begun; call reset for all first"
                )
        if isinstance(seed, Sequence) or (isinstance(seed, np.ndarray) and seed.ndim > 0):
            self._generators = _generators_of(seed, self.num_envs, self._generators)
        else:
            super().reset(seed=seed)
            if seed is not None:
                self._generators = None
        self.members.begin(mask, self._drawn_by(), _factors_of(options, "reset_mask"))
        self._ended[mask] = False
        return self.members.observation(), self.members.info()

    def _drawn_by(self) -> Generators:
        return self.np_random if self._generators is None else self._generators

    def step(self, actions: npt.ArrayLike) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        again = self._ended
        reward, terminated, truncated, success, finite = self.members.advance(actions)
        if again.any():
            self.members.begin(again, self._drawn_by())
            reward, terminated, truncated, success = (
                np.where(again, np.zeros_like(a), a) for a in (reward, terminated, truncated, success)
            )
        self._ended = terminated | truncated
        return (
            self.members.observation(),
            reward,
            terminated,
            truncated,
            {"success": success, "finite": finite},
        )

    def render(self) -> tuple[npt.NDArray[np.uint8], ...] | None:
        """(height, width, 3), RGB, of each member; None without a render_mode."""
        return self.members.frames()

    def close_extras(self, **kwargs: Any) -> None:
        self.members.close()


def _factors_of(options: dict[str, Any] | None, *others: str) -> Mapping[str, npt.ArrayLike] | None:
    known = ("factors", *others)
    for name in options or {}:
        if name not in known:
            raise UsageError(f"options of reset have '{name}'; there are: {', '.join(known)}")
    return (options or {}).get("factors")


def _generators_of(
    seeds: Sequence[int | None] | npt.NDArray[Any], count: int, before: list[np.random.Generator] | None
) -> list[np.random.Generator]:
    if len(seeds) != count:
        raise UsageError(f"seed is a list of {len(seeds)}; give one number or {count}, one for each member")
    generators = []
    for i, seed in enumerate(seeds):
        if seed is None and before is not None:
            generators.append(before[i])
            continue
        if seed is not None and (
            isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0
        ):
            raise UsageError(f"seed has {seed!r} for member {i}; give whole numbers from 0 on, or None")
        generators.append(gymnasium.utils.seeding.np_random(None if seed is None else int(seed))[0])
    return generators


def sb3(
    task: type[Task],
    num_envs: int,
    *,
    threads: int | None = None,
    **options: Unpack[EnvironmentOptions],
) -> Any:
    """A VecEnv of Stable-Baselines3 whose members step as one batch.

        policy = stable_baselines3.PPO("MlpPolicy", fork1s.learn.sb3(fork1s.learn.Quadruped, 64), seed=1)

    A member that is done begins again in the same step, and its dictionary has the `terminal_observation`. `seed(s)` gives
    member i the seed s + i at the next reset, by which it does what an Environment of that seed does.

    Args:
        as of VectorEnvironment.

    Raises:
        ModuleNotFoundError: without the package stable-baselines3.
    """
    members = _Members(task, num_envs, threads, **options)
    return adapter_class()(
        members, members.render_mode, lambda seeds, before: _generators_of(seeds, num_envs, before)
    )


for _task in TASKS:
    gymnasium.register(
        f"fork1s/{_task.name}-v0",
        entry_point="fork1s.learn:Environment",
        vector_entry_point="fork1s.learn:VectorEnvironment",
        kwargs={"task": _task},
    )
