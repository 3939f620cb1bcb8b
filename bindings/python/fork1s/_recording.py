"""Recordings as arrays over all steps."""

from __future__ import annotations

import operator
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._contacts import RECORDED_CONTACT
from ._core import RecordingReader
from ._errors import UnknownNameError, UsageError

Array = NDArray[np.float64]
Rows = NDArray[np.void]

STRETCH_BYTES = 8 << 20  # read at a time: what a stride leaves out takes no more memory than this

_FLAGS = {"controls_moved", "converged", "contacts_dropped", "finite"}
_COUNTS = {
    *("reduced_sizes", "detail", "modes", "recovery", "contacts", "limits", "newton_iterations"),
    *("contact_stage", "refreshes", "failed_refreshes"),
}
# Several values a step, of any number of mechanisms or coordinates: the shape after (steps, ...).
_WIDE = {"base_rates": (), "reduced_sizes": (), "base_poses": (7,), "base_twists": (6,)}

_REDUCED = np.dtype([("step", np.int64), ("mechanism", np.int32), ("z", np.float64), ("w", np.float64)])
_WRENCH = np.dtype(
    [
        ("step", np.int64),
        ("body", np.int32),
        *((name, np.float64, (3,)) for name in ("force", "torque", "point")),
    ]
)
_POINT_SPRING = np.dtype(
    [
        ("step", np.int64),
        ("body", np.int32),
        *((name, np.float64, (3,)) for name in ("point", "target_start", "target")),
        ("stiffness", np.float64),
        ("damping", np.float64),
    ]
)


class RecordedValues(Mapping[str, Array]):
    """Values over all steps by name, read-only mapping: `recording.controls["grip"]`.

    `array` has those of all names beside each other, in the order of `keys`. Raises UnknownNameError (a KeyError).
    """

    def __init__(self, what: str, array: Array, places: Mapping[str, Any]) -> None:
        self.array = array
        self._what = what
        self._places = dict(places)

    def __getitem__(self, name: str) -> Array:
        if name not in self._places:
            raise _no_such(self._what, name, list(self._places))
        values: Array = self.array[:, self._places[name]]
        return values

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)

    def __repr__(self) -> str:
        return f"<fork1s.RecordedValues {' '.join(self._places)}>"


@dataclass(frozen=True, repr=False, eq=False)
class Recording:
    """Steps of a recording as arrays: what `fork1s.read_recording` gives. World axes throughout."""

    path: str
    program: str
    """That wrote it, with its version."""
    finished: bool
    """False: the run goes on, or its program was killed; the steps are those that reached the disk."""
    dt: float
    """Time step [s]."""
    bodies: list[str]
    """Names, each of one body: `MECHANISM/BODY` where two share one or where it is `world`. In the order of
    `Simulation.bodies`."""
    steps: NDArray[np.int64]
    """(n,) which steps of the recording these are, from 0; all without `start`, `stop` and `stride`."""
    time: Array
    """(n,) at the end of the step [s]."""
    poses: Array
    """(n, bodies, 7): position of the body's origin [m], unit quaternion w x y z with w >= 0."""
    initial_poses: Array
    """(bodies, 7) before the first step of the recording."""
    joint_displacements: RecordedValues
    """Joint coordinate -> (n,) [rad or m] from the file's reference pose, in the order of `Simulation.coordinates`."""
    controls: RecordedValues
    """Control -> (n,), the inputs of the step."""
    sensors: RecordedValues
    """Sensor -> (n, k) in the units of MJCF; NaN: no value."""
    kinetic_energy: Array
    """(n,) J"""
    potential_energy: Array
    """(n,) J, of springs, servos and gravity."""
    contacts: Rows
    """Contacts of all steps, one after another: `fork1s.RECORDED_CONTACT` has the fields. `step` is the place in `time`."""
    wrenches: Rows
    """Pushes from outside: `step`, `body`, `force` [N], `torque` [N·m] about `point` [m]."""
    point_springs: Rows
    """Springs between a point of a body and a target: `step`, `body`, `point` in the body [m], `target_start` and
    `target` at the start and the end of the step [m], `stiffness` [N/m], `damping` [N·s/m]."""
    reduced: Rows
    """Reduced coordinates: `step`, `mechanism`, `z` [1] and its rate `w` [1/s]."""
    columns: dict[str, NDArray[Any]] = field(default_factory=dict)
    """Name -> (n, ...), all other datasets of `/steps` in docs/formats.md: `max_penetration`, `converged`, ..."""

    def poses_of(self, body: str) -> Array:
        """(n, 7) poses of one body. Raises UnknownNameError."""
        if body not in self.bodies:
            raise _no_such("body", body, self.bodies)
        poses: Array = self.poses[:, self.bodies.index(body)]
        return poses

    def between(self, a: str, b: str) -> Rows:
        """The rows of `contacts` of two bodies, in either order; `"world"` is the still world. Raises UnknownNameError."""
        places = []
        for name in (a, b):
            if name not in self.bodies and name != "world":
                raise _no_such("body", name, [*self.bodies, "world"])
            places.append(-1 if name == "world" else self.bodies.index(name))
        pairs = self.contacts["bodies"]
        rows: Rows = self.contacts[np.all(pairs == places, axis=1) | np.all(pairs == places[::-1], axis=1)]
        return rows

    def __len__(self) -> int:
        return len(self.steps)

    def __repr__(self) -> str:
        end = f" to {self.time[-1]:g} s" if len(self) else ""
        return f"<fork1s.Recording '{self.path}', {len(self)} steps{end}{'' if self.finished else ', NOT FINISHED'}>"


