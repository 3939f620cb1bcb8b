"""Beside the full-coordinate simulator and MuJoCo."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import fork1s


def test_against_the_full_coordinates(scenes):
    model = fork1s.load(scenes / "two_link_arm.xml", q={"elbow": 0.2})
    answer = fork1s.compare(model, time=0.2, dt=1e-3, integrator="euler")
    # Two springs, two reduced coordinates: nothing was left out, and both solve the same equation, here to 1e-6 of the
    # motion of a step.
    finer = fork1s.compare(model, time=0.2, dt=2.5e-4, integrator="euler")
    assert answer.against == "full" and answer.bodies["forearm"].rms_mm < 0.05
    assert finer.bodies["forearm"].rms_mm < 0.05
    assert_allclose(answer.frequencies_reduced, answer.frequencies_full, rtol=1e-9)
    trace = answer.traces["forearm"]
    assert trace.reduced.shape == trace.other.shape == (len(answer.times), 3)
    assert answer.times[0] == 0 and answer.times[-1] == pytest.approx(0.2)
    sim = fork1s.Simulation(model, dt=1e-3, integrator="euler")
    sim.step(sim_steps := len(answer.times) - 1)
    assert_allclose(trace.reduced[sim_steps], sim.pose("forearm")[:3, 3], atol=1e-12)


def test_against_mujoco_with_controls(gripper, tmp_path):
    ramp = {"time": [0, 0.2], "left_grip": [0, 0.2], "right_grip": [0, 0.2]}
    answer = fork1s.compare(gripper, against="mujoco", time=0.2, controls=ramp)
    assert answer.against == "mujoco" and answer.bodies["left_jaw"].max_mm < 1.0
    path = tmp_path / "report.html"
    answer.write_report(str(path))
    assert "<svg" in path.read_text()
    with pytest.raises(fork1s.FileError):
        answer.write_report(str(tmp_path / "no" / "report.html"))


def test_a_table_that_mujoco_has_no_actuator_for_is_refused(tmp_path):
    path = tmp_path / "palm.xml"
    path.write_text(
        "<mujoco><custom><text name='fork1s_base' data='driven'/></custom><worldbody><body name='palm'>"
        "<geom size='.05'/><body name='finger' pos='.05 0 .02'><joint name='k' stiffness='5' damping='.1'/>"
        "<geom size='.02' mass='.05'/></body></body></worldbody></mujoco>"
    )
    model = fork1s.load(path)
    with pytest.raises(fork1s.ModelError, match="'palm.x'.*no actuator"):
        fork1s.compare(model, against="mujoco", time=0.1, controls={"time": [0, 0.1], "palm.x": [0, 0.1]})


URDF_ARM = """<robot name="arm"><link name="foot"/><link name="upper">
  <inertial><origin xyz="0 0 .05"/><mass value=".4"/>
    <inertia ixx=".002" ixy="0" ixz="0" iyy=".002" iyz="0" izz=".001"/></inertial></link>
  <joint name="knee" type="revolute"><parent link="foot"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="{lower}" upper="1" effort="50" velocity="1"/></joint></robot>"""


def test_a_urdf_against_mujoco(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(URDF_ARM.format(lower=-1))
    model = fork1s.load(path, interface="upper", pd=(20, 1), q={"knee": 0.3})
    answer = fork1s.compare(model, against="mujoco", time=0.2, dt=1e-3)
    assert answer.traces["upper"].reduced.shape == (len(answer.times), 3)
    assert answer.bodies["upper"].max_deg < 0.1
    assert not answer.warnings


def test_a_urdf_against_mujoco_keeps_its_start(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(URDF_ARM.format(lower=0.2))
    model = fork1s.load(path, interface="upper", pd=(20, 1), keep_start=True)
    # One step: MuJoCo's stop at 0.2 rad then pushes the joint back, ours is where the joint starts.
    answer = fork1s.compare(model, against="mujoco", time=1e-3, dt=1e-3)
    assert answer.bodies["upper"].max_deg < 0.1


def test_mjcf_with_other_options_against_mujoco(scenes):
    model = fork1s.load(scenes / "two_link_arm.xml", q={"elbow": 0.2}, pd=(1, 0.1))
    assert fork1s.compare(model, against="mujoco", time=0.2, dt=1e-3).bodies["forearm"].max_mm < 1


def test_refusals(gripper, scenes):
    with pytest.raises(fork1s.UsageError, match="'peer' is none of: full, mujoco"):
        fork1s.compare(gripper, against="peer")
    text = fork1s.load((scenes / "two_link_arm.xml").read_text())
    softer = fork1s.load(scenes / "two_link_arm.xml").with_stiffness({"elbow": 50})
    for model in (text, softer):
        with pytest.raises(fork1s.UsageError, match="MuJoCo opens the file of a model: load it from a path"):
            fork1s.compare(model, against="mujoco")
    scaled = fork1s.load(scenes / "two_link_arm.xml", stiffness_scale=2)
    with pytest.raises(fork1s.UsageError, match="stiffness-scale: is not written as MJCF"):
        fork1s.compare(scaled, against="mujoco")
    with pytest.raises(fork1s.UsageError, match="needs a column 'time'"):
        fork1s.compare(gripper, controls={"left_grip": [1]})
    with pytest.raises(fork1s.UsageError, match="'left_grip' has 1 values for 2 times"):
        fork1s.compare(gripper, controls={"time": [0, 1], "left_grip": [1]})
    with pytest.raises(fork1s.ModelError, match="thumb"):
        fork1s.compare(gripper, controls={"time": np.array([0, 1]), "thumb": [1, 1]})


def test_full_run_has_the_order_of_the_reduced_one(scenes):
    model = fork1s.load(scenes / "two_link_arm.xml", q={"elbow": 0.2})
    coarse, fine = (fork1s.compare(model, time=0.2, dt=dt, integrator="two-stage") for dt in (4e-3, 2e-3))
    assert coarse.integrators == "reduced by two-stage, full by two-stages"
    # The same rule on both sides, solved to 1e-6 of the motion of a step.
    assert max(c.bodies["forearm"].rms_mm for c in (coarse, fine)) < 0.02
    mixed = fork1s.compare(model, time=0.1, integrator="two-stage", full_integrator="euler")
    assert mixed.integrators == "reduced by two-stage, full by euler"
    for wrong in ({"integrator": "two-stages"}, {"full_integrator": "leapfrog"}, {"integrator": "theta"}):
        with pytest.raises(fork1s.UsageError):
            fork1s.compare(model, **wrong)
