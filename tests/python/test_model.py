"""What a model says before anything moves, against closed forms and against MuJoCo."""

import os
import pickle
import struct
import subprocess
import sys
import warnings
import zlib

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

import fork1s


def test_compliance_of_two_links(arm):
    # Elbow and shoulder turn about z; the forearm's origin is the elbow, 1 m along x from the shoulder.
    k = 100.0
    shoulder = np.array([0, 0, 1, 0, 1, 0.0])  # twist of the forearm's origin per joint rate, angular first
    elbow = np.array([0, 0, 1, 0, 0, 0.0])
    expected = (np.outer(shoulder, shoulder) + np.outer(elbow, elbow)) / k
    assert_allclose(arm.compliance("forearm"), expected, atol=1e-15)
    assert arm.compliance("upper_arm", "forearm").shape == (12, 12)
    assert arm.stiffness("forearm") is None  # it cannot be pushed along z


def test_compliance_behind_a_free_joint_is_refused_or_locked():
    model = fork1s.load("""<mujoco><custom><text name="fork1s_interface" data="tip"/></custom><worldbody>
      <body><joint name="a" axis="0 0 1" stiffness="20"/><geom size=".01" mass="1"/>
      <body pos=".1 0 0"><joint name="b" axis="0 0 1"/><geom size=".01" mass="1"/>
      <body name="tip" pos=".1 0 0"><joint name="c" axis="0 0 1" stiffness="50"/><geom size=".01" mass="1"/></body>
      </body></body></worldbody></mujoco>""")
    for ask in (model.compliance, model.stiffness, model.response, model.mechanisms[0].compliance):
        with pytest.raises(fork1s.UnderdeterminedError, match="joint 'b'.*'tip'"):
            ask("tip")
    C = model.compliance("tip", lock_free=True)
    assert_allclose(C[2, 2], 1 / 20 + 1 / 50, rtol=1e-12)  # springs in series
    assert_allclose(C[4, 4], 0.2**2 / 20, rtol=1e-12)  # with the arm of joint a
    assert_allclose(model.response("tip", lock_free=True)[4], [0.2 / 20, 0, 0], atol=1e-14)
    assert model.stiffness("tip", lock_free=True) is None  # it cannot be pushed along z


def test_stiffness_is_the_inverse_where_it_exists():
    springs = "".join(
        f'<joint type="{kind}" axis="{axis}" stiffness="{k}"/>'
        for kind, axis, k in [
            ("slide", "1 0 0", 10),
            ("slide", "0 1 0", 20),
            ("slide", "0 0 1", 30),
            ("hinge", "1 0 0", 1),
            ("hinge", "0 1 0", 2),
            ("hinge", "0 0 1", 3),
        ]
    )
    model = fork1s.load(
        f'<mujoco><worldbody><body name="b">{springs}<geom size=".1" mass="1"/></body></worldbody></mujoco>',
        interface="b",
    )
    assert_allclose(model.stiffness("b"), np.diag([1, 2, 3, 10, 20, 30]), atol=1e-9)


def test_frequencies_of_two_links(arm):
    expected = np.array([7.5693, 19.8168]) / (2 * np.pi)  # docs/validation.md
    assert_allclose(arm.frequencies, expected, rtol=1e-5)
    assert_allclose(arm.reduced_frequencies, expected, rtol=1e-5)


def test_matrices_have_the_frequencies(arm):
    m = arm.matrices
    assert m.M.shape == m.D.shape == m.K.shape == (2, 2)
    omega2 = np.sort(np.linalg.eigvals(np.linalg.solve(m.M, m.K)).real)
    assert_allclose(np.sqrt(omega2), [7.5693, 19.8168], rtol=1e-5)
    assert m.Q.shape == (2, 2) and m.q_ref.shape == (2,)
    assert m.T.shape == (3, 6, 2)
    # Twist of the forearm about the base's origin: both joints turn about z, the elbow 1 m along x.
    screws = np.array([[0, 0, 1, 0, 0, 0], [0, 0, 1, 0, -1, 0.0]]).T
    at_base = arm.mechanisms[0].bodies.index("forearm")
    turn = m.T[at_base] @ np.linalg.inv(m.Q)
    assert_allclose(turn[:3], screws[:3], atol=1e-12)
    assert_allclose(turn[:, 1] - turn[:, 0], [0, 0, 0, 0, -1, 0], atol=1e-12)