def read_recording(
    path: str | os.PathLike[str], *, start: int = 0, stop: int | None = None, stride: int = 1
) -> Recording:
    """A recording, of `Simulation.record` or of `fork1s run --record`, as arrays over its steps.

        run = fork1s.read_recording("run.h5")
        plt.plot(run.time, run.joint_displacements["elbow"])

    A recording that goes on or was cut off is read up to the last step that reached the disk. The file is read a stretch of
    steps at a time: with a `stride` one that is larger than the memory can be read.

    Args:
        start, stop, stride: which steps, as in `range`, from 0. Default: all.

    Raises:
        FileError: it cannot be read. FormatError: it is damaged, or of another version. UsageError: a negative start or
        stop, a stride below 1.
    """
    first = _whole("start", start, 0)
    last = None if stop is None else _whole("stop", stop, 0)
    every = _whole("stride", stride, 1)
    name = os.fsdecode(path)
    reader = RecordingReader(name, STRETCH_BYTES)
    parts: list[dict[str, NDArray[Any]]] = []
    before = picked = 0  # steps read, and those of them that are wanted
    while (columns := reader.next()) is not None:
        numbers = np.arange(before, before + len(columns["steps/time"]))
        before += len(numbers)
        wanted = (numbers >= first) & ((numbers - first) % every == 0)
        if last is not None:
            wanted &= numbers < last
        parts.append(_pick(columns, wanted, numbers, picked))
        picked += len(parts[-1]["step"])
        if last is not None and before >= last:
            break
    if not parts:
        parts.append(_pick(reader.no_steps(), np.zeros(0, bool), np.zeros(0, np.int64), 0))
    whole = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    return _recording(name, reader, whole)


def _pick(
    columns: Mapping[str, Array], wanted: NDArray[np.bool_], numbers: NDArray[np.int64], picked: int
) -> dict[str, NDArray[Any]]:
    """Of a stretch the wanted steps, and the rows of tables that belong to them with their steps from `picked` on."""
    out: dict[str, NDArray[Any]] = {"step": numbers[wanted]}
    ends = {
        "reduced": "reduced",
        "contacts": "contact",
        "wrenches": "wrench",
        "point_springs": "point_spring",
    }
    rows: dict[str, NDArray[np.bool_]] = {}
    for table, prefix in ends.items():
        counts: NDArray[np.int64] = np.diff(columns[f"steps/{prefix}_end"], prepend=0).astype(np.int64)
        rows[table] = np.repeat(wanted, counts)
        out[f"{table}/step"] = picked + np.repeat(np.arange(wanted.sum()), counts[wanted])
    for dataset, values in columns.items():
        table = dataset.split("/")[0]
        if not dataset.endswith("_end"):
            out[dataset] = values[wanted if table == "steps" else rows[table]]
    return out


