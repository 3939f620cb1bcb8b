"""Members of a batch as the VecEnv that Stable-Baselines3 trains on."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ._errors import UsageError

Frames = list[npt.NDArray[np.uint8] | None]
# A generator for each member, from its seed, or from the generators before.
Seeding = Callable[[Sequence[int | None], Any], list[np.random.Generator]]


class Adapter:
    """What a VecEnv must do. A member that is done begins again in the same step, as VecEnv asks for."""

    num_envs: int
    # Of VecEnv: for the next reset.
    _seeds: list[int | None]
    _options: list[dict[str, Any]]
    reset_infos: list[dict[str, Any]]

    def __init__(self, members: Any, render_mode: str | None, seeding: Seeding) -> None:
        self.members = members
        self._mode = render_mode
        self._seeding = seeding
        self._generators: list[np.random.Generator] | None = None
        self._actions: npt.ArrayLike | None = None
        base = type(self).__mro__[2]
        base.__init__(  # type: ignore[misc]  # of VecEnv, which is known where it is installed alone
            self, members.task.count, members.observation_space, members.action_space
        )

    def reset(self) -> npt.NDArray[np.float32]:
        """Observations (n, o). Members draw from the seeds of `seed`, given before, or go on with their own."""
        if any(self._options):
            raise UsageError("set_options was given options, which this adapter does not take")
        self._generators = self._seeding(self._seeds, self._generators)
        self._seeds = [None] * self.num_envs
        self.members.begin(np.ones(self.num_envs, dtype=bool), self._generators)
        self.reset_infos = self._factors()
        seen: npt.NDArray[np.float32] = self.members.observation()
        return seen

    def step_async(self, actions: npt.ArrayLike) -> None:
        self._actions = actions

    def step_wait(
        self,
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32], npt.NDArray[np.bool_], list[dict[str, Any]]]:
        """Observations (n, o), rewards (n,), whether each is done, and a dictionary of each: `success` and `is_success`,
        `finite`, `TimeLimit.truncated`, and of one that is done its `terminal_observation`."""
        if self._actions is None:
            raise UsageError("step_wait was called before step_async; call step_async first")
        actions, self._actions = self._actions, None
        reward, terminated, truncated, success, finite = self.members.advance(actions)
        seen = self.members.observation()
        done = terminated | truncated
        infos: list[dict[str, Any]] = [
            {
                "success": bool(success[i]),
                "is_success": bool(success[i]),
                "finite": bool(finite[i]),
                "TimeLimit.truncated": bool(truncated[i] and not terminated[i]),
            }
            for i in range(self.num_envs)
        ]
        if done.any():
            for i in np.flatnonzero(done):
                infos[i]["terminal_observation"] = seen[i].copy()
            self.members.begin(done, self._generators)
            seen = self.members.observation()
            drawn = self._factors()
            for i in np.flatnonzero(done):
                self.reset_infos[i] = drawn[i]
        return seen, reward.astype(np.float32), done, infos

    def _factors(self) -> list[dict[str, Any]]:
        info = self.members.info()
        return [{name: float(value[i]) for name, value in info.items()} for i in range(self.num_envs)]

    def close(self) -> None:
        self.members.close()

    def get_images(self) -> Frames:
        frames = self.members.frames()
        return [None] * self.num_envs if frames is None else list(frames)

    def _members_of(self, indices: int | Iterable[int] | None) -> list[int]:
        if indices is None:
            return list(range(self.num_envs))
        chosen = [indices] if isinstance(indices, (int, np.integer)) else list(indices)
        for i in chosen:
            if not 0 <= i < self.num_envs:
                raise UsageError(f"indices has {i}; members are 0 to {self.num_envs - 1}")
        return [int(i) for i in chosen]

    def get_attr(self, attr_name: str, indices: int | Iterable[int] | None = None) -> list[Any]:
        """An attribute of the task, which all members share, or `render_mode`."""
        value = self._mode if attr_name == "render_mode" else getattr(self.members.task, attr_name)
        return [value] * len(self._members_of(indices))

    def set_attr(self, attr_name: str, value: Any, indices: int | Iterable[int] | None = None) -> None:
        """Sets an attribute of the task, of all members. Raises UsageError for some of them."""
        if len(set(self._members_of(indices))) != self.num_envs:
            raise UsageError(
                f"set_attr of '{attr_name}' for some members: all share one task; leave out indices"
            )
        setattr(self.members.task, attr_name, value)

    def env_method(
        self,
        method_name: str,
        *method_args: Any,
        indices: int | Iterable[int] | None = None,
        **method_kwargs: Any,
    ) -> list[Any]:
        """`render`: a picture of each member. Raises UsageError for others: no member is an environment of its own."""
        if method_name != "render" or method_args or method_kwargs:
            raise UsageError(
                f"env_method has '{method_name}'; members are one batch, of which each has 'render' alone, without arguments"
            )
        frames = self.get_images()
        return [frames[i] for i in self._members_of(indices)]

    def env_is_wrapped(
        self, wrapper_class: type[Any], indices: int | Iterable[int] | None = None
    ) -> list[bool]:
        return [False] * len(self._members_of(indices))


@functools.cache
def adapter_class() -> type[Adapter]:
    """A class that is a VecEnv of the package stable_baselines3."""
    try:
        from stable_baselines3.common.vec_env import VecEnv
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"fork1s.learn.sb3 needs stable-baselines3 ({error}): pip install stable-baselines3",
            name=error.name,
        ) from None
    made: type[Adapter] = type(VecEnv)("BatchVecEnv", (Adapter, VecEnv), {"__doc__": Adapter.__doc__})
    return made
