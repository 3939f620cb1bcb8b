"""A Stepper in MuJoCo's place: the same data, our step."""

import re
import subprocess
import sys

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

import fork1s
from fork1s.mujoco import Stepper


def loaded(path):
    model = mujoco.MjModel.from_xml_path(str(path))
    return model, mujoco.MjData(model)


def test_the_data_is_the_simulation(scenes):
    model, data = loaded(scenes / "fourbar_gripper.xml")
    stepper = Stepper(model, dt=1 / 60)
    alone = fork1s.Simulation(fork1s.load(scenes / "fourbar_gripper.xml"), dt=1 / 60)
    data.ctrl[:] = 0.4
    alone.controls.update({"left_grip": 0.4, "right_grip": 0.4})
    for _ in range(30):
        stepper.step(data)
        alone.step()
    assert stepper.simulation.hash() == alone.hash() and data.time == pytest.approx(0.5)
    for name, pose in zip(alone.bodies, alone.poses):
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
        assert_allclose(data.xpos[body], pose[:3], atol=1e-9)  # by MuJoCo's kinematics of qpos
    assert data.ncon > 0


def test_velocities_are_those_of_mujoco(scenes):
    model, data = loaded(scenes / "fourbar_gripper.xml")
    cube = model.body("cube").dofadr[0]
    data.qpos[-7:] = [0, 0, 0.3, *np.array([0.8, 0.2, 0.4, 0.4]) / np.linalg.norm([0.8, 0.2, 0.4, 0.4])]
    data.qvel[cube : cube + 6] = [0.1, 0.2, 0.3, 1, 2, 3]
    stepper = Stepper(model, dt=1e-5)
    stepper.step(data)
    assert_allclose(data.qvel[cube : cube + 6], [0.1, 0.2, 0.3 - 9.81e-5, 1, 2, 3], atol=1e-6)
    twist = np.zeros(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, model.body("cube").id, twist, 0)
    assert_allclose(stepper.simulation.velocities[stepper.simulation.bodies.index("cube")], twist, atol=1e-9)


def test_changes_from_outside_count(scenes):
    model, data = loaded(scenes / "two_link_arm.xml")
    stepper = Stepper(model, dt=1e-3)
    stepper.step(data, 5)
    data.qpos[1] += 0.3
    stepper.step(data)
    assert data.qpos[1] == pytest.approx(0.3, abs=1e-3) and data.qvel[1] < 0
    mujoco.mj_resetData(model, data)
    stepper.step(data)
    assert_allclose(data.qpos, 0, atol=1e-12)
    assert data.time == pytest.approx(1e-3)


def test_converges_to_mujoco(scenes):
    model, ours = loaded(scenes / "two_link_arm.xml")
    model.opt.timestep = 1e-4
    theirs = mujoco.MjData(model)
    stepper = Stepper(model)
    ours.qpos[:] = theirs.qpos[:] = [0.1, -0.2]
    ours.xfrc_applied[2, :3] = theirs.xfrc_applied[2, :3] = [3, 0, 0]
    mujoco.mj_forward(model, ours)
    for _ in range(2000):
        stepper.step(ours)
        mujoco.mj_step(model, theirs)
    assert_allclose(ours.qpos, theirs.qpos, atol=5e-4)  # both of first order in h


