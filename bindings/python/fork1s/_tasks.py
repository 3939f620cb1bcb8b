"""What an environment asks for, for many members at a time: all arrays have the member first.

A task never sees one simulation: it gets the poses and rates of all, and answers with controls, observations and
rewards of all. fork1s.learn makes Gymnasium's environments of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from ._core import Batch

Floats = npt.NDArray[np.float64]


@dataclass
class Now:
    """All members at a moment."""

    poses: dict[str, Floats]  # body -> (n, 7): position [m], quaternion w x y z
    velocities: dict[str, Floats]  # body -> (n, 6): angular, linear of the origin; world axes
    joint_displacements: Floats  # (n, q), of `Batch.joint_displacements`
    joint_rates: Floats
    time: Floats  # s since each began
    sensors: Mapping[str, Floats] = field(
        default_factory=dict
    )  # name -> (n, k), where asked for; NaN: no value


def turned_back(quaternion: Floats, vector: Floats) -> Floats:
    """Vectors of the world in the axes of bodies: (n, 3)."""
    w, u = quaternion[:, :1], -quaternion[:, 1:]
    twice = 2 * np.cross(u, vector)
    return vector + w * twice + np.cross(u, twice)


class Task:
    """One thing to learn. Sizes and limits are those of an action or observation of one member."""

    name = ""
    scene = ""
    load: Mapping[str, Any] = {}
    dt = 1 / 60
    steps = 2
    seconds = 4.0
    bodies: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()  # of the model, for Now.sensors
    actions = 0
    observations = 0
    randomise: Mapping[str, tuple[float, float]] = Batch.usual_ranges

    def __init__(self, count: int, controls: list[str]) -> None:
        self.count = count
        self.controls = controls
        self.command = np.zeros((count, len(controls)))  # what the controls are told

    def begin(self, mask: npt.NDArray[np.bool_], rng: np.random.Generator) -> None:
        """Members of the mask start again: draws what they do not know."""
        self.command[mask] = 0

    def act(self, action: Floats) -> Floats:
        """Actions of -1 to 1, (n, a), to controls, (n, c)."""
        raise NotImplementedError

    def observe(self, now: Now) -> Floats:
        """(n, o), in units that make them of the order of 1."""
        raise NotImplementedError

    def judge(
        self, before: Now, now: Now, action: Floats
    ) -> tuple[Floats, npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
        """Reward of the action, whether the member is done, and whether it has done it: (n,) each."""
        raise NotImplementedError

    def _to(self, name: str, value: Floats, rate: float) -> None:
        """Moves a command towards a value, by `rate` units a second at most."""
        at = self.controls.index(name)
        step = rate * self.dt * self.steps
        self.command[:, at] += np.clip(value - self.command[:, at], -step, step)

    def _of(self, *names: str) -> Floats:
        return self.command[:, [self.controls.index(n) for n in names]]


class GraspLift(Task):
    """A parallel gripper takes a cube from the floor and lifts it by 60 mm.

    Action: close (-1 open, 1 with 0.5 rad of both servos), lift (speed, 80 mm/s). The hand stands beside the cube by up
    to 5 mm, and is not told.
    """

    name = "GraspLift"
    scene = "fourbar_gripper"
    load = {"base": "driven"}
    bodies = ("cube", "left_jaw", "right_jaw", "mount")
    actions = 2
    observations = 16
    height = 0.06

    def begin(self, mask: npt.NDArray[np.bool_], rng: np.random.Generator) -> None:
        super().begin(mask, rng)
        if not hasattr(self, "offset"):
            self.offset = np.zeros((self.count, 2))
        self.offset[mask] = rng.uniform(-0.005, 0.005, (int(mask.sum()), 2))

    def act(self, action: Floats) -> Floats:
        grip = 0.25 * (action[:, 0] + 1)
        for name in ("left_grip", "right_grip"):
            self._to(name, grip, 2.0)
        for axis in (0, 1):
            self._to("mount." + "xy"[axis], self.offset[:, axis], 0.05)
        up = self._of("mount.z")[:, 0] + 0.08 * self.dt * self.steps * action[:, 1]
        self._to("mount.z", np.clip(up, 0, 0.12), 1.0)
        return self.command

    def observe(self, now: Now) -> Floats:
        middle = (now.poses["left_jaw"][:, :3] + now.poses["right_jaw"][:, :3]) / 2
        return np.hstack(
            [
                (now.poses["cube"][:, :3] - middle) / 0.05,
                now.poses["cube"][:, 2:3] / self.height,
                now.velocities["cube"] * [0.1, 0.1, 0.1, 5, 5, 5],
                self._of("left_grip") * 2,
                self._of("mount.z") / self.height,
                now.joint_displacements[:, :2] * 2,
                now.joint_rates[:, :2],
            ]
        )

    def judge(self, before: Now, now: Now, action: Floats) -> tuple[Floats, Any, Any]:
        lifted = now.poses["cube"][:, 2] - 0.012
        gained = now.poses["cube"][:, 2] - before.poses["cube"][:, 2]
        away = np.linalg.norm(now.poses["cube"][:, :2] - now.poses["mount"][:, :2], axis=1) > 0.08
        done = lifted > self.height
        return gained / self.height - 0.002 * (action**2).sum(axis=1) + done - 1.0 * away, done | away, done


class PegInsertion(Task):
    """A peg goes 40 mm into a hole of 0.1 mm of room, tilted and beside its path.

    Action: speeds of the stand across (20 mm/s), of its tilt (0.2 rad/s), and of the feed (60 mm/s). The stand is beside
    where it believes to be by up to 2 mm and 1 degree.
    """

    name = "PegInsertion"
    scene = "peg_gripper"
    load = {"base": "driven"}
    seconds = 3.0
    bodies = ("peg", "mount")
    actions = 5
    observations = 18
    depth = 0.04
    _axes = ("stand.x", "stand.y", "stand.rx", "stand.ry")
    _speeds = np.array([0.02, 0.02, 0.2, 0.2])
    _reach = np.array([0.004, 0.004, 0.06, 0.06])

    def begin(self, mask: npt.NDArray[np.bool_], rng: np.random.Generator) -> None:
        super().begin(mask, rng)
        if not hasattr(self, "offset"):
            self.offset, self.wish = np.zeros((self.count, 4)), np.zeros((self.count, 4))
        self.offset[mask] = rng.uniform(-1, 1, (int(mask.sum()), 4)) * [0.002, 0.002, 0.0175, 0.0175]
        self.wish[mask] = 0

    def act(self, action: Floats) -> Floats:
        h = self.dt * self.steps
        self.wish = np.clip(self.wish + action[:, :4] * self._speeds * h, -self._reach, self._reach)
        for i, axis in enumerate(self._axes):
            self._to(axis, self.wish[:, i] + self.offset[:, i], 3 * self._speeds[i])
        feed = self._of("feed")[:, 0] + 0.06 * h * action[:, 4]
        self._to("feed", np.clip(feed, 0, 0.055), 1.0)
        return self.command

    def _nose(self, now: Now) -> Floats:
        down = np.broadcast_to([0.0, 0.0, -0.063], (self.count, 3))
        q = now.poses["peg"][:, 3:] * [1, -1, -1, -1]
        return now.poses["peg"][:, :3] + turned_back(q, down)

    def observe(self, now: Now) -> Floats:
        tilt = turned_back(now.poses["peg"][:, 3:], np.broadcast_to([0.0, 0.0, 1.0], (self.count, 3)))[:, :2]
        fed = 0.165 - now.poses["mount"][:, 2:3]
        lag = self._of("feed") - fed
        return np.hstack(
            [
                self._nose(now) * [500, 500, 25],
                tilt * 20,
                self.wish / self._reach,
                fed * 20,
                lag * 200,
                now.velocities["peg"] * [1, 1, 1, 20, 20, 20],
                now.time[:, None] / self.seconds,
            ]
        )

    def judge(self, before: Now, now: Now, action: Floats) -> tuple[Floats, Any, Any]:
        z, z_before = self._nose(now)[:, 2], self._nose(before)[:, 2]
        done = z < -self.depth
        return (z_before - z) / self.depth - 0.001 * (action**2).sum(axis=1) + done, done, done


class Quadruped(Task):
    """Four legs walk along x over rough ground.

    Action: set-points of the twelve servos (0.3 rad for hips, 0.6 rad for the others). A clock of 2 Hz is part of what is
    observed.
    """

    name = "Quadruped"
    scene = "quadruped"
    bodies = ("trunk",)
    actions = 12
    observations = 50
    beat = 2.0  # Hz
    _reach = np.tile([0.3, 0.6, 0.6], 4)

    def begin(self, mask: npt.NDArray[np.bool_], rng: np.random.Generator) -> None:
        super().begin(mask, rng)
        if not hasattr(self, "phase"):
            self.phase = np.zeros(self.count)
        self.phase[mask] = rng.uniform(0, 2 * np.pi, int(mask.sum()))

    def act(self, action: Floats) -> Floats:
        self.command[:] = action * self._reach
        return self.command

    def _upright(self, now: Now) -> Floats:
        return turned_back(now.poses["trunk"][:, 3:], np.broadcast_to([0.0, 0.0, 1.0], (self.count, 3)))

    def observe(self, now: Now) -> Floats:
        q, V = now.poses["trunk"][:, 3:], now.velocities["trunk"]
        angle = 2 * np.pi * self.beat * now.time + self.phase
        forward = turned_back(q * [1, -1, -1, -1], np.broadcast_to([1.0, 0.0, 0.0], (self.count, 3)))
        return np.hstack(
            [
                np.sin(angle)[:, None],
                np.cos(angle)[:, None],
                self._upright(now),
                forward[:, 1:2],
                now.poses["trunk"][:, 2:3] / 0.3,
                now.poses["trunk"][:, 1:2],
                turned_back(q, V[:, 3:]),
                turned_back(q, V[:, :3]) / 3,
                now.joint_displacements,
                now.joint_rates / 10,
                self.command / self._reach,
            ]
        )

    def judge(self, before: Now, now: Now, action: Floats) -> tuple[Floats, Any, Any]:
        gained = now.poses["trunk"][:, 0] - before.poses["trunk"][:, 0]
        fallen = (self._upright(now)[:, 2] < 0.5) | (now.poses["trunk"][:, 2] < 0.13)
        reward = (
            gained
            - 0.02 * np.abs(now.poses["trunk"][:, 1]) * self.dt
            - 2e-4 * (action**2).sum(axis=1)
            - 0.5 * fallen
        )
        return reward, fallen, np.zeros(self.count, dtype=bool)


TASKS = (GraspLift, PegInsertion, Quadruped)
