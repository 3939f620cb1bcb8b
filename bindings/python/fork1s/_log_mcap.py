"""Recordings as MCAP: Foxglove's messages as Protocol Buffers, our own as JSON with a schema."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.ArrowPrimitive_pb2 import ArrowPrimitive
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.CubePrimitive_pb2 import CubePrimitive
from foxglove_schemas_protobuf.CylinderPrimitive_pb2 import CylinderPrimitive
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointState_pb2 import JointState
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.SpherePrimitive_pb2 import SpherePrimitive
from foxglove_schemas_protobuf.TriangleListPrimitive_pb2 import TriangleListPrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.writer import Writer

from ._core import RecordedShape
from ._log_source import Array, Contact, Push, Source, Stretch, compose, nanoseconds

ARROW_COLOR = Color(r=0.9, g=0.2, b=0.1, a=1)
# Shares of the length of an arrow.
ARROW_SHAFT_DIAMETER, ARROW_HEAD_DIAMETER, ARROW_HEAD_LENGTH = 0.04, 0.1, 0.2

_NUMBER = {"type": ["number", "null"]}
_NAME = {"type": "string"}
_XYZ = {"type": "object", "properties": {axis: _NUMBER for axis in "xyz"}}
_TIME = {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}


def _list_of(**properties: Any) -> dict[str, Any]:
    return {"type": "array", "items": {"type": "object", "properties": properties}}


def _schema(description: str, **properties: Any) -> dict[str, Any]:
    return {"type": "object", "description": description, "properties": {"timestamp": _TIME, **properties}}


# Numbers that are not finite are null.
SCHEMAS = {
    "fork1s.Contacts": _schema(
        "Contacts that bore force in a step. m, N, world axes; force on body_b with friction, mean over the step; "
        "normal from body_a to body_b; gap negative in penetration.",
        contacts=_list_of(
            body_a=_NAME, body_b=_NAME, point=_XYZ, normal=_XYZ, force=_XYZ, gap=_NUMBER, friction=_NUMBER
        ),
    ),
    "fork1s.Pushes": _schema(
        "Pushes from outside during a step: force [N] and moment [N m] about point [m], world axes.",
        pushes=_list_of(body=_NAME, force=_XYZ, moment=_XYZ, point=_XYZ),
    ),
    "fork1s.Values": _schema(
        "Values by name, in the units of the model's file; null where there is none.",
        values=_list_of(name=_NAME, value=_NUMBER),
    ),
    "fork1s.StepReport": _schema(
        "What a step was like: energies in J, lengths in m.",
        contacts={"type": "integer"},
        limits={"type": "integer"},
        converged={"type": "boolean"},
        finite={"type": "boolean"},
        contacts_dropped={"type": "boolean"},
        newton_iterations={"type": "integer"},
        residual=_NUMBER,
        max_penetration=_NUMBER,
        closure_gap=_NUMBER,
        refreshes={"type": "integer"},
        failed_refreshes={"type": "integer"},
        kinetic_energy=_NUMBER,
        potential_energy=_NUMBER,
    ),
}
_REPORT = {
    name: schema["type"]
    for name, schema in SCHEMAS["fork1s.StepReport"]["properties"].items()
    if "type" in schema
}
del _REPORT["timestamp"]


def _descriptors(message: Any) -> bytes:
    """The file of a message and all that it needs, as readers of MCAP want them."""
    files, names = FileDescriptorSet(), set[str]()

    def add(file: Any) -> None:
        if file.name in names:
            return
        names.add(file.name)
        for needed in file.dependencies:
            add(needed)
        file.CopyToProto(files.file.add())

    add(message.DESCRIPTOR.file)
    return bytes(files.SerializeToString())


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _xyz(v: Array) -> dict[str, float | None]:
    return {axis: _number(v[k]) for k, axis in enumerate("xyz")}


def _vector(v: Array) -> Vector3:
    return Vector3(x=float(v[0]), y=float(v[1]), z=float(v[2]))


def _quaternion(wxyz: Array) -> Quaternion:
    w, x, y, z = (float(number) for number in wxyz)
    return Quaternion(x=x, y=y, z=z, w=w)


def _pose(pose: Array) -> Pose:
    return Pose(position=_vector(pose[:3]), orientation=_quaternion(pose[3:]))


def _contact(contact: Contact) -> dict[str, Any]:
    return {
        "body_a": contact.body_a,
        "body_b": contact.body_b,
        "point": _xyz(contact.point),
        "normal": _xyz(contact.normal),
        "force": _xyz(contact.force),
        "gap": _number(contact.gap),
        "friction": _number(contact.friction),
    }


def _push(push: Push) -> dict[str, Any]:
    return {
        "body": push.body,
        "force": _xyz(push.force),
        "moment": _xyz(push.moment),
        "point": _xyz(push.point),
    }


def _values(names: list[str], values: Array) -> list[dict[str, Any]]:
    return [{"name": name, "value": _number(value)} for name, value in zip(names, values)]


class McapLog:
    """Writes the messages of a recording."""

    def __init__(self, source: Source, stream: Any) -> None:
        self._source = source
        self._writer: Any = Writer(stream)
        self._writer.start(profile="", library=source.reader.program)
        self._channels: dict[str, int] = {}
        self._counts: dict[str, int] = {}

    def write(self) -> int:
        """Returns the number of steps."""
        source = self._source
        steps = 0
        for stretch in source.stretches():
            if steps == 0:
                self._write_start(source.start_time(float(stretch.times[0])))
            for i in range(len(stretch)):
                self._write_step(stretch, i)
            steps += len(stretch)
        if steps == 0:
            self._write_start(0.0)
        self._writer.finish()
        return steps

    def _write_start(self, time: float) -> None:
        self._write_poses(self._source.reader.initial_poses, time)
        stamp = self._stamp(time)
        entities = [
            self._entity(self._source.name_of(body), shapes, stamp)
            for body, shapes in _by_body(self._source.shapes).items()
        ]
        self._add("/scene", SceneUpdate(entities=entities), time)

    def _write_step(self, stretch: Stretch, i: int) -> None:
        source, time = self._source, float(stretch.times[i])
        self._write_poses(stretch.poses[i], time)
        if source.coordinates:
            self._write_joints(stretch, i, time)
        contacts = stretch.contacts(i)
        self._add_json("/contacts", "fork1s.Contacts", time, contacts=[_contact(c) for c in contacts])
        self._write_arrows(contacts, time)
        if pushes := stretch.pushes(i):
            self._add_json("/pushes", "fork1s.Pushes", time, pushes=[_push(p) for p in pushes])
        if source.controls:
            controls = stretch.rows("steps/controls", len(source.controls))[i]
            self._add_json("/controls", "fork1s.Values", time, values=_values(source.controls, controls))
        if source.sensors:
            sensors = stretch.rows("steps/sensors", len(source.sensors))[i]
            self._add_json("/sensors", "fork1s.Values", time, values=_values(source.sensors, sensors))
        report: dict[str, Any] = {}
        for name, kind in _REPORT.items():
            value = stretch.column(f"steps/{name}")[i]
            report[name] = (
                bool(value) if kind == "boolean" else int(value) if kind == "integer" else _number(value)
            )
        self._add_json("/steps", "fork1s.StepReport", time, **report)

    def _write_poses(self, poses: Array, time: float) -> None:
        stamp = self._stamp(time)
        transforms = [
            FrameTransform(
                timestamp=stamp,
                parent_frame_id="world",
                child_frame_id=name,
                translation=_vector(pose[:3]),
                rotation=_quaternion(pose[3:]),
            )
            for name, pose in zip(self._source.bodies, poses)
        ]
        self._add("/tf", FrameTransforms(transforms=transforms), time)

    def _write_joints(self, stretch: Stretch, i: int, time: float) -> None:
        joints: list[JointState] = []
        for name, position, rate in zip(self._source.coordinates, stretch.coordinates[i], stretch.rates[i]):
            joint = JointState(name=name, position=float(position))
            if math.isfinite(rate):
                joint.velocity = float(rate)
            joints.append(joint)
        self._add("/joints", JointStates(timestamp=self._stamp(time), joints=joints), time)

    def _write_arrows(self, contacts: list[Contact], time: float) -> None:
        arrows: list[ArrowPrimitive] = []
        for contact in contacts:
            size = float(np.linalg.norm(contact.force))
            length = size * self._source.force_scale
            if not (math.isfinite(length) and length > 0):
                continue
            pose = np.concatenate([contact.point, _turn_from_x(contact.force / size)])
            arrows.append(
                ArrowPrimitive(
                    pose=_pose(pose),
                    shaft_length=(1 - ARROW_HEAD_LENGTH) * length,
                    shaft_diameter=ARROW_SHAFT_DIAMETER * length,
                    head_length=ARROW_HEAD_LENGTH * length,
                    head_diameter=ARROW_HEAD_DIAMETER * length,
                    color=ARROW_COLOR,
                )
            )
        entity = SceneEntity(
            timestamp=self._stamp(time), frame_id="world", id="contact forces", arrows=arrows
        )
        self._add("/contact_forces", SceneUpdate(entities=[entity]), time)

    def _entity(self, frame: str, shapes: list[RecordedShape], stamp: Timestamp) -> SceneEntity:
        # An identifier of the still world that no body has.
        entity = SceneEntity(timestamp=stamp, frame_id=frame, id=f"shapes of {frame}", frame_locked=True)
        for shape in shapes:
            self._add_shape(entity, shape)
        return entity

    def _add_shape(self, entity: SceneEntity, shape: RecordedShape) -> None:
        color = Color(**dict(zip("rgba", (float(c) for c in shape.color))))
        pose, size = shape.pose, shape.size
        if shape.kind == "box":
            entity.cubes.append(CubePrimitive(pose=_pose(pose), size=_vector(2 * size), color=color))
        elif shape.kind in ("sphere", "ellipsoid"):
            diameters = 2 * np.broadcast_to(size, 3)
            entity.spheres.append(SpherePrimitive(pose=_pose(pose), size=_vector(diameters), color=color))
        elif shape.kind in ("cylinder", "capsule"):
            radius, half = size
            box = _vector(np.array([2 * radius, 2 * radius, 2 * half]))
            entity.cylinders.append(
                CylinderPrimitive(pose=_pose(pose), size=box, bottom_scale=1, top_scale=1, color=color)
            )
            if shape.kind == "capsule":  # Foxglove has none: a cylinder between two spheres
                ball = _vector(np.full(3, 2 * radius))
                for end in (-half, half):
                    cap = compose(pose, np.array([0, 0, end, 1.0, 0, 0, 0]))
                    entity.spheres.append(SpherePrimitive(pose=_pose(cap), size=ball, color=color))
        else:
            surface = self._source.triangles(shape)
            if not len(surface.corners):
                self._source.left_out.append(f"{self._source.describe(shape)}: it has no triangles")
                return
            points = [Point3(x=x, y=y, z=z) for x, y, z in surface.vertices.tolist()]
            entity.triangles.append(
                TriangleListPrimitive(
                    pose=_pose(pose), points=points, color=color, indices=surface.corners.ravel().tolist()
                )
            )

    @staticmethod
    def _stamp(time: float) -> Timestamp:
        seconds, nanos = divmod(nanoseconds(time), 10**9)
        return Timestamp(seconds=seconds, nanos=nanos)

    def _add(self, topic: str, message: Any, time: float) -> None:
        if topic not in self._channels:
            schema = self._writer.register_schema(
                name=message.DESCRIPTOR.full_name, encoding="protobuf", data=_descriptors(message)
            )
            self._channels[topic] = self._writer.register_channel(
                topic=topic, message_encoding="protobuf", schema_id=schema
            )
        self._put(topic, bytes(message.SerializeToString()), time)

    def _add_json(self, topic: str, schema_name: str, time: float, **content: Any) -> None:
        if topic not in self._channels:
            schema = self._writer.register_schema(
                name=schema_name,
                encoding="jsonschema",
                data=json.dumps({"title": schema_name, **SCHEMAS[schema_name]}).encode(),
            )
            self._channels[topic] = self._writer.register_channel(
                topic=topic, message_encoding="json", schema_id=schema
            )
        sec, nsec = divmod(nanoseconds(time), 10**9)
        message = {"timestamp": {"sec": sec, "nsec": nsec}, **content}
        self._put(topic, json.dumps(message, allow_nan=False).encode(), time)

    def _put(self, topic: str, data: bytes, time: float) -> None:
        stamp, sequence = nanoseconds(time), self._counts.get(topic, 0)
        self._counts[topic] = sequence + 1
        self._writer.add_message(
            channel_id=self._channels[topic],
            log_time=stamp,
            publish_time=stamp,
            sequence=sequence,
            data=data,
        )


def _by_body(shapes: list[RecordedShape]) -> dict[int, list[RecordedShape]]:
    groups: dict[int, list[RecordedShape]] = {}
    for shape in shapes:
        groups.setdefault(shape.body, []).append(shape)
    return groups


def _turn_from_x(direction: Array) -> Array:
    """Quaternion w x y z that turns the x axis to a unit vector."""
    x, y, z = direction
    if x < -1 + 1e-12:  # half a turn, about any axis across; below it 1 + x loses all of its digits
        return np.array([0.0, 0, 0, 1])
    q: Array = np.array([1 + x, 0, -z, y]) / math.sqrt(2 * (1 + x))
    return q
