"""Recordings as files of log viewers, opened again by the readers of those."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import fork1s
import fork1s.logs
from fork1s import _log_source

pytest.importorskip("mcap")
h5py = pytest.importorskip("h5py")

SCENES = Path(__file__).resolve().parents[3] / "scenes"

# A box of 2 kg and a ball on the ground, all kinds of shapes, a slide that a spring holds, a sensor.
SHAPES = """<mujoco><option timestep="0.01"/>
  <asset><mesh name="wedge" vertex="0 0 0  .2 0 0  0 .2 0  0 0 .2"/>
    <hfield name="hills" nrow="2" ncol="2" size=".5 .5 .1 .1" elevation="0 1 1 0"/></asset>
  <worldbody>
  <geom name="ground" type="plane" size="0 0 1"/>
  <geom name="hills" type="hfield" hfield="hills" pos="3 0 0"/>
  <body name="box" pos="0 0 .1"><freejoint/><geom name="cube" type="box" size=".1 .2 .1" mass="2" rgba=".1 .2 .3 .5"/></body>
  <body name="ball" pos="2 0 .1"><freejoint/><geom type="sphere" size=".1" mass="1"/></body>
  <body name="arm" pos="0 3 1"><joint name="elbow" axis="0 1 0" stiffness="20" damping=".1"/>
    <geom type="capsule" size=".03 .2" pos="0 0 -.2" mass="1"/>
    <geom type="cylinder" size=".05 .02" mass=".1"/>
    <body name="slider" pos="0 0 -.4"><joint name="slide" type="slide" axis="0 0 1" stiffness="500" damping="2"/>
      <geom type="ellipsoid" size=".05 .06 .07" mass=".2"/>
      <geom name="tip" type="mesh" mesh="wedge" mass=".1" pos=".1 0 0" euler="0 0 90"/></body></body>
  </worldbody>
  <actuator><position name="grip" joint="elbow" kp="5" ctrlrange="-1 1"/></actuator>
  <sensor><jointpos name="angle" joint="elbow"/><framepos name="place" objtype="body" objname="box"/>
    <user name="own" dim="1"/></sensor></mujoco>"""


def record(model, path, steps=40, dt=1 / 60, keyframe=None, change=None):
    sim = fork1s.Simulation(model, dt=dt, keyframe=keyframe)
    sim.record(path)
    sim.step(steps // 2)
    if change:
        change(sim)
    sim.step(steps - steps // 2)
    sim.stop_recording()
    return sim


def push(sim):
    sim.controls["grip"] = 0.4
    sim.push("ball", force=[0.5, 0, 0], point=[0, 0, 0.05])


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("logs") / "run.h5"
    record(fork1s.load(SHAPES), path, dt=0.01, change=push)
    return path


def read_mcap(path):
    """Topic -> [(log time in ns, schema name, message)]."""
    import foxglove_schemas_protobuf
    from google.protobuf import descriptor_pool, message_factory
    from google.protobuf.descriptor_pb2 import FileDescriptorSet
    from mcap.reader import make_reader

    assert foxglove_schemas_protobuf  # not used: the file brings its own descriptors
    messages, classes = {}, {}
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        for schema, channel, message in reader.iter_messages():
            if channel.message_encoding == "json":
                assert schema.encoding == "jsonschema" and json.loads(schema.data)["title"] == schema.name
                content = json.loads(message.data, parse_constant=pytest.fail)
            else:
                if schema.name not in classes:
                    pool = descriptor_pool.DescriptorPool()
                    for file in FileDescriptorSet.FromString(schema.data).file:
                        pool.Add(file)
                    classes[schema.name] = message_factory.GetMessageClass(
                        pool.FindMessageTypeByName(schema.name)
                    )
                content = classes[schema.name].FromString(message.data)
            assert message.publish_time == message.log_time
            messages.setdefault(channel.topic, []).append((message.log_time, schema.name, content))
    return messages


def check_poses(messages, recording):
    """Transforms are the recorded poses to the last bit, those before the first step included."""
    with h5py.File(recording) as file:
        poses = np.vstack([file["initial/poses"][()].reshape(1, -1, 7), file["steps/poses"][()]])
        times = file["steps/time"][()]
    times = np.concatenate([[2 * times[0] - times[1]], times])
    assert len(messages["/tf"]) == len(times)
    for pose, time, (stamp, name, content) in zip(poses, times, messages["/tf"]):
        assert name == "foxglove.FrameTransforms"
        assert (
            abs(stamp - time * 1e9) <= 1
        )  # ns, rounded once, and once more in the time before the first step
        assert len(content.transforms) == len(pose)
        assert len({t.child_frame_id for t in content.transforms} - {"world"}) == len(pose)
        for row, t in zip(pose, content.transforms):
            assert t.parent_frame_id == "world" and t.timestamp.ToNanoseconds() == stamp
            assert_array_equal(row[:3], [t.translation.x, t.translation.y, t.translation.z])
            assert_array_equal(row[3:], [t.rotation.w, t.rotation.x, t.rotation.y, t.rotation.z])


def test_mcap_has_the_recorded_poses_joints_and_times(recording, tmp_path):
    done = fork1s.logs.export_mcap(recording, tmp_path / "run.mcap")
    assert done.steps == 40
    messages = read_mcap(tmp_path / "run.mcap")
    check_poses(messages, recording)
    with h5py.File(recording) as file:
        names = [name.decode() for name in file["names/coordinates"][()]]
        q = file["steps/coordinates"][()]
    assert len(messages["/joints"]) == 40
    for k, (_, name, content) in enumerate(messages["/joints"]):
        assert name == "foxglove.JointStates"
        assert [j.name for j in content.joints] == names
        assert_array_equal([j.position for j in content.joints], q[k])
        assert [j.HasField("velocity") for j in content.joints] == [k > 0] * len(names)
        if k > 0:
            assert_allclose(
                [j.velocity for j in content.joints], (q[k] - q[k - 1]) / 0.01, rtol=1e-9, atol=1e-12
            )


def test_joints_of_a_fall_have_its_closed_form(tmp_path):
    """q = -g t²/2, whose mean rate over a step is -g (t - h/2); the integrator is exact for parabolas."""
    model = fork1s.load("""<mujoco><worldbody><body name="weight"><joint name="fall" type="slide" axis="0 0 1"/>
      <geom size=".1" mass="3"/></body></worldbody></mujoco>""")
    record(model, tmp_path / "run.h5", steps=20, dt=0.01)
    fork1s.logs.export_mcap(tmp_path / "run.h5", tmp_path / "run.mcap")
    joints = read_mcap(tmp_path / "run.mcap")["/joints"]
    t = np.array([time for time, _, _ in joints]) * 1e-9
    assert_allclose(t, 0.01 * np.arange(1, 21), atol=1e-9)
    assert_allclose([m.joints[0].position for _, _, m in joints], -9.81 * t**2 / 2, atol=1e-9)
    velocities = [m.joints[0].velocity for _, _, m in joints[1:]]
    # 1e-9 m that Newton leaves, over a step of 0.01 s
    assert_allclose(velocities, -9.81 * (t[1:] - 0.005), atol=1e-7)


def test_mcap_draws_every_shape_at_its_place(recording, tmp_path):
    fork1s.logs.export_mcap(recording, tmp_path / "run.mcap")
    ((_, name, content),) = read_mcap(tmp_path / "run.mcap")["/scene"]
    assert name == "foxglove.SceneUpdate"
    entities = {e.frame_id: e for e in content.entities}
    assert set(entities) == {"world", "box", "ball", "arm", "slider"}
    assert all(e.frame_locked for e in content.entities)
    (cube,) = entities["box"].cubes
    assert_allclose([cube.size.x, cube.size.y, cube.size.z], [0.2, 0.4, 0.2], rtol=1e-15)
    assert_allclose([cube.color.r, cube.color.g, cube.color.b, cube.color.a], [0.1, 0.2, 0.3, 0.5], rtol=1e-7)
    (ball,) = entities["ball"].spheres
    assert_allclose([ball.size.x, ball.size.y, ball.size.z], 0.2, rtol=1e-15)
    capsule, disk = entities["arm"].cylinders
    assert_allclose([capsule.size.x, capsule.size.z], [0.06, 0.4], rtol=1e-15)
    assert capsule.bottom_scale == capsule.top_scale == 1
    assert_allclose([disk.size.x, disk.size.z], [0.1, 0.04], rtol=1e-15)
    caps = sorted(s.pose.position.z for s in entities["arm"].spheres)
    assert_allclose(caps, [-0.4, 0], atol=1e-15)
    (ellipsoid,) = entities["slider"].spheres
    assert_allclose([ellipsoid.size.x, ellipsoid.size.y, ellipsoid.size.z], [0.1, 0.12, 0.14], rtol=1e-15)
    # The mesh by another method: the corners of the file, moved as it says; 90 degrees about z.
    (wedge,) = entities["slider"].triangles
    place, turn = wedge.pose.position, wedge.pose.orientation
    corners = np.array([[p.x, p.y, p.z] for p in wedge.points])
    w, v = turn.w, np.array([turn.x, turn.y, turn.z])
    corners = corners + 2 * np.cross(v, np.cross(v, corners) + w * corners) + [place.x, place.y, place.z]
    expected = [[0.1, 0, 0], [0.1, 0.2, 0], [-0.1, 0, 0], [0.1, 0, 0.2]]
    for corner in expected:  # floats of 24 bits in meshes
        assert np.linalg.norm(corners - corner, axis=1).min() < 1e-7
    assert np.linalg.norm(corners[:, np.newaxis] - expected, axis=2).min(axis=1).max() < 1e-7
    assert len(wedge.indices) == 12
    # The ground holds what moves over it.
    ground, hills = entities["world"].triangles
    assert min(abs(p.x) for p in ground.points) > 2.1 and len(hills.indices) == 6


def test_contacts_bear_the_weight(recording, tmp_path):
    fork1s.logs.export_mcap(recording, tmp_path / "run.mcap", force_scale=0.01)
    messages = read_mcap(tmp_path / "run.mcap")
    _, name, last = messages["/contacts"][-1]
    assert name == "fork1s.Contacts"
    weight = np.zeros(3)
    for contact in last["contacts"]:
        if "box" in (contact["body_a"], contact["body_b"]):
            force = np.array([contact["force"][k] for k in "xyz"])
            sign = 1 if contact["body_b"] == "box" else -1
            weight += sign * force
            assert sign * contact["normal"]["z"] == pytest.approx(1)
            assert abs(contact["point"]["z"]) < 1e-3  # m: on the ground
    # At rest to what the contact solver leaves, relative to the weight.
    assert_allclose(weight, [0, 0, 2 * 9.81], atol=1e-4 * 2 * 9.81)
    _, _, arrows = messages["/contact_forces"][-1]
    (entity,) = arrows.entities
    lengths = sum(a.shaft_length + a.head_length for a in entity.arrows)
    forces = [np.linalg.norm([c["force"][k] for k in "xyz"]) for c in last["contacts"]]
    assert lengths == pytest.approx(0.01 * sum(forces))
    for arrow, contact in zip(entity.arrows, last["contacts"]):
        o = arrow.pose.orientation
        x_axis = [1 - 2 * (o.y**2 + o.z**2), 2 * (o.x * o.y + o.w * o.z), 2 * (o.x * o.z - o.w * o.y)]
        force = np.array([contact["force"][k] for k in "xyz"])
        assert_allclose(x_axis, force / np.linalg.norm(force), atol=1e-12)


def test_controls_sensors_pushes_and_reports(recording, tmp_path):
    fork1s.logs.export_mcap(recording, tmp_path / "run.mcap")
    messages = read_mcap(tmp_path / "run.mcap")
    with h5py.File(recording) as file:
        for topic, dataset in (("/controls", "controls"), ("/sensors", "sensors")):
            names = [name.decode() for name in file[f"names/{dataset}"][()]]
            assert len(messages[topic]) == 40
            for row, (_, name, content) in zip(file[f"steps/{dataset}"][()], messages[topic]):
                assert name == "fork1s.Values"
                assert [v["name"] for v in content["values"]] == names
                values = [np.nan if v["value"] is None else v["value"] for v in content["values"]]
                assert_array_equal(values, row)
        assert [m[2]["kinetic_energy"] for m in messages["/steps"]] == list(file["steps/kinetic_energy"][()])
        assert [m[2]["converged"] for m in messages["/steps"]] == [bool(c) for c in file["steps/converged"]]
        assert [m[2]["contacts"] for m in messages["/steps"]] == list(file["steps/contacts"][()])
    assert messages["/sensors"][0][2]["values"][-1] == {"name": "own", "value": None}
    assert all(m[2]["finite"] is True for m in messages["/steps"])
    ((time, _, content),) = messages["/pushes"][:1]
    assert time == 210_000_000 and content["pushes"][0]["body"] == "ball"
    assert content["pushes"][0]["force"] == {"x": 0.5, "y": 0, "z": 0}


def read_rerun(path):
    """Entity -> component -> [(time in ns, or None of what is static, list of values)]."""
    from rerun.chunk import RrdReader

    entities = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        times = [None] * batch.num_rows
        if not chunk.is_static:
            times = batch.column("time").cast("int64").to_pylist()
        for name in batch.schema.names:
            if name in ("time", "rerun.controls.RowId"):
                continue
            rows = entities.setdefault(chunk.entity_path, {}).setdefault(name, [])
            rows.extend(zip(times, batch.column(name).to_pylist()))
    for components in entities.values():
        for rows in components.values():
            rows.sort(key=lambda row: -1 if row[0] is None else row[0])
    return entities


def rerun_path(*parts):
    import rerun

    return "/" + "/".join(rerun.escape_entity_path_part(part) for part in parts)


def check_rerun_poses(entities, recording):
    with h5py.File(recording) as file:
        poses = np.vstack([file["initial/poses"][()].reshape(1, -1, 7), file["steps/poses"][()]])
        times = np.rint(file["steps/time"][()] * 1e9)
    bodies = fork1s._core.RecordingReader(str(recording)).bodies
    for k, body in enumerate(bodies):
        entity = entities[rerun_path("bodies", body)]
        translations = entity["Transform3D:translation"]
        assert [t for t, _ in translations][1:] == list(times)
        # Floats: half a unit in the last place of 24 bits.
        values = np.array([value[0] for _, value in translations])
        assert_allclose(values, poses[:, k, :3], rtol=2**-24, atol=1e-38)
        values = np.array([value[0] for _, value in entity["Transform3D:quaternion"]])
        assert_allclose(values, poses[:, k, [4, 5, 6, 3]], rtol=2**-24, atol=1e-38)


def test_rerun_has_the_recorded_poses_scalars_and_shapes(recording, tmp_path):
    pytest.importorskip("rerun")
    done = fork1s.logs.export_rerun(recording, tmp_path / "run.rrd", force_scale=0.01)
    assert done == fork1s.logs.Export(40, ())
    entities = read_rerun(tmp_path / "run.rrd")
    check_rerun_poses(entities, recording)
    with h5py.File(recording) as file:
        for group, dataset, tail in (
            ("joints", "coordinates", ["position"]),
            ("controls", "controls", []),
            ("sensors", "sensors", []),
        ):
            for k, name in enumerate(file[f"names/{dataset}"][()]):
                rows = entities[rerun_path(group, name.decode(), *tail)]["Scalars:scalars"]
                assert_array_equal(
                    [value[0] for _, value in rows], file[f"steps/{dataset}"][()].reshape(40, -1)[:, k]
                )
        q, times = file["steps/coordinates"][()].reshape(40, -1)[:, 0], np.rint(file["steps/time"][()] * 1e9)
        rows = entities["/joints/elbow/velocity"]["Scalars:scalars"]
        assert_allclose(
            [value[0] for _, value in rows],
            np.concatenate([[np.nan], np.diff(q) / 0.01]),
            rtol=1e-9,
            atol=1e-12,
        )
        assert [value[0] for _, value in entities["/steps/contacts"]["Scalars:scalars"]] == list(
            file["steps/contacts"][()]
        )
        # Arrows of every step, forces of all contacts; none where none bore force.
        ends = np.concatenate([[0], file["steps/contact_end"][()]])
        rows = entities["/contact_forces"]["Arrows3D:vectors"]
        assert [t for t, _ in rows] == list(times)
        for i, (_, vectors) in enumerate(rows):
            forces = file["contacts/force"][ends[i] : ends[i + 1]]
            assert_allclose(np.array(vectors).reshape(-1, 3), 0.01 * forces, rtol=2**-23, atol=1e-30)
    pushes = entities["/push_forces"]["Arrows3D:vectors"]
    assert_allclose(
        [v for _, vs in pushes for v in vs], np.tile([0.005, 0, 0], (len(pushes[20:]), 1)), rtol=1e-6
    )

    def shape(path, component):
        ((_, (value,)),) = entities[path][component]
        return value

    assert_allclose(
        shape(rerun_path("bodies", "box", "4 cube"), "Boxes3D:half_sizes"), [0.1, 0.2, 0.1], rtol=1e-7
    )
    assert_allclose(
        shape(rerun_path("bodies", "ball", "5 geom3"), "Ellipsoids3D:half_sizes"), [0.1] * 3, rtol=1e-7
    )
    capsule = rerun_path("bodies", "arm", "0 geom4")
    assert_allclose(shape(capsule, "Capsules3D:lengths"), 0.4, rtol=1e-7)
    assert_allclose(shape(capsule, "Transform3D:translation"), [0, 0, -0.2], rtol=1e-7)
    assert_allclose(shape(capsule, "Capsules3D:translations"), [0, 0, -0.2], rtol=1e-7)
    assert_allclose(shape(rerun_path("bodies", "arm", "1 geom5"), "Cylinders3D:lengths"), 0.04, rtol=1e-7)
    ((_, corners),) = entities[rerun_path("bodies", "slider", "3 tip")]["Mesh3D:vertex_positions"]
    ((_, numbers),) = entities[rerun_path("bodies", "slider", "3 tip")]["Mesh3D:triangle_indices"]
    # A tetrahedron with right angles: its volume, by the corners that its triangles name.
    a, b, c = np.array(corners)[np.array(numbers)].transpose(1, 0, 2)
    assert np.einsum("ij,ij", a, np.cross(b, c)) / 6 == pytest.approx(0.2**3 / 6, rel=1e-6)
    ((_, ground),) = entities[rerun_path("world", "6 ground")]["Mesh3D:vertex_positions"]
    assert np.abs(np.array(ground)[:, 0]).min() > 2.1


@pytest.mark.parametrize("scene", sorted(path.stem for path in SCENES.glob("*.xml")))
def test_scenes(scene, tmp_path):
    model = fork1s.load(SCENES / f"{scene}.xml")
    record(model, tmp_path / "run.h5", steps=4)
    done = fork1s.logs.export_mcap(tmp_path / "run.h5", tmp_path / "run.mcap")
    assert done.steps == 4 and done.left_out == ()
    check_poses(read_mcap(tmp_path / "run.mcap"), tmp_path / "run.h5")
    pytest.importorskip("rerun")
    done = fork1s.logs.export_rerun(tmp_path / "run.h5", tmp_path / "run.rrd")
    assert done.steps == 4 and done.left_out == ()
    check_rerun_poses(read_rerun(tmp_path / "run.rrd"), tmp_path / "run.h5")


def test_refusals(recording, tmp_path):
    export = fork1s.logs.export_mcap
    out = tmp_path / "run.mcap"
    with pytest.raises(fork1s.FileError, match="gone.h5"):
        export(tmp_path / "gone.h5", out)
    (tmp_path / "text.h5").write_text("hello")
    with pytest.raises(fork1s.Error, match="text.h5"):
        export(tmp_path / "text.h5", out)
    whole = recording.read_bytes()
    (tmp_path / "cut.h5").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(fork1s.Error, match="cut.h5"):
        export(tmp_path / "cut.h5", out)
    with pytest.raises(fork1s.UsageError, match="force_scale"):
        export(recording, out, force_scale=0)
    with pytest.raises(fork1s.UsageError, match="the recording itself"):
        export(recording, recording)
    with pytest.raises(fork1s.FileError, match="none"):
        export(recording, tmp_path / "none" / "run.mcap")
    out.write_text("a letter")
    with pytest.raises(fork1s.FileError, match=r"run\.mcap"):
        export(recording, out)
    assert out.read_text() == "a letter"
    assert not [p for p in tmp_path.iterdir() if p.name not in ("run.mcap", "text.h5", "cut.h5")]


def test_damage_in_a_step_leaves_what_was_there(recording, tmp_path):
    """The recording opens, and a step further on has another checksum."""
    broken, out = tmp_path / "broken.h5", tmp_path / "run.mcap"
    broken.write_bytes(recording.read_bytes())
    fork1s.logs.export_mcap(broken, out)
    before = out.read_bytes()
    with h5py.File(broken, "r+") as file:
        file["steps/poses"][30, 0, 0] += 1e-9
    with pytest.raises(fork1s.Error, match=r"broken\.h5"):
        fork1s.logs.export_mcap(broken, out)
    assert out.read_bytes() == before


def test_stretches_join(recording, tmp_path, monkeypatch):
    """The same file whatever is read at a time: rates and tables go on from stretch to stretch."""
    fork1s.logs.export_mcap(recording, tmp_path / "whole.mcap")
    monkeypatch.setattr(_log_source, "STRETCH_BYTES", 1)
    stretches = list(_log_source.Source(str(recording)).stretches())
    assert len(stretches) > 1 and sum(len(s) for s in stretches) == 40
    fork1s.logs.export_mcap(recording, tmp_path / "parts.mcap")
    assert (tmp_path / "whole.mcap").read_bytes() == (tmp_path / "parts.mcap").read_bytes()
    pytest.importorskip("rerun")
    fork1s.logs.export_rerun(recording, tmp_path / "parts.rrd")
    check_rerun_poses(read_rerun(tmp_path / "parts.rrd"), recording)


@pytest.mark.parametrize("ending", ["mcap", "rrd"])
def test_recordings_that_go_on_or_have_no_steps(ending, tmp_path):
    export = {"mcap": fork1s.logs.export_mcap, "rrd": fork1s.logs.export_rerun}[ending]
    pytest.importorskip({"mcap": "mcap", "rrd": "rerun"}[ending])
    sim = fork1s.Simulation(fork1s.load(SHAPES), dt=0.01)
    sim.record(tmp_path / "run.h5")
    sim._flush_recording()
    assert export(tmp_path / "run.h5", tmp_path / f"run.{ending}").steps == 0
    sim.step(3)
    sim._flush_recording()
    done = export(tmp_path / "run.h5", tmp_path / f"run.{ending}")
    assert done.steps == 3 and "not finished" in done.left_out[0]
    sim.stop_recording()
    assert export(tmp_path / "run.h5", tmp_path / f"run.{ending}") == fork1s.logs.Export(3, ())


@pytest.mark.parametrize("ending", ["mcap", "rrd"])
@pytest.mark.parametrize("missing", ["most", "end"])
def test_a_full_disk_is_an_error_and_leaves_no_file(ending, missing, recording, tmp_path):
    """By a limit on the size of files, which writing meets as it meets a full disk; also at the footer."""
    export = {"mcap": fork1s.logs.export_mcap, "rrd": fork1s.logs.export_rerun}[ending]
    pytest.importorskip({"mcap": "mcap", "rrd": "rerun"}[ending])
    out = tmp_path / f"run.{ending}"
    export(recording, out)
    # Two files of the same recording differ in size by what their identifiers compress to.
    limit = 4096 if missing == "most" else out.stat().st_size * 9 // 10
    out.unlink()
    program = f"""
