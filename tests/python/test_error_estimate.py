"""How far a simulation is off: the figures of `fork1s run --error --json`."""

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import fork1s

STEPS = 45
PROGRAM = Path(fork1s.__file__).parent / "bin" / "fork1s"

# A pendulum of six links, of which the reduction leaves two motions out, and a stone that falls beside it.
LINKS = ["shoulder", "elbow", "wrist", "knuckle", "knee", "toe"]
ARM = (
    '<mujoco model="arm"><custom><text name="fork1s_interface" data="tip"/>'
    '<numeric name="fork1s_modes" data="1"/></custom><worldbody>'
    + "".join(
        f'''<body name="{"tip" if joint == "toe" else joint + "_link"}" pos="{0.15 if k else 0} 0 0">
        <joint name="{joint}" type="hinge" axis="0 1 0" stiffness="2" damping="0.02"/>
        <geom type="capsule" fromto="0 0 0 0.15 0 0" size="0.02" mass="0.2"/>'''
        for k, joint in enumerate(LINKS)
    )
    + "</body>" * len(LINKS)
    + '<body name="stone" pos="0 1 0"><freejoint/><geom size="0.02" mass="0.1"/></body></worldbody></mujoco>'
)


def told_by_the_program(*arguments):
    done = subprocess.run(
        [PROGRAM, "run", "--error", "--json", *map(str, arguments)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def expect_equal(estimate, told, rtol=1e-12):
    """rtol: of the conversion from mm, where steps give the same bits."""
    assert set(estimate.bodies) == set(told["error_estimate_mm"])
    for name, body in estimate.bodies.items():
        for key in ("max", "last", "interior_max", "time_step_max", "motion"):
            assert_allclose(
                getattr(body, key), told["error_estimate_mm"][name][key] / 1e3, rtol=rtol, err_msg=name
            )
        for key in ("max", "last"):
            degrees = told["error_estimate_deg"][name][key]
            # Of what slides the angle is rounding, 1e-32 degrees.
            assert_allclose(
                np.degrees(getattr(body, "angle_" + key)), degrees, rtol=rtol, atol=1e-15, err_msg=name
            )
    percent = told["error_estimate_percent"]
    assert_allclose(estimate.motion, percent["of_mm"] / 1e3, rtol=rtol)
    assert_allclose(estimate.percent, percent["total"], rtol=rtol)
    assert_allclose(100 * estimate.interior_max / estimate.motion, percent["interior"], rtol=rtol)
    assert_allclose(100 * estimate.time_step_max / estimate.motion, percent["time_step"], rtol=rtol)
    assert estimate.quantified == percent["quantified"]
    assert estimate.within_range == percent["within_range"]


def test_figures_are_those_of_the_program_for_a_pushed_arm(tmp_path):
    (tmp_path / "arm.xml").write_text(ARM)
    told = told_by_the_program(
        tmp_path / "arm.xml",
        "--time",
        0.5,
        "--push",
        "tip:0,0.2,0:0.1..0.3",
        "--push",
        "stone:0,0,0.5:0.1..0.3",
    )
    model = fork1s.load(tmp_path / "arm.xml")
    sim = fork1s.Simulation(model, error=True)
    sim.step(6)
    sim.push("tip", force=[0, 0.2, 0])
    sim.push("stone", force=[0, 0, 0.5])
    sim.step(12)
    sim.step(12)
    estimate = sim.error_estimate
    assert estimate.bodies["tip"].interior_max > 0
    expect_equal(estimate, told)


@pytest.mark.parametrize("calls", [1, 9])
def test_figures_are_those_of_the_program_for_a_gripper_with_a_table(gripper, scenes, tmp_path, calls):
    """Controls that move over several steps of a call, with contact."""
    dt = 1 / 60
    rows = [(0, 0, 0), (STEPS * dt, 0.4, 0.3)]
    (tmp_path / "table.csv").write_text(
        "time,left_grip,right_grip\n" + "".join(f"{t!r},{a!r},{b!r}\n" for t, a, b in rows)
    )
    told = told_by_the_program(
        scenes / "fourbar_gripper.xml", "--time", STEPS * dt, "--controls", tmp_path / "table.csv"
    )
    sim = fork1s.Simulation(gripper, error=True)
    for k in range(calls):
        share = (k + 1) / calls
        sim.controls.update({"left_grip": 0.4 * share, "right_grip": 0.3 * share})
        sim.step(STEPS // calls, move=True)
    assert sim.error_estimate.max > 1e-6
    # The samples differ by rounding, which contact amplifies.
    expect_equal(sim.error_estimate, told, rtol=1e-6)


def figures(sim):
    estimate = sim.error_estimate
    return {
        name: (b.max, b.last, b.interior_max, b.time_step_max, b.motion)
        for name, b in estimate.bodies.items()
    } | {"warnings": estimate.warnings}


def test_restore_goes_back_to_the_figures_of_the_moment():
    model = fork1s.load(ARM)
    sim = fork1s.Simulation(model, error=True)
    beginning = sim.save()
    sim.step(10)
    sim.push("tip", force=[0, 0.2, 0])
    moment, then = sim.save(), figures(sim)
    sim.step(10)
    later = figures(sim)
    assert later != then
    for other in (sim, fork1s.Simulation(model, error=True)):
        other.restore(moment)
        assert figures(other) == then
        other.step(10)
        assert figures(other) == later
    sim.restore(beginning)
    assert sim.error_estimate.bodies == {} and sim.error_estimate.percent is None
    sim.step(10)
    assert figures(sim) == then


def test_moment_without_figures_begins_anew():
    model = fork1s.load(ARM)
    plain = fork1s.Simulation(model)
    with pytest.raises(fork1s.UsageError, match="error=True"):
        plain.error_estimate
    plain.step(10)
    sim = fork1s.Simulation(model, error=True)
    sim.step(30)
    sim.restore(plain.save())
    assert sim.error_estimate.bodies == {}
    assert "began again at a moment" in sim.error_estimate.warnings[0]
    sim.step()
    motion = np.linalg.norm(sim.pose("tip")[:3, 3] - plain.pose("tip")[:3, 3])
    assert_allclose(sim.error_estimate.bodies["tip"].motion, motion, rtol=1e-12)
    plain.restore(sim.save())
    plain.step()


def test_state_set_is_a_beginning():
    """A state from outside is exact: the figures are those of a simulation that starts there."""
    model = fork1s.load(ARM)
    sim, fresh = fork1s.Simulation(model, error=True), fork1s.Simulation(model, error=True)
    sim.step(20)
    start = fresh.qpos
    for s in (sim, fresh):
        s.set_state(start, joints={"shoulder": 0.3}, joint_velocities={"elbow": 1}, qvel=np.zeros(12))
        assert s.error_estimate.bodies == {}
        s.step(10)
    assert sim.error_estimate.warnings == []
    for name, body in sim.error_estimate.bodies.items():
        assert_allclose(body.max, fresh.error_estimate.bodies[name].max, rtol=1e-6, err_msg=name)


def test_other_detail_and_stiffness_keep_the_largest():
    sim = fork1s.Simulation(fork1s.load(ARM), error=True)
    sim.step(20)
    before = sim.error_estimate
    sim.set_detail(modes=4)
    sim.set_stiffness({"shoulder": 3})
    assert sim.error_estimate.max == before.max
    sim.step()
    after = sim.error_estimate
    assert after.max == before.max and after.bodies["tip"].last < before.bodies["tip"].last
    assert "the error estimate began again where the detail changed" in after.warnings
    sim.set_stiffness({"shoulder": 4})
    sim.step()
    assert "the error estimate began again where stiffnesses changed" in sim.error_estimate.warnings


def test_step_that_is_undone_is_left_out():
    model = fork1s.load(ARM)
    sim, plain = fork1s.Simulation(model, error=True), fork1s.Simulation(model, error=True)
    sim.step(5)
    sim.push("stone", force=[1e308, 1e308, 1e308], torque=[1e308, 1e308, 1e308])
    assert not sim.step(3).finite
    sim.step(5)
    plain.step(10)
    assert sim.hash() == plain.hash()
    assert figures(sim) == figures(plain)


def test_figures_leave_the_steps_as_they_are():
    model = fork1s.load(ARM)
    sim, plain = fork1s.Simulation(model, error=True), fork1s.Simulation(model)
    sim.step(20)
    plain.step(20)
    assert sim.hash() == plain.hash()
    assert repr(sim.error_estimate).startswith("<fork1s.ErrorEstimate max=")
