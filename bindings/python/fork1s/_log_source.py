"""What an export to a log reads of a recording: shapes to draw, steps one after the other, arrows of forces."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ._core import RecordedShape, RecordingReader

Array = NDArray[np.float64]

FIRST_HIDDEN_GROUP = 3  # of MuJoCo's convention: groups from here on hold shapes that models do not show
STRETCH_BYTES = (
    8 << 20
)  # as much as is read at a time: thousands of steps of a robot, and no memory to speak of
PLANE_MARGIN = 1.5  # of how far what moves gets over a plane without end, as in glTF exports


@dataclass(frozen=True)
class Triangles:
    """Vertices (n, 3) [m] and normals (n, 3) in the frame of a shape; vertex numbers (k, 3)."""

    vertices: Array
    normals: Array
    corners: NDArray[np.int64]


@dataclass(frozen=True)
class Contact:
    """A contact of a step; bodies by name, `force` on b [N], `point` [m], world axes."""

    body_a: str
    body_b: str
    point: Array
    normal: Array
    force: Array
    gap: float
    friction: float


@dataclass(frozen=True)
class Push:
    """A push from outside: `force` [N], and `moment` [N·m] about `point` [m], world axes."""

    body: str
    force: Array
    moment: Array
    point: Array


class Stretch:
    """Some steps of a recording, as arrays with one row a step."""

    def __init__(
        self, source: Source, columns: Mapping[str, Array], before: tuple[float, Array] | None
    ) -> None:
        self._source = source
        self._columns = columns
        self._contact_ends = self._ends("steps/contact_end")
        self._push_ends = self._ends("steps/wrench_end")
        self.times = columns["steps/time"]
        steps = len(self.times)
        self.poses = columns["steps/poses"].reshape(steps, len(source.bodies), 7)
        self.coordinates = self.rows("steps/coordinates", len(source.coordinates))
        # No velocity is recorded: (q_i - q_(i-1)) / (t_i - t_(i-1)), the mean over the step.
        self.rates = np.full_like(self.coordinates, math.nan)
        times, coordinates = self.times, self.coordinates
        if before is not None:
            times = np.concatenate([[before[0]], times])
            coordinates = np.vstack([before[1], coordinates])
        if len(times) > 1:
            self.rates[steps - len(times) + 1 :] = (
                np.diff(coordinates, axis=0) / np.diff(times)[:, np.newaxis]
            )

    def __len__(self) -> int:
        return len(self.times)

    def rows(self, dataset: str, width: int) -> Array:
        """(steps, width); the file has no dataset of width 0."""
        return self._columns[dataset].reshape(len(self), width) if width else np.zeros((len(self), 0))

    def column(self, dataset: str) -> Array:
        return self._columns[dataset]

    def _ends(self, dataset: str) -> NDArray[np.int64]:
        """(steps + 1,) rows of a table before each step, and after the last."""
        return np.concatenate([[0], self._columns[dataset]]).astype(np.int64)

    def contacts(self, step: int) -> list[Contact]:
        c, ends = self._columns, self._contact_ends
        return [
            Contact(
                self._source.name_of(c["contacts/body_a"][k]),
                self._source.name_of(c["contacts/body_b"][k]),
                c["contacts/point"][k],
                c["contacts/normal"][k],
                c["contacts/force"][k],
                float(c["contacts/gap"][k]),
                float(c["contacts/friction"][k]),
            )
            for k in range(ends[step], ends[step + 1])
        ]

    def pushes(self, step: int) -> list[Push]:
        c, ends = self._columns, self._push_ends
        return [
            Push(self._source.name_of(c["wrenches/body"][k]), w[:3], w[3:6], w[6:])
            for k in range(ends[step], ends[step + 1])
            for w in [c["wrenches/wrench"][k]]
        ]


class Source:
    """A recording to export."""

    def __init__(self, path: str) -> None:
        self.path = path
        self.reader = RecordingReader(path, STRETCH_BYTES)
        self.bodies = [text(name) for name in self.reader.bodies]
        self.coordinates = [text(name) for name in self.reader.coordinates]
        self.controls = [text(name) for name in self.reader.controls]
        self.sensors = [text(name) for name in self.reader.sensors]
        self.left_out: list[str] = []
        self.shapes = self._drawn_shapes()
        self._plane_halves = self._find_plane_halves()
        self.force_scale = self._default_force_scale()

    def name_of(self, body: float) -> str:
        return "world" if body < 0 else self.bodies[int(body)]

    def start_time(self, first: float) -> float:
        """Time before the first step [s]."""
        return first - self.reader.dt

    def stretches(self) -> Iterator[Stretch]:
        before: tuple[float, Array] | None = None
        while (columns := self.reader.next()) is not None:
            stretch = Stretch(self, columns, before)
            before = float(stretch.times[-1]), stretch.coordinates[-1].copy()
            yield stretch

    def describe(self, shape: RecordedShape) -> str:
        name = f"'{text(shape.name)}'" if shape.name else f"a {shape.kind}"
        return f"shape {name} of {self.name_of(shape.body)}"

    def triangles(self, shape: RecordedShape) -> Triangles:
        if shape.kind == "plane":
            half_x, half_y = self.plane_half_sides(shape)
            corners = [[-half_x, -half_y, 0], [half_x, -half_y, 0], [half_x, half_y, 0], [-half_x, half_y, 0]]
            return Triangles(
                np.array(corners, float), np.tile([0.0, 0.0, 1.0], (4, 1)), np.array([[0, 1, 2], [0, 2, 3]])
            )
        vertices, normals, numbers = shape.triangles()
        return Triangles(vertices, normals, numbers.astype(np.int64))

    def plane_half_sides(self, shape: RecordedShape) -> tuple[float, float]:
        half_x, half_y = shape.size
        if half_x > 0 and half_y > 0:
            return float(half_x), float(half_y)
        half = self._plane_halves[self.shapes.index(shape)]
        return half, half

    def _drawn_shapes(self) -> list[RecordedShape]:
        # As the viewer chooses: neither wholly transparent shapes, nor those of hidden groups where the body has others.
        shapes = [shape for shape in self.reader.shapes if shape.color[3] > 0]
        shown = {shape.body for shape in shapes if shape.group < FIRST_HIDDEN_GROUP}
        return [shape for shape in shapes if shape.group < FIRST_HIDDEN_GROUP or shape.body not in shown]

    def _find_plane_halves(self) -> dict[int, float]:
        """Half sides of squares over which all bodies stay, of planes without end, by place among the shapes."""
        endless = [k for k, s in enumerate(self.shapes) if s.kind == "plane" and not np.all(s.size > 0)]
        if not endless:
            return {}
        low, high = self._bounds_of_motion()
        halves: dict[int, float] = {}
        for k in endless:
            shape = self.shapes[k]
            pose = (
                shape.pose if shape.body < 0 else compose(self.reader.initial_poses[shape.body], shape.pose)
            )
            box = np.array(np.meshgrid(*zip(low, high))).reshape(3, 8).T
            in_plane = (box - pose[:3]) @ rotation(pose[3:])
            half = PLANE_MARGIN * float(np.abs(in_plane[:, :2]).max())
            halves[k] = half if half > 0 else 1.0  # m; nothing moves and nothing has an extent
        return halves

    def _bounds_of_motion(self) -> tuple[Array, Array]:
        """Least and greatest coordinates of all bodies with their shapes in the whole recording [m]."""
        radii = np.zeros(len(self.bodies))
        for shape in self.shapes:
            if shape.body >= 0 and shape.kind != "plane":
                radii[shape.body] = max(
                    radii[shape.body], float(np.linalg.norm(shape.pose[:3])) + shape.radius
                )
        if not len(radii):
            return np.zeros(3), np.zeros(3)
        places = self.reader.initial_poses[:, :3]
        low, high = places - radii[:, np.newaxis], places + radii[:, np.newaxis]
        again = RecordingReader(self.path, STRETCH_BYTES)
        while (columns := again.next()) is not None:
            places = columns["steps/poses"].reshape(-1, len(radii), 7)[:, :, :3]
            low = np.minimum(low, places.min(axis=0) - radii[:, np.newaxis])
            high = np.maximum(high, places.max(axis=0) + radii[:, np.newaxis])
        return low.min(axis=0), high.max(axis=0)

    def _default_force_scale(self) -> float:
        """m/N: the weight of all bodies is an arrow as long as the model is wide at the start."""
        places = self.reader.initial_poses[:, :3]
        width = 0.0
        if len(places):
            radii = np.zeros(len(places))
            for shape in self.shapes:
                if shape.body >= 0 and shape.kind != "plane":
                    radii[shape.body] = max(radii[shape.body], shape.radius)
            low, high = places - radii[:, np.newaxis], places + radii[:, np.newaxis]
            width = float(np.linalg.norm(high.max(axis=0) - low.min(axis=0)))
        weight = self.reader.weight
        return (width if width > 0 else 1.0) / (weight if weight > 0 else 1.0)


def text(name: str) -> str:
    """The name with a mark in place of bytes that are no UTF-8, which the formats do not hold."""
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "replace")


def rotation(quaternion: Array) -> Array:
    """(3, 3) of a quaternion w x y z."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def product(a: Array, b: Array) -> Array:
    """Of two quaternions w x y z."""
    v = a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.concatenate([[a[0] * b[0] - a[1:] @ b[1:]], v])


def compose(a: Array, b: Array) -> Array:
    """Pose of b's frame where b is given in the frame of a; each x y z qw qx qy qz."""
    return np.concatenate([a[:3] + rotation(a[3:]) @ b[:3], product(a[3:], b[3:])])


def nanoseconds(seconds: float) -> int:
    return round(seconds * 1e9)
