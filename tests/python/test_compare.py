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


def test_refusals(gripper, scenes):
    with pytest.raises(fork1s.UsageError, match="'peer' is none of: full, mujoco"):
        fork1s.compare(gripper, against="peer")
    text = fork1s.load((scenes / "two_link_arm.xml").read_text())
    with pytest.raises(fork1s.UsageError, match="MuJoCo runs an MJCF file as it stands"):
        fork1s.compare(text, against="mujoco")
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