def test_ball_joints_are_carried():
    ball = """<mujoco><option gravity="0 0 -9.81" timestep="1e-4"/><worldbody><body name="a" quat="0.8 0.6 0 0">
      <joint name="b" type="ball" stiffness="1"/><geom type="box" size=".1 .2 .05" pos=".1 0 0" mass="1"/>
      </body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(ball)
    ours, theirs = mujoco.MjData(model), mujoco.MjData(model)
    for data in (ours, theirs):
        data.qpos[:], data.qvel[:] = [0.8, 0, 0.6, 0], [1, 2, -1]
    stepper = Stepper(model)
    for _ in range(2000):
        stepper.step(ours)
        mujoco.mj_step(model, theirs)
    assert_allclose(np.abs(ours.qpos @ theirs.qpos), 1, atol=1e-6)
    assert_allclose(ours.qvel, theirs.qvel, atol=5e-3)  # theirs of first order in h


def test_mocap_bodies_lead(scenes):
    model, data = loaded(scenes / "hand.xml")
    mujoco.mj_resetDataKeyframe(model, data, 0)
    stepper = Stepper(model, dt=1 / 60, keyframe="open")
    start = data.mocap_pos[0].copy()
    for n in range(30):
        data.mocap_pos[0] = start + [0, 0, 0.001 * (n + 1)]
        stepper.step(data, 2)
    assert_allclose(stepper.simulation.pose("palm")[:3, 3], data.mocap_pos[0], atol=1e-9)
    assert_allclose(data.xpos[model.body("palm").id], data.mocap_pos[0], atol=1e-9)


def test_what_cannot_be_carried_is_said():
    welded = """<mujoco><worldbody><body name="hand" mocap="true"/><body name="palm"><freejoint name="root"/>
      <geom size=".1" mass="1"/><body pos="0 0 .2"><joint name="j" stiffness="1"/><geom size=".1" mass="1"/></body></body>
      </worldbody><equality><weld body1="hand" body2="palm"/></equality></mujoco>"""
    with pytest.raises(fork1s.UsageError, match="joint 'root' cannot be carried: it does not move in fork1s"):
        Stepper(mujoco.MjModel.from_xml_string(welded))
    state = """<mujoco><worldbody><body><joint name="j" stiffness="1"/><geom size=".1" mass="1"/></body></worldbody>
      <actuator><general joint="j" dyntype="filter" dynprm="1"/></actuator></mujoco>"""
    with pytest.raises(fork1s.UsageError, match="activations"):
        Stepper(mujoco.MjModel.from_xml_string(state))


def test_set_state(gripper):
    sim = fork1s.Simulation(gripper)
    sim.controls["left_grip"] = 0.2
    sim.step(10)
    time = sim.time
    pose = [0, 0, 1, 1, 0, 0, 0]
    sim.set_state(poses={"cube": pose}, velocities={"cube": [0, 0, 1, 0.5, 0, 0]})
    assert sim.time == time and sim.controls["left_grip"] == 0.2
    cube = sim.bodies.index("cube")
    assert_allclose(sim.poses[cube], pose, atol=1e-12)
    assert_allclose(sim.velocities[cube], [0, 0, 1, 0.5, 0, 0], atol=1e-12)
    sim.step(6)
    assert_allclose(sim.poses[cube, :3], [0.05, 0, 1 - 9.81 * 0.005], atol=1e-9)
    assert sim.time == pytest.approx(time + 0.1)
    with pytest.raises(
        fork1s.UnknownNameError, match="no free body or moving base 'left_jaw'; there are: cube"
    ):
        sim.set_state(poses={"left_jaw": pose})
    with pytest.raises(ValueError, match="qpos must be 13 numbers"):
        sim.set_state(qpos=[1])


def test_a_cube_is_held_that_mujoco_drops(scenes, monkeypatch):
    import runpy

    monkeypatch.setattr(fork1s, "scene", lambda name: scenes / f"{name}.xml")
    example = runpy.run_path(str(scenes.parent / "examples" / "stepper_cube.py"))
    model = example["gripper"]()
    slipped, height = example["run"](model, Stepper(model).step)
    assert slipped[60:].max() < 0.001 and height[-1] > 110  # mm
    model = example["gripper"]()
    slipped, height = example["run"](model, lambda data: mujoco.mj_step(model, data))
    assert slipped[119] > 3 and height[-1] < 15


def test_a_box_is_held_where_mujoco_is_unstable(scenes, tmp_path):
    example = str(scenes.parent / "examples" / "stepper.py")
    ours = subprocess.run([sys.executable, example], capture_output=True, text=True, cwd=tmp_path)
    assert ours.returncode == 0, ours.stderr
    lifted, apart = (float(word) for word in re.findall(r"[0-9.]+(?= mm?\b)", ours.stdout))
    assert lifted > 0.4 and apart < 70
    theirs = subprocess.run(
        [sys.executable, example, "--mujoco"], capture_output=True, text=True, cwd=tmp_path
    )
    assert theirs.returncode == 1 and "unstable after 0." in theirs.stdout
