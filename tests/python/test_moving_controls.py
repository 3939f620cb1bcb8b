"""Controls that move within a step: what a table of the command line gives, set step by step."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from test_record import fork1s_command

import fork1s

INTEGRATORS = ["euler", "two-stage"]
STEPS = 40
CART = """<mujoco><option gravity="0 0 0"/><worldbody><body name="cart">
  <joint name="slide" type="slide" axis="1 0 0" damping="3"/><geom size=".1" mass="2" contype="0" conaffinity="0"/>
</body></worldbody><actuator><position name="set" joint="slide" kp="5000"/></actuator></mujoco>"""


def path(t):
    return np.array([0.2 * np.sin(6 * t), 0.2 * (1 - np.cos(5 * t))])


def run_table(scene, folder, integrator, table):
    """Controls and poses of the command line's table at the end of every step."""
    (folder / "table.csv").write_text(table)
    done = fork1s_command(
        "run",
        scene,
        "--dt",
        1 / 120,
        "--time",
        STEPS / 120,
        "--integrator",
        integrator,
        "--controls",
        folder / "table.csv",
        "--record",
        folder / "run.h5",
    )
    assert done.returncode == 0, done.stderr
    replayed = fork1s_command("replay", folder / "run.h5")
    assert replayed.returncode == 0, replayed.stdout + replayed.stderr
    exported = fork1s_command("export", folder / "run.h5", folder / "csv", "--all-bodies")
    assert exported.returncode == 0, exported.stderr
    controls = np.loadtxt(folder / "csv/controls.csv", delimiter=",", skiprows=1)[:, 1:]
    names = (folder / "csv/poses.csv").read_text().splitlines()[0].split(",")
    columns = [
        i for i, name in enumerate(names) if name.split(".")[-1] in ("x", "y", "z", "qw", "qx", "qy", "qz")
    ]
    poses = np.loadtxt(folder / "csv/poses.csv", delimiter=",", skiprows=1, usecols=columns)
    poses = poses.reshape(STEPS, -1, 7)
    poses[..., 3:] *= np.sign(poses[..., 3:4])  # Simulation.poses has w >= 0
    return controls, poses


@pytest.mark.parametrize("start", [0.0, 0.2])
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_steps_equal_the_table(gripper, scenes, tmp_path, integrator, start):
    rows = "\n".join(
        ",".join(repr(float(v)) for v in (i / 120, *(path(i / 120) + start))) for i in range(STEPS + 1)
    )
    controls, poses = run_table(
        scenes / "fourbar_gripper.xml", tmp_path, integrator, "time,left_grip,right_grip\n" + rows + "\n"
    )
    sim = fork1s.Simulation(gripper, dt=1 / 120, integrator=integrator)
    held = fork1s.Simulation(gripper, dt=1 / 120, integrator=integrator)
    if start:
        sim.control_values = path(0) + start
        sim.start_from_controls()
    batch = fork1s.Batch(gripper, 2, dt=1 / 120, integrator=integrator)
    for k in range(STEPS):
        assert_allclose(controls[k], path((k + 1) / 120) + start, atol=1e-12)
        sim.control_values = held.control_values = controls[k]
        sim.step(move=True)
        held.step()
        batch.step(controls[k], move=True)
        assert_array_equal(sim.poses, poses[k])
        if not start:
            assert_array_equal(batch.poses()[1], poses[k])
    assert (integrator == "euler") == bool((held.poses == poses[-1]).all())


def test_a_recording_of_moving_steps_replays(gripper, tmp_path):
    sim = fork1s.Simulation(gripper, dt=1 / 60, integrator="two-stage")
    sim.controls["left_grip"] = 0.05
    sim.record(tmp_path / "run.h5")
    for k in range(12):
        sim.controls["right_grip"] = 0.02 * k
        sim.step(1 + k % 3, move=k % 4 != 1)
    sim.stop_recording()
    done = fork1s_command("replay", tmp_path / "run.h5")
    assert done.returncode == 0, done.stdout + done.stderr


def test_restored_and_reset_start_where_the_state_says(gripper):
    sim = fork1s.Simulation(gripper, integrator="two-stage")
    sim.controls["left_grip"] = 0.2
    sim.step(3, move=True)
    then = sim.save()
    hashes = []
    for _ in range(2):
        sim.restore(then)
        sim.controls["left_grip"] = 0.25
        sim.step(2, move=True)
        hashes.append(sim.hash())
        sim.controls["left_grip"] = -0.4
        sim.step()
    assert hashes[0] == hashes[1]
    batch = fork1s.Batch(gripper, 2, integrator="two-stage")
    first = None
    for _ in range(2):
        batch.step([0.2, 0.1], steps=3, move=True)
        first = batch.hashes() if first is None else first
        assert_array_equal(batch.hashes(), first)
        batch.reset()


def test_several_steps_share_the_way(gripper):
    one = fork1s.Simulation(gripper, integrator="two-stage")
    each = fork1s.Simulation(gripper, integrator="two-stage")
    one.controls["left_grip"] = 0.2
    one.step(4, move=True)
    for k in range(4):
        each.controls["left_grip"] = 0.05 * (k + 1)
        each.step(move=True)
    assert_allclose(one.qpos, each.qpos, rtol=0, atol=1e-12)  # rounding of the shares
    assert one.controls["left_grip"] == 0.2


def test_a_smooth_sine_halves_no_step():
    sim = fork1s.Simulation(fork1s.load(CART, interface="cart"), dt=1 / 60, integrator="two-stage")
    for _ in range(120):
        sim.controls["set"] = 0.05 * np.sin(8 * (sim.time + sim.dt))
        assert sim.step(move=True).halved_steps == 0


def test_refusals(gripper):
    sim = fork1s.Simulation(gripper)
    with pytest.raises(ValueError):
        sim.step(-1, move=True)
    with pytest.raises(TypeError):
        sim.step(1, True)
    assert sim.step(0, move=True).steps == 0
    with pytest.raises(ValueError, match="no coordinate of a driven base"):
        sim.controls.set_rate("left_grip", 1)
    sim.step()
    with pytest.raises(fork1s.UsageError, match="steps have been made"):
        sim.start_from_controls()
    batch = fork1s.Batch(gripper, 2)
    with pytest.raises(ValueError, match="shape"):
        batch.step(np.zeros(3), move=True)


def test_a_driven_base_with_rates_equals_the_table(scenes, tmp_path):
    model = fork1s.load(scenes / "grasp_box.xml")
    place = [0.02 * (1 - np.cos(9 * i / 120)) for i in range(STEPS + 2)]
    lift = "\n".join(f"{i / 120!r},{float(z)!r}" for i, z in enumerate(place))
    controls, poses = run_table(
        scenes / "grasp_box.xml", tmp_path, "two-stage", "time,palm.z\n" + lift + "\n"
    )
    known = fork1s.Simulation(model, dt=1 / 120, integrator="two-stage")
    estimated = fork1s.Simulation(model, dt=1 / 120, integrator="two-stage")
    for k in range(STEPS):
        known.control_values = estimated.control_values = controls[k]
        # Rows as far apart as steps are the points of a quadratic spline.
        known.controls.set_rate("palm.z", (place[k + 2] - place[k]) * 60)
        known.step(move=True)
        estimated.step(move=True)
        assert_allclose(known.poses, poses[k], rtol=0, atol=1e-9)  # the rates are rounded otherwise
    assert abs(estimated.poses - poses[-1]).max() > 1e-8  # estimated rates are off by the cube of the step
