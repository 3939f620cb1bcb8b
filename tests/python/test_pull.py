"""Springs between a point of a body and a target in the world."""

import copy
import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import fork1s

G = 9.81
BALL = """<mujoco><worldbody>
  <body name="ball" pos="0 0 1"><freejoint/><geom size=".1" mass="2"/></body>
  <body name="other" pos="1 0 1"><freejoint/><geom size=".1" mass="1"/></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize("integrator", ["two-stage", "euler"])
@pytest.mark.parametrize("stiffness", [50, 1e4, 1e9])
def test_a_hung_ball_comes_to_rest_at_its_weight_over_the_stiffness(stiffness, integrator):
    sim = fork1s.Simulation(fork1s.load(BALL), dt=1 / 60, integrator=integrator)
    sim.pull("ball", None, [0.05, 0, 1.02], stiffness)
    highest = 0.0
    for _ in range(600):
        sim.step()
        highest = max(highest, sim.pose("ball")[2, 3])
    assert_allclose(sim.pose("ball")[:3, 3], [0.05, 0, 1.02 - 2 * G / stiffness], atol=1e-9)
    assert_allclose(sim.velocities[0], 0, atol=1e-9)
    assert highest < 1.02 + 1e-3  # critically damped
    sim.release("other")  # which is not pulled
    sim.step()
    assert_allclose(sim.velocities[0], 0, atol=1e-9)
    sim.release("ball")
    sim.step()
    assert_allclose(sim.velocities[0, 5], -G / 60, atol=1e-6)


def test_damping_is_as_given():
    sim = fork1s.Simulation(fork1s.load(BALL), dt=0.01, integrator="euler")
    sim.pull("ball", None, [0, 0, 1], 200, damping=3)
    z = v = 0.0
    for _ in range(20):
        sim.step()
        # (m + h c + h² k) v⁺ = m v - h (k z + m g)
        v = (2 * v - 0.01 * (200 * z + 2 * G)) / (2 + 0.01 * 3 + 0.01**2 * 200)
        z += 0.01 * v
    assert_allclose(sim.pose("ball")[2, 3], 1 + z, atol=1e-9)


def test_a_point_of_an_arm_is_pulled_against_its_springs(arm):
    sim = fork1s.Simulation(arm)
    point, target = sim.pose("forearm") @ [1, 0, 0, 1], np.array([1.2, 1.1, 0.5])
    sim.pull("forearm", point[:3], target, 40)
    sim.step(3000)
    tip = (sim.pose("forearm") @ [1, 0, 0, 1])[:3]
    force = 40 * (target - tip)
    assert np.linalg.norm(force) > 1
    for joint, axis in ((0, [0, 0, 0]), (1, sim.pose("forearm")[:3, 3])):
        moment = np.cross(tip - axis, force)[2]
        assert sim.joint_displacements[joint] == pytest.approx(moment / 100, rel=1e-6)
    before = tip
    sim.pull("upper_arm", None, target, 40)  # an arm has one pull: at its shoulder this one moves nothing
    sim.step(3000)
    assert_allclose(sim.joint_displacements, 0, atol=1e-6)
    assert np.linalg.norm((sim.pose("forearm") @ [1, 0, 0, 1])[:3] - before) > 0.01


def test_a_pull_holds_through_whatever_is_set(arm):
    sim = fork1s.Simulation(arm)
    target = sim.pose("forearm")[:3, 3] + [0, 0.1, 0]
    sim.pull("forearm", None, target, 40)
    sim.step(3000)
    pulled = sim.joint_displacements
    moment = sim.save()
    for change in (
        lambda: sim.set_state(qpos=[0, 0]),
        lambda: sim.set_stiffness({"shoulder": 100, "elbow": 100}),
        lambda: sim.set_detail("all"),
        lambda: (sim.set_detail("interface"), sim.release(), sim.restore(moment)),
    ):
        change()
        sim.step(3000)
        assert_allclose(sim.joint_displacements, pulled, atol=1e-6)
    copied = copy.copy(sim)
    copied.step(5), sim.step(5)
    assert copied.hash() == sim.hash()
    sim.release()
    sim.step(3000)
    assert np.abs(sim.joint_displacements).max() < 1e-6 < np.abs(pulled).max()


def test_pulls_are_recorded_and_replay_bit_by_bit(gripper, tmp_path):
    sim = fork1s.Simulation(gripper)
    sim.record(tmp_path / "run.h5")
    sim.step(2)
    sim.pull("cube", [0.012, 0, 0.012], [0.1, 0, 0.1], 20, damping=1)
    sim.pull("left_jaw", None, sim.pose("left_jaw")[:3, 3], 1e5)
    sim.step(5)
    sim.set_detail("all")
    sim.pull("cube", None, [0, 0, 0.2], 20)
    sim.step(5)
    sim.release("cube")
    sim.step(2)
    sim.release()
    sim.step(1)
    sim.stop_recording()
    springs = fork1s.read_recording(tmp_path / "run.h5").point_springs
    of_cube = springs[springs["body"] == sim.bodies.index("cube")]
    assert of_cube["step"].tolist() == list(range(2, 12))
    assert_allclose(of_cube["point"][0], [0.012, 0, 0], atol=1e-3)
    assert_allclose(of_cube["target"][0], [0.1, 0, 0.1])
    assert of_cube["stiffness"][0] == 20 and of_cube["damping"][0] == 1 < 1e3
    of_jaw = springs[springs["body"] == sim.bodies.index("left_jaw")]
    assert of_jaw["step"].tolist() == list(range(2, 14)) and (of_jaw["stiffness"] == 1e5).all()
    program = Path(fork1s.__file__).parent / "bin" / "fork1s"
    done = subprocess.run([program, "replay", tmp_path / "run.h5"], capture_output=True, text=True)
    assert done.returncode == 0 and f"{sim.hash():016x}" in done.stdout, done.stdout + done.stderr


def test_pulls_that_cannot_be_are_refused():
    sim = fork1s.Simulation(fork1s.load(BALL))
    before = sim.hash()
    for call in (lambda: sim.pull("boll", None, [0, 0, 1], 1), lambda: sim.release("boll")):
        with pytest.raises(fork1s.UnknownNameError, match="there is no body 'boll'; there are: ball, other"):
            call()
    for stiffness in (-1, 0, np.nan, np.inf):
        with pytest.raises(fork1s.UsageError, match="no finite stiffness above 0; release ends a pull"):
            sim.pull("ball", None, [0, 0, 1], stiffness)
    for damping in (-1, np.nan, np.inf):
        with pytest.raises(fork1s.UsageError, match="no finite damping of 0 or more"):
            sim.pull("ball", None, [0, 0, 1], 1, damping=damping)
    for point, target in (([0, 0], [0, 0, 1]), (None, [0, np.nan, 1]), ([np.inf, 0, 0], [0, 0, 1])):
        with pytest.raises(ValueError):
            sim.pull("ball", point, target, 1)
    with pytest.raises(TypeError, match="stiffness must be a number"):
        sim.pull("ball", None, [0, 0, 1], "stiff")
    assert sim.hash() == before