def _recording(path: str, reader: RecordingReader, data: dict[str, NDArray[Any]]) -> Recording:
    n = len(data["step"])

    def steps(name: str) -> NDArray[Any]:
        """The file has no dataset of width 0."""
        return data.pop(f"steps/{name}", np.zeros((n, 0)))

    def by_name(what: str, names: Sequence[str], values: Array) -> RecordedValues:
        return RecordedValues(what, values.reshape(n, len(names)), {name: k for k, name in enumerate(names)})

    def table(name: str, dtype: np.dtype[Any], fields: Mapping[str, NDArray[Any]]) -> Rows:
        out: Rows = np.empty(len(data[f"{name}/step"]), dtype)
        out["step"] = data[f"{name}/step"]
        for key, values in fields.items():
            out[key] = values
        return out

    poses = steps("poses").reshape(n, len(reader.bodies), 7)
    poses[poses[:, :, 3] < 0, 3:] *= -1
    initial_poses = reader.initial_poses
    initial_poses[initial_poses[:, 3] < 0, 3:] *= -1
    sensors: dict[str, list[int]] = {}
    for k, owner in enumerate(reader.sensor_of_values):
        sensors.setdefault(owner, []).append(k)
    # Of each sensor the values lie one after another.
    places = {name: slice(ks[0], ks[-1] + 1) for name, ks in sensors.items()}
    wrench, spring = data["wrenches/wrench"], data["point_springs/spring"]
    read: dict[str, Any] = {
        "time": steps("time"),
        "controls": by_name("control", reader.controls, steps("controls")),
        "joint_displacements": by_name("joint coordinate", reader.coordinates, steps("coordinates")),
        "sensors": RecordedValues(
            "sensor", steps("sensors").reshape(n, len(reader.sensor_of_values)), places
        ),
        "kinetic_energy": steps("kinetic_energy"),
        "potential_energy": steps("potential_energy"),
    }
    columns: dict[str, NDArray[Any]] = {}
    for dataset in [*(f"steps/{name}" for name in _WIDE), *(key for key in data if key.startswith("steps/"))]:
        name = dataset.split("/")[1]
        if name in columns:
            continue
        values = steps(name)
        if name in _WIDE:
            inner = _WIDE[name]
            width = values.shape[1] if values.ndim > 1 else 1
            values = values.reshape(n, width // int(np.prod(inner)), *inner)
        columns[name] = values.astype(bool if name in _FLAGS else np.int64 if name in _COUNTS else np.float64)
    sizes = columns["reduced_sizes"]
    mechanisms = np.repeat(np.tile(np.arange(sizes.shape[1]), n), sizes.ravel())
    return Recording(
        path=path,
        program=reader.program,
        finished=reader.finished,
        dt=reader.dt,
        bodies=reader.bodies,
        steps=data["step"],
        poses=poses,
        initial_poses=initial_poses,
        contacts=table(
            "contacts",
            RECORDED_CONTACT,
            {
                "bodies": np.stack([data["contacts/body_a"], data["contacts/body_b"]], axis=1),
                **{
                    key: data[f"contacts/{key}"]
                    for key in ("point", "normal", "force", "gap", "friction", "friction_use")
                },
            },
        ),
        wrenches=table(
            "wrenches",
            _WRENCH,
            {
                "body": data["wrenches/body"],
                "force": wrench[:, :3],
                "torque": wrench[:, 3:6],
                "point": wrench[:, 6:],
            },
        ),
        point_springs=table(
            "point_springs",
            _POINT_SPRING,
            {
                "body": data["point_springs/body"],
                "point": spring[:, :3],
                "target_start": spring[:, 3:6],
                "target": spring[:, 6:9],
                "stiffness": spring[:, 9],
                "damping": spring[:, 10],
            },
        ),
        reduced=table(
            "reduced", _REDUCED, {"mechanism": mechanisms, "z": data["reduced/z"], "w": data["reduced/w"]}
        ),
        columns=columns,
        **read,
    )


def _whole(argument: str, given: int, least: int) -> int:
    try:
        number = operator.index(given)
    except TypeError:
        raise TypeError(f"{argument} must be a whole number, not {given!r}") from None
    if number < least:
        raise UsageError(f"{argument}: {number} is below {least}")
    return number


def _no_such(what: str, name: str, known: Sequence[str]) -> UnknownNameError:
    others = f"; there are: {', '.join(known)}" if known else ", nor any other"
    return UnknownNameError(f"there is no {what} '{name}'{others}")