def test_matrices_are_views_that_nobody_may_change(arm):
    m = arm.matrices
    for name in ("M", "D", "Q", "T", "q_ref"):
        array = getattr(m, name)
        assert array.dtype == np.float64 and not array.flags.owndata
        with pytest.raises(ValueError):
            array[...] = 0
        again = getattr(m, name)
        assert array.__array_interface__["data"][0] == again.__array_interface__["data"][0]


def test_poses_are_those_of_mujoco(scenes):
    mj_model = mujoco.MjModel.from_xml_path(str(scenes / "hand.xml"))
    mj_data = mujoco.MjData(mj_model)
    mujoco.mj_resetDataKeyframe(mj_model, mj_data, 0)
    mujoco.mj_kinematics(mj_model, mj_data)
    sim = fork1s.Simulation(fork1s.load(scenes / "hand.xml", keyframe="open"))
    compared = 0
    for name, pose in zip(sim.bodies, sim.poses):
        body = mujoco.mj_name2id(mj_model, mujoco.mjtObj.mjOBJ_BODY, name)
        if body < 0:
            continue
        quaternion = mj_data.xquat[body]
        # Loops and servos are none of MuJoCo's kinematics; the mechanism starts exactly at the keyframe.
        assert_allclose(pose[:3], mj_data.xpos[body], atol=1e-12)
        assert_allclose(pose[3:], quaternion * np.sign(quaternion[0]), atol=1e-12)
        compared += 1
    assert compared == 22


def test_what_the_file_has(hand):
    assert hand.format == "MJCF" and hand.name == "hand"
    assert hand.interfaces == ["index_tip", "middle_tip", "ring_tip", "little_tip", "thumb_tip"]
    assert "open" in hand.keyframes
    assert any("timestep" in note for note in hand.notes)
    assert "2 N·m/rad" in hand.holds["index_knuckle_flex"]
    assert_allclose(hand.gravity, [0, 0, -9.81])
    lower, upper, initial = hand.controls["index_knuckle_flex"]
    assert lower < initial < upper


def test_interface_and_modes(scenes):
    model = fork1s.load(scenes / "hand.xml", interface=["index_tip", "thumb_tip"], modes=3)
    assert model.interfaces == ["index_tip", "thumb_tip"]
    assert model.matrices.num_modes == 3
    one = fork1s.load(scenes / "hand.xml", interface="index_tip", modes=0)
    assert one.interfaces == ["index_tip"] and one.matrices.num_modes == 0


@pytest.mark.parametrize("how", ["path", "text", "MjModel", "MjSpec"])
def test_every_source_is_the_same_model(scenes, how):
    path = scenes / "fourbar_gripper.xml"
    source = {
        "path": lambda: path,
        "text": path.read_text,
        "MjModel": lambda: mujoco.MjModel.from_xml_path(str(path)),
        "MjSpec": lambda: mujoco.MjSpec.from_file(str(path)),
    }[how]()
    expected = fork1s.Simulation(fork1s.load(path))
    sim = fork1s.Simulation(fork1s.load(source))
    for s in (expected, sim):
        s.controls["left_grip"] = 0.3
        s.step(30)
    assert sim.hash() == expected.hash()


def test_a_changed_mujoco_model_counts(scenes):
    mj_model = mujoco.MjModel.from_xml_path(str(scenes / "two_link_arm.xml"))
    mj_model.jnt_stiffness[:] *= 4
    assert_allclose(
        fork1s.load(mj_model).frequencies,
        2 * fork1s.load(scenes / "two_link_arm.xml").frequencies,
        rtol=1e-12,
    )


def test_a_mujoco_model_with_plugins_is_read_by_their_names():
    """The libraries of the package and of fork1s have loaded different plugins, and count them differently."""
    text = """<mujoco><extension><plugin plugin="mujoco.pid"><instance name="p"><config key="kp" value="5"/></instance></plugin>
      </extension><worldbody><body name="b"><joint name="j" stiffness="1"/><geom size=".1"/></body></worldbody>
      <actuator><plugin joint="j" plugin="mujoco.pid" instance="p" actdim="0"/></actuator></mujoco>"""
    expected = fork1s.load(text).stiffnesses
    assert expected == {"j": 6}
    assert fork1s.load(mujoco.MjSpec.from_string(text)).stiffnesses == expected
    assert fork1s.load(mujoco.MjModel.from_xml_string(text)).stiffnesses == expected


