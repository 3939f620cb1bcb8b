"""Recordings as files of Rerun (.rrd)."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import rerun as rr
from rerun.chunk import RrdReader

from ._core import RecordedShape
from ._log_source import Array, Source, Stretch, text

QUIET = 10.0  # s without a byte in the file, after which nothing is waited for
ARROW_COLOR = (230, 50, 25)
PUSH_COLOR = (40, 110, 230)
REPORT = (
    "contacts",
    "limits",
    "converged",
    "finite",
    "contacts_dropped",
    "newton_iterations",
    "residual",
    "max_penetration",
    "closure_gap",
    "refreshes",
    "failed_refreshes",
    "kinetic_energy",
    "potential_energy",
)


def _path(*parts: str) -> str:
    return "/".join(rr.escape_entity_path_part(part) for part in parts)


def _xyzw(poses: Array) -> Array:
    return poses[..., [4, 5, 6, 3]]


def _timeline(times: Array) -> Any:
    return rr.TimeColumn("time", duration=np.rint(times * 1e9).astype("timedelta64[ns]"))


class RerunLog:
    """Writes the entities of a recording. Rerun has floats of 24 bits for all that is drawn, doubles for scalars."""

    def __init__(self, source: Source, path: str) -> None:
        self._source = source
        self._stream = rr.RecordingStream("fork1s")
        self._stream.save(path)
        self._path = path
        self._stream.send_recording_name(text(source.reader.scene))
        self._colored: set[str] = set()

    def write(self) -> int:
        """Returns the number of steps."""
        was_strict = rr.strict_mode()
        rr.set_strict_mode(True)  # else Rerun reports errors of arguments as warnings and goes on
        try:
            return self._write()
        finally:
            rr.set_strict_mode(was_strict)

    def _write(self) -> int:
        source, steps = self._source, 0
        self._write_shapes()
        for stretch in source.stretches():
            if steps == 0:
                self._write_start(source.start_time(float(stretch.times[0])))
            self._write_stretch(stretch)
            steps += len(stretch)
        if steps == 0:
            self._write_start(0.0)
        self._flush()
        self._stream.disconnect()  # writes the footer and reports no error: without one the file has no store
        try:
            RrdReader(self._path).store()
        except RuntimeError as error:
            raise OSError(f"Rerun: {error}") from None
        return steps

    def _flush(self) -> None:
        """Waits while the file grows. Where the thread that writes has ended, the cause is in Rerun's log alone, and one that
        ends during the call leaves it waiting."""
        written = -1
        while True:
            try:
                self._stream.flush(timeout_sec=QUIET)
                return
            except RuntimeError as error:
                size = os.path.getsize(self._path)
                if size == written:
                    raise OSError(f"Rerun: {error}") from None
                written = size

    def _write_start(self, time: float) -> None:
        self._write_poses(np.array([time]), self._source.reader.initial_poses[np.newaxis])

    def _write_stretch(self, stretch: Stretch) -> None:
        source = self._source
        self._write_poses(stretch.times, stretch.poses)
        contacts = [[(c.point, c.force) for c in stretch.contacts(i)] for i in range(len(stretch))]
        self._write_arrows("contact_forces", stretch.times, contacts, ARROW_COLOR)
        if len(stretch.column("wrenches/body")):
            pushes = [[(p.point, p.force) for p in stretch.pushes(i)] for i in range(len(stretch))]
            self._write_arrows("push_forces", stretch.times, pushes, PUSH_COLOR)
        for k, name in enumerate(source.coordinates):
            self._write_scalars(_path("joints", name, "position"), stretch.times, stretch.coordinates[:, k])
            self._write_scalars(_path("joints", name, "velocity"), stretch.times, stretch.rates[:, k])
        for group, names in (("controls", source.controls), ("sensors", source.sensors)):
            rows = stretch.rows(f"steps/{group}", len(names))
            for k, name in enumerate(names):
                self._write_scalars(_path(group, name), stretch.times, rows[:, k])
        for name in REPORT:
            self._write_scalars(_path("steps", name), stretch.times, stretch.column(f"steps/{name}"))

    def _write_poses(self, times: Array, poses: Array) -> None:
        for k, name in enumerate(self._source.bodies):
            columns = rr.Transform3D.columns(translation=poses[:, k, :3], quaternion=_xyzw(poses[:, k]))
            self._stream.send_columns(_path("bodies", name), indexes=[_timeline(times)], columns=columns)

    def _write_arrows(
        self,
        path: str,
        times: Array,
        forces: list[list[tuple[Array, Array]]],
        color: tuple[int, int, int],
    ) -> None:
        """(point, force) of each step as arrows; a step without any takes those of the step before away."""
        rows = [row for step in forces for row in step]
        points = np.array([point for point, _ in rows]).reshape(-1, 3)
        vectors = np.array([force for _, force in rows]).reshape(-1, 3) * self._source.force_scale
        columns = rr.Arrows3D.columns(origins=points, vectors=vectors).partition(
            [len(step) for step in forces]
        )
        self._stream.send_columns(path, indexes=[_timeline(times)], columns=columns)
        if path not in self._colored:
            self._stream.log(path, rr.Arrows3D.from_fields(colors=[color]), static=True)
            self._colored.add(path)

    def _write_scalars(self, path: str, times: Array, values: Array) -> None:
        columns = rr.Scalars.columns(scalars=np.ascontiguousarray(values))
        self._stream.send_columns(path, indexes=[_timeline(times)], columns=columns)

    def _write_shapes(self) -> None:
        for k, shape in enumerate(self._source.shapes):
            archetype = self._archetype(shape)
            if archetype is None:
                self._source.left_out.append(f"{self._source.describe(shape)}: it has no triangles")
                continue
            name = f"{k} {text(shape.name) or shape.kind}"
            path = (
                _path("world", name)
                if shape.body < 0
                else _path("bodies", self._source.bodies[shape.body], name)
            )
            pose = shape.pose
            placed = rr.Transform3D(translation=pose[:3], quaternion=rr.Quaternion(xyzw=_xyzw(pose)))
            self._stream.log(path, placed, archetype, static=True)

    def _archetype(self, shape: RecordedShape) -> Any:
        size, color = shape.size, np.clip(shape.color, 0, 1)
        look: dict[str, Any] = {"colors": [color], "fill_mode": "solid"}
        if shape.kind == "box":
            return rr.Boxes3D(half_sizes=[size], **look)
        if shape.kind in ("sphere", "ellipsoid"):
            return rr.Ellipsoids3D(half_sizes=[np.broadcast_to(size, 3)], **look)
        if shape.kind == "cylinder":
            return rr.Cylinders3D(radii=[size[0]], lengths=[2 * size[1]], **look)
        if shape.kind == "capsule":  # from the middle of one cap to that of the other, along +z
            return rr.Capsules3D(
                radii=[size[0]], lengths=[2 * size[1]], translations=[[0, 0, -size[1]]], **look
            )
        surface = self._source.triangles(shape)
        if not len(surface.corners):
            return None
        return rr.Mesh3D(
            vertex_positions=surface.vertices,
            vertex_normals=surface.normals,
            triangle_indices=surface.corners,
            albedo_factor=color,
        )
