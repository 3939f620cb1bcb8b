"""Many simulations as one: the same as each alone, for any number of threads."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import fork1s


def test_every_member_is_as_alone(gripper):
    rng = np.random.default_rng(1)
    controls = rng.uniform(-0.5, 0.5, (6, 2))
    batch = fork1s.Batch(gripper, 6, dt=1 / 100)
    assert len(batch) == 6 and batch.controls == ["left_grip", "right_grip"]
    for _ in range(3):
        report = batch.step(controls, steps=10)
    assert report.finite.all() and report.contacts.shape == (6,) and report.residual.dtype == np.float64
    for i in range(6):
        sim = fork1s.Simulation(gripper, dt=1 / 100)
        sim.control_values = controls[i]
        sim.step(30)
        assert batch.hashes()[i] == sim.hash()
        assert_array_equal(batch.poses()[i], sim.poses)
        assert_array_equal(batch.velocities()[i], sim.velocities)
        assert_array_equal(batch.qpos[i], sim.qpos)
        assert_array_equal(batch.qvel[i], sim.qvel)
        assert_array_equal(batch.control_values[i], sim.control_values)
    cube = sim.bodies.index("cube")
    assert_array_equal(batch.poses("cube", "left_jaw")[:, 0], batch.poses()[:, cube])
    assert_allclose(batch.time, 0.3)


def test_threads_do_not_change_a_bit(hand):
    rng = np.random.default_rng(2)
    factors = {name: rng.uniform(0.5, 1.5, 9) for name in ("stiffness", "friction", "mass")}
    hashes = []
    for threads in (1, 2, 3, 0):
        batch = fork1s.Batch(hand, 9, threads=threads, **factors)
        batch.step(steps=40)
        hashes.append(batch.hashes())
    assert all((h == hashes[0]).all() for h in hashes)
    assert len(set(hashes[0].tolist())) == 9


def test_factors_are_those_of_a_file(scenes):
    stiff = fork1s.Batch(fork1s.load(scenes / "two_link_arm.xml", q={"elbow": 0.3}), 2, stiffness=[1, 4])
    alone = fork1s.Simulation(fork1s.load(scenes / "two_link_arm.xml", q={"elbow": 0.3}, stiffness_scale=4))
    stiff.step(steps=7)
    alone.step(7)
    assert_allclose(stiff.qpos[1], alone.qpos, rtol=1e-12)


def test_mass_weighs():
    model = fork1s.load("""<mujoco><worldbody><geom type="plane" size="1 1 1"/>
      <body name="box" pos="0 0 .05"><freejoint/><geom type="box" size=".1 .1 .05" mass="2"/></body>
      <body name="post" pos="1 0 0"><joint type="slide" axis="0 0 1" stiffness="1000" damping="200"/>
      <geom size=".01" mass="1" contype="0" conaffinity="0"/></body></worldbody></mujoco>""")
    batch = fork1s.Batch(model, 2, mass=[1, 3])
    batch.step(steps=200)
    assert_allclose(batch.qpos[:, 0], [-9.81 / 1000, -3 * 9.81 / 1000], rtol=1e-6)


def test_friction_holds_or_not():
    slope = np.deg2rad(30)
    gravity = f"{9.81 * np.sin(slope)} 0 {-9.81 * np.cos(slope)}"
    model = fork1s.load(f"""<mujoco><option gravity="{gravity}"/><worldbody>
      <geom type="plane" size="1 1 1" friction="1"/>
      <body name="box" pos="0 0 .05"><freejoint/><geom type="box" size=".1 .1 .05" mass="2" friction="1"/></body>
      </worldbody></mujoco>""")
    # tan 30 degrees = 0.577
    batch = fork1s.Batch(model, 2, friction=[0.5, 0.65])
    batch.step(steps=60)
    slid = batch.poses("box")[:, 0, 0]
    t = 1.0
    assert_allclose(slid[0], 9.81 * (np.sin(slope) - 0.5 * np.cos(slope)) * t**2 / 2, rtol=0.03)
    assert abs(slid[1]) < 1e-3


def test_reset_by_mask(gripper):
    batch = fork1s.Batch(gripper, 4)
    start = batch.hashes()
    batch.step([0.3, 0.3], steps=20)
    moved = batch.hashes()
    assert (start != moved).all()
    batch.reset([True, False, False, True])
    assert_array_equal(batch.hashes() == start, [True, False, False, True])
    assert_array_equal(batch.hashes() == moved, [False, True, True, False])
    assert_array_equal(batch.time == 0, [True, False, False, True])
    batch.reset(np.array([False, True, False, False]), mass=2.0)
    batch.step(steps=5)
    assert len(set(batch.hashes().tolist())) >= 3
    batch.reset()
    assert (batch.time == 0).all()


def test_refusals(gripper):
    batch = fork1s.Batch(gripper, 3)
    with pytest.raises(ValueError, match=r"controls must have shape \(3, 2\) or \(2,\)"):
        batch.step(np.zeros((2, 3)))
    with pytest.raises(ValueError, match="controls must be finite"):
        batch.step([np.nan, 0])
    with pytest.raises(ValueError, match="mask must be 3 numbers"):
        batch.reset([True])
    with pytest.raises(ValueError, match="mass must be finite and above 0"):
        fork1s.Batch(gripper, 2, mass=[1, 0])
    with pytest.raises(ValueError, match="one simulation or more"):
        fork1s.Batch(gripper, 0)
    with pytest.raises(fork1s.UnknownNameError, match="there is no body 'thumb'"):
        batch.poses("thumb")