def _mounted_part(folder, name, meshes, size):
    """A file whose body bears a mesh and stands on a height field, in a folder of its own."""
    (folder / name / meshes).mkdir(parents=True)
    files = {
        "part.obj": f"v 0 0 0\nv {size} 0 0\nv 0 {size} 0\nv 0 0 {size}\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n".encode(),
        "ground.bin": struct.pack("<2i9f", 3, 3, *[0, size, 2 * size] * 3),
        "paint.png": _grey_png(),
    }
    for file, content in files.items():
        (folder / name / meshes / file).write_bytes(content)
    text = f"""<mujoco model="{name}"><compiler meshdir="{meshes}" texturedir="{meshes}"/><asset><mesh file="part.obj"/>
      <hfield name="ground" file="ground.bin" size="1 1 {size} .1"/><texture name="paint" type="2d" file="paint.png"/>
      <texture name="faces" type="cube" fileright="paint.png" fileleft="paint.png"/><material name="paint" texture="paint"/>
      <material name="faces" texture="faces"/></asset>
      <worldbody><geom type="hfield" hfield="ground" pos="9 0 0"/><body name="part"><joint name="hinge" stiffness="1"/>
      <geom type="mesh" mesh="part" material="paint"/><site name="flange"/></body></worldbody></mujoco>"""
    (folder / name / "model.xml").write_text(text)
    return folder / name / "model.xml", text, files


def _grey_png():
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">2I5B", 4, 4, 8, 0, 0, 0, 0)
    pixels = zlib.compress(b"\0\x80\x80\x80\x80" * 4)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", pixels) + chunk(b"IEND", b"")


@pytest.mark.filterwarnings("ignore:texture .* is grey")
@pytest.mark.parametrize("how", ["file", "assets", "assets with folders", "nested", "in XML"])
def test_an_mjspec_with_attached_models_is_read(tmp_path, how):
    """Files of one name in two folders: MuJoCo writes names alone, and each is found where MuJoCo found it."""
    (path, text, files), (_, child_text, child_files) = (
        _mounted_part(tmp_path, "base", "assets", 1),
        _mounted_part(tmp_path, "arm", "meshes", 2),
    )
    folder = "with folders" in how
    if "assets" in how:
        spec = mujoco.MjSpec.from_string(
            text, assets={("assets/" if folder else "") + name: content for name, content in files.items()}
        )
        child = mujoco.MjSpec.from_string(
            child_text,
            assets={("meshes/" if folder else "") + name: content for name, content in child_files.items()},
        )
    else:
        spec = mujoco.MjSpec.from_file(str(path))
        child = mujoco.MjSpec.from_file(str(tmp_path / "arm" / "model.xml"))
    if how == "in XML":
        text = text.replace("<asset>", '<asset><model name="arm" file="../arm/model.xml"/>').replace(
            "</worldbody>",
            '<replicate count="2" offset="0 0 1"><frame><attach model="arm" body="part" prefix="arm_"/></frame></replicate>'
            "</worldbody>",
        )
        path.write_text(text)
        spec = mujoco.MjSpec.from_file(str(path))
    elif "assets" in how:  # attach_body does not take assets along
        spec.attach(child, prefix="arm_", frame=spec.worldbody.add_frame(pos=[0, 0, 1]))
    else:
        spec.body("part").add_frame(pos=[0, 0, 1]).attach_body(child.body("part"), "arm_", "")
    if how == "nested":
        outer = mujoco.MjSpec()
        outer.attach(spec, prefix="cell_", frame=outer.worldbody.add_frame())
        spec = outer
    compiled = spec.compile()
    model = fork1s.load(spec)
    masses = sorted(mechanism.mass for mechanism in model.mechanisms)
    roots = [i for i in range(1, compiled.nbody) if compiled.body_parentid[i] == 0]
    assert_allclose(masses, sorted(compiled.body_subtreemass[roots]), rtol=1e-9)
    assert max(compiled.body_mass) == pytest.approx(8 * 1000 / 6)
    if how == "in XML":
        again = fork1s.load(mujoco.MjModel.from_xml_path(str(path)))
        assert sorted(mechanism.mass for mechanism in again.mechanisms) == pytest.approx(masses)
    elif mujoco.mj_versionString() != fork1s.mujoco_version:
        with pytest.raises(fork1s.UsageError, match="load the MjSpec that it was compiled from"):
            fork1s.load(compiled)