import resource, signal, sys
import fork1s.logs
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
sys.exit(fork1s.logs.main([{str(recording)!r}, {str(out)!r}]))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 3 and f"run.{ending}: cannot be written" in done.stderr, done.stderr
    assert "Traceback" not in done.stderr and "disk" in done.stderr
    assert not list(tmp_path.iterdir())


def command(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "fork1s.logs", *map(str, arguments)], capture_output=True, text=True
    )


def test_command(recording, tmp_path):
    done = command(recording, tmp_path / "run.mcap")
    assert done.returncode == 0 and "wrote 40 steps" in done.stdout, done.stderr
    refused = command(recording, tmp_path / "run.bag")
    assert refused.returncode == 2 and ".mcap" in refused.stderr and "Traceback" not in refused.stderr
    refused = command(tmp_path / "gone.h5", tmp_path / "other.mcap")
    assert refused.returncode == 3 and "gone.h5" in refused.stderr and "Traceback" not in refused.stderr


def test_a_writer_that_never_answers_is_an_error(recording, tmp_path, monkeypatch):
    rerun = pytest.importorskip("rerun")
    calls = []

    def silent(stream, *, timeout_sec):
        calls.append(timeout_sec)
        raise RuntimeError("timed out")

    monkeypatch.setattr(rerun.RecordingStream, "flush", silent)
    with pytest.raises(fork1s.FileError, match=r"run\.rrd: cannot be written \(Rerun: timed out\)"):
        fork1s.logs.export_rerun(recording, tmp_path / "run.rrd")
    assert 2 <= len(calls) < 10 and calls[0] == 10.0
    assert list(tmp_path.iterdir()) == []


def test_missing_packages_are_named(recording, tmp_path):
    program = f"""
import sys
sys.modules["mcap"] = None
import fork1s.logs
sys.exit(fork1s.logs.main([{str(recording)!r}, {str(tmp_path / "run.mcap")!r}]))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 3 and "pip install 'fork1s[logs]'" in done.stderr, done.stderr
    assert "Traceback" not in done.stderr