PLUGIN = """<extension><plugin plugin="mujoco.pid"><instance name="p"><config key="kp" value="5"/></instance></plugin></extension>
  <worldbody><body><joint name="pid"/><geom size=".1"/></body></worldbody>
  <actuator><plugin joint="pid" plugin="mujoco.pid" instance="p"/></actuator>"""


def _with_plugin(text):
    """The text with a plugin: its specifications and compiled models are read from XML, whatever MuJoCo's version is."""
    return text.replace("</mujoco>", PLUGIN + "</mujoco>")


def _text_of(model):
    """The text that load made of an object of MuJoCo."""
    from fork1s._load import recipe_of

    return recipe_of(model)[0]


@pytest.mark.parametrize("read", [mujoco.MjSpec.from_file, mujoco.MjModel.from_xml_path])
def test_sides_of_a_cube_in_the_folder_of_the_model_stay(tmp_path, read):
    path, text, _ = _mounted_part(tmp_path, "base", "assets", 1)
    path.write_text(_with_plugin(text))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        text = _text_of(fork1s.load(read(str(path))))
    side = tmp_path / "base" / "assets" / "paint.png"
    assert f'fileright="{side}"' in text and f'fileleft="{side}"' in text


def test_sides_of_a_cube_in_another_folder_become_grey_with_a_warning(tmp_path):
    (path, text, _), (other, child_text, _) = (
        _mounted_part(tmp_path, "base", "assets", 1),
        _mounted_part(tmp_path, "arm", "meshes", 2),
    )
    path.write_text(_with_plugin(text))
    other.write_text(child_text.replace('"paint.png"', '"other.png"'))
    (tmp_path / "arm" / "meshes" / "paint.png").rename(tmp_path / "arm" / "meshes" / "other.png")
    spec = mujoco.MjSpec.from_file(str(path))
    child = mujoco.MjSpec.from_file(str(other))
    spec.attach(child, prefix="arm_", frame=spec.worldbody.add_frame(pos=[0, 0, 1]))
    with pytest.warns(UserWarning, match="texture 'arm_faces' is grey.*other.png.*spec.assets") as warned:
        text = _text_of(fork1s.load(spec))
    assert len(warned) == 1 and warned[0].filename == __file__
    assert text.count("builtin=") == 1 and text.count("fileright=") == 1
    # As assets they are found.
    spec.assets["other.png"] = _grey_png()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert "builtin=" not in _text_of(fork1s.load(spec))


@pytest.mark.filterwarnings("ignore:texture .* is grey")
def test_a_texture_whose_file_is_gone_is_refused(tmp_path):
    """Of one file, MuJoCo records the path: without it there is no model to read again, as with a mesh."""
    path, text, _ = _mounted_part(tmp_path, "base", "assets", 1)
    path.write_text(_with_plugin(text))
    model = mujoco.MjModel.from_xml_path(str(path))
    (tmp_path / "base" / "assets" / "paint.png").unlink()
    with pytest.raises(fork1s.UsageError, match="cannot be read again.*paint.png.*Load the path"):
        fork1s.load(model)


def test_assets_of_one_name_are_told_apart_by_their_paths(tmp_path):
    """MuJoCo looks for a path among the keys, then for its last part, of which it takes the last key; then on the disk."""

    def mesh(size):
        return f"v 0 0 0\nv {size} 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n".encode()

    text = _with_plugin(
        """<mujoco><compiler meshdir="m"/><asset><mesh name="a" file="a/part.obj"/><mesh name="b" file="b/part.obj"/></asset>
        <worldbody><body><joint stiffness="1"/><geom type="mesh" mesh="a"/></body>
        <body><joint stiffness="1"/><geom type="mesh" mesh="b"/></body></worldbody></mujoco>"""
    )

    def masses(spec):
        return sorted(mechanism.mass for mechanism in fork1s.load(spec).mechanisms)[-2:]

    one, two = 1000 / 6, 2000 / 6
    by_path = {"m/a/part.obj": mesh(1), "m/b/part.obj": mesh(2)}
    assert masses(mujoco.MjSpec.from_string(text, assets=by_path)) == pytest.approx([one, two])
    same = {"x/part.obj": mesh(2), "y/part.obj": mesh(2)}
    assert masses(mujoco.MjSpec.from_string(text, assets=same)) == pytest.approx([two, two])
    with pytest.raises(fork1s.UsageError, match="'m/a/part.obj'.*'a/part.obj' and 'b/part.obj'.*path"):
        fork1s.load(mujoco.MjSpec.from_string(text, assets={"a/part.obj": mesh(1), "b/part.obj": mesh(2)}))
    # MuJoCo compiles the asset, and not the file of the same path.
    (tmp_path / "m" / "a").mkdir(parents=True)
    (tmp_path / "m" / "a" / "part.obj").write_bytes(mesh(1))
    (tmp_path / "model.xml").write_text(text)
    spec = mujoco.MjSpec.from_file(str(tmp_path / "model.xml"), assets={"part.obj": mesh(2)})
    assert sorted(spec.compile().body_mass)[-2:] == pytest.approx([two, two])
    assert masses(spec) == pytest.approx([two, two])


STORED_ELSEWHERE = """
import pickle, sys, mujoco, fork1s
from fork1s._sweep_identity import identity_of
text, files, model = pickle.load(sys.stdin.buffer)
if files:  # assets of its own, in a folder of its own
    fork1s.load(mujoco.MjSpec.from_string(text, assets=files))
print(identity_of(model, len).contents["model"], end="")
"""


@pytest.mark.parametrize("process", ["same", "fork", "spawned", "spawned with assets"])
def test_a_model_with_stored_assets_counts_the_same_in_every_process(tmp_path, process):
    """The folder of the process that stored the assets is no part of a model's identity."""
    from fork1s._sweep_identity import identity_of

    _, text, files = _mounted_part(tmp_path, "base", "assets", 1)
    text = _with_plugin(text)
    model = fork1s.load(mujoco.MjSpec.from_string(text, assets=files))
    again = fork1s.load(mujoco.MjSpec.from_string(text, assets=files))
    larger = {**files, "part.obj": files["part.obj"].replace(b"v 1", b"v 2")}
    other = fork1s.load(mujoco.MjSpec.from_string(text, assets=larger))
    expected = identity_of(model, len).contents["model"]
    assert identity_of(other, len).contents["model"] != expected
    if process == "same":
        found = identity_of(again, len).contents["model"]
    elif process == "fork":
        read, write = os.pipe()
        child = os.fork()
        if child == 0:
            fork1s.load(mujoco.MjSpec.from_string(text, assets=larger))
            os.write(write, identity_of(model, len).contents["model"].encode())
            os._exit(0)
        os.close(write)
        os.waitpid(child, 0)
        with os.fdopen(read) as pipe:
            found = pipe.read()
    else:
        done = subprocess.run(
            [sys.executable, "-c", STORED_ELSEWHERE],
            input=pickle.dumps((text, larger if "with assets" in process else {}, model)),
            stdout=subprocess.PIPE,
            check=True,
        )
        found = done.stdout.decode()
    assert found == expected


def test_base_pose_by_roll_pitch_and_yaw(scenes):
    """As URDF: about the fixed axes x, y and z, one after the other; and as the command line reads it."""
    roll, pitch, yaw = 0.3, -0.5, 1.2
    x, y, z = (
        np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]]),
        np.array([[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]]),
        np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]]),
    )
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = z @ y @ x, [1, 2, 0.7]
    path = scenes / "quadruped.xml"
    by_angles = fork1s.Simulation(fork1s.load(path, base_pose=[1, 2, 0.7, roll, pitch, yaw]))
    by_matrix = fork1s.Simulation(fork1s.load(path, base_pose=pose))
    base = by_angles.model.mechanisms[0].bodies[0]
    assert_allclose(by_angles.pose(base), by_matrix.pose(base), atol=1e-14)
    with pytest.raises(ValueError, match="6 .position, roll, pitch and yaw.*not an array of shape .5,."):
        fork1s.load(path, base_pose=[0, 0, 1, 0, 0])
    with pytest.raises(ValueError, match="base_pose must be finite, and entry 5"):
        fork1s.load(path, base_pose=[0, 0, 1, 0, 0, np.nan])


def test_start_and_gains(scenes):
    start = fork1s.load(scenes / "two_link_arm.xml", q={"elbow": 0.5})
    assert_allclose(fork1s.Simulation(start).qpos, [0, 0.5])
    held = fork1s.load(scenes / "two_link_arm.xml", pd={"elbow": (300, 2)})
    # The elbow's spring and gains are side by side: 400 N·m/rad turns the forearm alone.
    assert_allclose(held.compliance("forearm")[2, 2], 1 / 100 + 1 / 400, rtol=1e-12)
    everything = fork1s.load(scenes / "two_link_arm.xml", pd={"all": (300, 2)})
    assert_allclose(everything.compliance("forearm")[2, 2], 2 / 400, rtol=1e-12)
    stiff = fork1s.load(scenes / "two_link_arm.xml", stiffness_scale=9)
    assert_allclose(stiff.frequencies, 3 * fork1s.load(scenes / "two_link_arm.xml").frequencies, rtol=1e-12)


def test_scenes_of_the_package():
    assert fork1s.load(fork1s.scene("hand")).name == "hand"
    with pytest.raises(fork1s.UnknownNameError, match="fourbar_gripper, hand, peg_gripper, quadruped"):
        fork1s.scene("none")


def test_a_package_without_scenes_says_where_it_looked(monkeypatch, tmp_path):
    from fork1s import _load

    monkeypatch.setattr(_load, "__file__", str(tmp_path / "_load.py"))
    with pytest.raises(fork1s.UnknownNameError, match="has none") as raised:
        _load.scene("hand")
    assert str(tmp_path / "scenes") in str(raised.value)


def test_hold_keeps_the_posture_of_the_start():
    """An arm of 1 kg at 0.5 m on a servo of 200 N·m/rad sags from the pose q by θ: 200 θ = m g l cos(q + θ)."""
    text = """<mujoco><compiler angle="radian"/><worldbody><body name="arm" pos="0 0 1"><joint name="lift" axis="0 1 0"/>
      <geom size=".05" mass="1" pos=".5 0 0"/></body></worldbody>
      <actuator><position name="lift" joint="lift" kp="200" kv="20"/><motor name="help" joint="lift"/></actuator>
      <keyframe><key name="low" qpos=".7" ctrl="0 .5"/></keyframe></mujoco>"""

    def rest(q, torque=0.0):
        sag = 0.0
        for _ in range(60):
            sag = (9.81 * 0.5 * np.cos(q + sag) + torque) / 200
        return q + sag

    held = fork1s.load(text, q={"lift": -0.4}, hold=True)
    assert any("'help'" in note and "hold" in note for note in held.notes)
    sim = fork1s.Simulation(held)
    assert sim.controls["lift"] == pytest.approx(-0.4, abs=1e-12) and sim.controls["help"] == 0
    assert sim.actuator_forces["lift"] == pytest.approx(0, abs=1e-9)
    sim.step(240)
    assert sim.qpos == pytest.approx([rest(-0.4)], abs=1e-5)
    assert fork1s.Simulation(pickle.loads(pickle.dumps(held))).controls["lift"] == sim.controls["lift"]
    low = fork1s.Simulation(held, keyframe="low")
    assert low.controls["lift"] == pytest.approx(0.7, abs=1e-12) and low.controls["help"] == 0.5
    low.step(240)
    assert low.qpos == pytest.approx([rest(0.7, 0.5)], abs=1e-5)
    # the equilibrium, solved without a simulation; it turns by the sag from the start
    answer = fork1s.statics(held, "arm", [0, 0, 0])
    at = answer.nonlinear.position - [0, 0, 1]
    assert at == pytest.approx([0, 0, 0], abs=1e-9)
    assert answer.nonlinear.rotation == pytest.approx([0, rest(-0.4) + 0.4, 0], abs=1e-6)
    plain = fork1s.Simulation(fork1s.load(text, q={"lift": -0.4}))
    plain.step(240)
    assert plain.qpos == pytest.approx([rest(0.0)], abs=1e-5)
    with pytest.raises(TypeError, match="hold must be True or False"):
        fork1s.load(text, hold="no")


def test_keep_start_starts_a_joint_outside_its_limits():
    text = """<mujoco><worldbody><body name="thigh"><joint name="knee" axis="0 1 0" range="30 70"/>
      <geom size=".1" pos=".3 0 0"/></body></worldbody></mujoco>"""
    moved, kept = fork1s.load(text), fork1s.load(text, keep_start=True)
    assert any("the file starts it outside its limits" in note for note in moved.notes)
    assert any("starts outside its limits, as the file has it" in note for note in kept.notes)
    assert fork1s.Simulation(moved).qpos == pytest.approx([np.pi / 6])
    assert fork1s.Simulation(kept).qpos == [0]
    again = pickle.loads(pickle.dumps(kept))
    assert fork1s.Simulation(again).qpos == [0]
    with pytest.raises(TypeError, match="keep_start must be True or False"):
        fork1s.load(text, keep_start="no")
