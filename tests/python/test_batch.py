"""Many simulations as one: the same as each alone, for any number of threads."""

import copy
import subprocess
import sys

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


def test_threads_after_fewer_say_nothing(scenes):
    code = (
        "import fork1s, sys; model = fork1s.load(sys.argv[1])\n"
        "for threads in 1, 64: fork1s.Batch(model, 4, threads=threads).step(steps=2)"
    )
    path = str(scenes / "fourbar_gripper.xml")
    done = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_names_and_step_are_those_of_a_simulation(gripper):
    batch, sim = fork1s.Batch(gripper, 2, dt=0.005), fork1s.Simulation(gripper, dt=0.005)
    assert (batch.bodies, batch.coordinates, batch.dt) == (sim.bodies, sim.coordinates, sim.dt)
    assert batch.poses().shape[1] == len(batch.bodies)
    assert batch.joint_displacements.shape[1] == len(batch.coordinates)


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


def test_seeds_draw_factors(hand):
    batch = fork1s.Batch(hand, 64, seeds=7)
    factors = batch.factors
    assert set(factors) == {"stiffness", "friction", "mass"} == set(fork1s.Batch.usual_ranges)
    for name, (low, high) in fork1s.Batch.usual_ranges.items():
        assert (
            len(set(factors[name])) == 64 and (factors[name] >= low).all() and (factors[name] <= high).all()
        )
        # Of equal likelihood in the logarithm: a quarter in each quarter, by four deviations of a binomial at most.
        quarter = np.histogram(np.log(factors[name]), bins=4, range=(np.log(low), np.log(high)))[0]
        assert abs(quarter - 16).max() < 4 * np.sqrt(64 * 0.25 * 0.75)
    batch.step(steps=20)
    # The same as with these factors given by hand, and as each alone.
    by_hand = fork1s.Batch(hand, 64, **factors)
    by_hand.step(steps=20)
    assert_array_equal(batch.hashes(), by_hand.hashes())
    one = fork1s.Batch(hand, 1, seeds=batch.seeds[5:6])
    one.step(steps=20)
    assert one.hashes()[0] == batch.hashes()[5]
    # From one seed fewer members are the first of more; another seed has none in common.
    assert_array_equal(fork1s.Batch(hand, 3, seeds=7, threads=1).seeds, batch.seeds[:3])
    assert not set(fork1s.Batch(hand, 64, seeds=8).seeds) & set(batch.seeds)


def test_reset_draws_anew_and_again_the_same(gripper):
    first, second = (fork1s.Batch(gripper, 4, seeds=[1, 2, 3, 2**64 - 1]) for _ in range(2))
    began = first.factors["mass"]
    first.reset([True, False, False, True])
    again = first.factors["mass"]
    assert_array_equal(again == began, [False, True, True, False])
    # What the others do meanwhile changes nothing.
    second.reset([True, True, False, False])
    second.step(steps=3)
    second.reset([False, True, True, True])
    assert_array_equal(second.factors["mass"] == again, [True, False, False, True])
    # A seed that is given draws its first.
    first.reset(seeds=[1, 2, 3, 2**64 - 1])
    assert_array_equal(first.factors["mass"], began)
    first.reset([False, True, False, False], mass=2)
    assert first.factors["mass"][1] == 2 and first.factors["stiffness"][1] != 1
    first.reset([False, True, False, False])
    assert first.factors["mass"][1] < 1.25


def test_seeds_draw_where_it_starts(scenes):
    arm = fork1s.load(scenes / "two_link_arm.xml")
    drawn = {"start:elbow": (-0.2, 0.1), "mass": (0.5, 2)}
    batch = fork1s.Batch(arm, 40, seeds=3, randomise=drawn)
    elbow = batch.factors["start:elbow"]
    assert elbow.min() < -0.15 and elbow.max() > 0.05 and (elbow >= -0.2).all() and (elbow <= 0.1).all()
    at = arm.mechanisms[0].coordinates.index("elbow")
    assert_allclose(batch.qpos[:, at], elbow, atol=1e-15)
    assert_allclose(np.delete(batch.qpos, at, axis=1), 0, atol=1e-15)
    assert (batch.factors["stiffness"] == 1).all() and (batch.factors["mass"] != 1).all()
    alone = fork1s.Simulation(fork1s.load(scenes / "two_link_arm.xml", q={"elbow": elbow[0]}))
    same = fork1s.Batch(arm, 40, seeds=3, randomise={"start:elbow": (-0.2, 0.1)})
    assert_array_equal(same.factors["start:elbow"], elbow)  # a range more or less changes no other number
    same.step(steps=30)
    alone.step(30)
    assert_allclose(same.qpos[0], alone.qpos, rtol=1e-9, atol=1e-12)


def test_bodies_start_elsewhere(gripper):
    batch = fork1s.Batch(
        gripper, 16, seeds=0, randomise={"start:cube.x": (-0.004, 0.004), "start:cube.rz": (-0.3, 0.3)}
    )
    x, turn = batch.factors["start:cube.x"], batch.factors["start:cube.rz"]
    poses = batch.poses("cube")[:, 0]
    assert_allclose(poses[:, 0], x, atol=1e-15)
    assert_allclose(2 * np.arctan2(poses[:, 6], poses[:, 3]), turn, atol=1e-12)
    batch.step([0.4, 0.4], steps=60)
    for i in range(2):
        sim = fork1s.Simulation(gripper)
        sim.set_state(poses={"cube": poses[i]})
        sim.control_values = [0.4, 0.4]
        sim.step(60)
        assert_allclose(batch.poses()[i], sim.poses, atol=1e-9)
    batch.reset()
    assert (batch.factors["start:cube.x"] != x).all()
    with pytest.raises(fork1s.UsageError, match="closed loops"):
        fork1s.Batch(gripper, 2, seeds=0, randomise={"start:left_crank": (0, 0.1)})
    with pytest.raises(fork1s.UsageError, match=r"is no coordinate; there are: .*cube.x to cube.rz"):
        fork1s.Batch(gripper, 2, seeds=0, randomise={"start:ball.x": (0, 0.1)})


def test_what_cannot_be_drawn(gripper):
    for randomise, said in (
        ({"colour": (1, 2)}, "'colour' is none of: stiffness, friction, mass, damping, "),
        ({"mass": (0, 1)}, "0 < smallest <= largest, not 0.0 and 1.0"),
        ({"start:cube.x": (1, -1)}, "smallest <= largest"),
    ):
        with pytest.raises(fork1s.UsageError, match=said):
            fork1s.Batch(gripper, 2, seeds=1, randomise=randomise)
    with pytest.raises(fork1s.UsageError, match="nothing is drawn without seeds"):
        fork1s.Batch(gripper, 2, randomise={"mass": (1, 2)})
    with pytest.raises(fork1s.UsageError, match="made without seeds"):
        fork1s.Batch(gripper, 2).reset(seeds=1)
    for seeds in (-1, 0.5, [1, 2, 3], [1, -2], "seven"):
        with pytest.raises(ValueError, match="seeds must be a whole number from 0 to 2"):
            fork1s.Batch(gripper, 2, seeds=seeds)


def test_a_reset_that_fails_leaves_all_members_as_they_were(gripper):
    batch, other = fork1s.Batch(gripper, 9, seeds=4), fork1s.Batch(gripper, 9, seeds=4)
    for b in (batch, other):
        b.step([0.3, 0.3], steps=20)
    before, factors = batch.hashes(), batch.factors
    for at in (0, 4, 8):  # members before and after it are replaced first
        mass = np.full(9, 1.5)
        mass[at] = 1e-320  # rounds to no mass
        with pytest.raises(fork1s.ModelError, match="needs mass"):
            batch.reset(mass=mass)
        assert_array_equal(batch.hashes(), before)
        for name, values in factors.items():
            assert_array_equal(batch.factors[name], values)
    for b in (batch, other):
        b.step(steps=20)
    assert_array_equal(batch.hashes(), other.hashes())


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
    with pytest.raises(ValueError, match="count: must be a whole number from 1"):
        fork1s.Batch(gripper, 0)
    with pytest.raises(fork1s.UnknownNameError, match="there is no body 'thumb'"):
        batch.poses("thumb")


def test_members_go_back_to_a_moment(hand):
    batch = fork1s.Batch(hand, 5, seeds=3)
    batch.step(steps=10)
    moment = batch.save()
    assert len(moment) == 5
    there = batch.hashes()
    batch.step(steps=5)
    later = batch.hashes()
    batch.restore(moment)
    assert_array_equal(batch.hashes(), there)
    batch.step(steps=5)
    assert_array_equal(batch.hashes(), later)
    batch.restore(moment, [0, 1, 0, 0, 1])
    assert_array_equal(batch.hashes() == there, [False, True, False, False, True])
    # Resampled: each takes another's moment with its factors.
    batch.restore(moment, members=[2, 2, 2, 0, 4])
    assert_array_equal(batch.hashes(), there[[2, 2, 2, 0, 4]])
    assert len(set(batch.factors["friction"][:3].tolist())) == 1
    batch.step(steps=5)
    assert_array_equal(batch.hashes(), later[[2, 2, 2, 0, 4]])
    # A reset draws other factors; a moment brings those of then.
    batch.reset()
    batch.restore(moment)
    batch.step(steps=5)
    assert_array_equal(batch.hashes(), later)


def test_all_start_from_the_moment_of_a_simulation(gripper):
    sim = fork1s.Simulation(gripper, dt=1 / 60)
    sim.controls["left_grip"] = 0.3
    sim.step(20)
    batch = fork1s.Batch(gripper, 3, dt=1 / 60)
    batch.restore(sim.save())
    assert (batch.hashes() == sim.hash()).all()
    rows = np.array([[0.3, 0.0], [0.1, 0.2], [0.4, 0.4]])
    batch.step(rows, steps=10)
    there = sim.save()
    for i in range(3):
        sim.restore(there)
        sim.control_values = rows[i]
        sim.step(10)
        assert batch.hashes()[i] == sim.hash()
    with pytest.raises(fork1s.UsageError, match="member 1 has factors"):
        fork1s.Batch(gripper, 2, dt=1 / 60, friction=[1, 2]).restore(there)
    with pytest.raises(fork1s.UsageError, match="dt"):
        fork1s.Batch(gripper, 2, dt=1 / 100).restore(there)
    with pytest.raises(fork1s.UsageError, match="another stiffness"):
        other = fork1s.Simulation(gripper, dt=1 / 60)
        other.set_stiffness({"left_crank": 7.0})
        batch.restore(other.save())
    with pytest.raises(fork1s.UsageError, match="3 members"):
        fork1s.Batch(gripper, 2, dt=1 / 60).restore(batch.save())
    with pytest.raises(ValueError, match="0 to 2"):
        batch.restore(batch.save(), members=[0, 1, 3])
    with pytest.raises(TypeError, match="moment"):
        batch.restore(7)


def test_states_pushes_and_contacts_of_members(gripper):
    batch = fork1s.Batch(gripper, 4, dt=1 / 60)
    qpos, qvel = batch.qpos, batch.qvel
    sim = fork1s.Simulation(gripper, dt=1 / 60)
    qvel[:, -4] = [0, 0.01, 0.02, 0.03]  # of the cube, upwards
    batch.set_state(qpos, qvel, mask=[1, 1, 0, 1])
    assert_allclose(batch.qvel[:, -4], [0, 0.01, 0, 0.03], atol=1e-12)
    sim.set_state(qpos=qpos[1], qvel=qvel[1])
    batch.step(steps=5)
    sim.step(5)
    assert batch.hashes()[1] == sim.hash()
    assert_array_equal(copy.deepcopy(batch).hashes(), batch.hashes())

    forces = np.outer([0.0, 0.1, 0.2, 0.3], [0, 0, 1])
    batch = fork1s.Batch(gripper, 4, dt=1 / 60)
    batch.step(steps=6, push={"cube": forces})
    sim = fork1s.Simulation(gripper, dt=1 / 60)
    sim.push("cube", force=forces[2])
    sim.step(6)
    assert batch.hashes()[2] == sim.hash()
    assert_array_equal(batch.poses()[2], sim.poses)
    contacts = batch.contacts
    assert contacts.dtype == fork1s.BATCH_CONTACT
    of_two = contacts[contacts["member"] == 2]
    for name in fork1s.CONTACT.names:
        assert_array_equal(of_two[name], sim.contacts[name])
    batch.step(push={"cube": [0, 0, 0.001, 0, 0, 0.1], "left_jaw": [0, 0, 0.1]})
    with pytest.raises(fork1s.UnknownNameError, match="'cub'"):
        batch.step(push={"cub": [0, 0, 1]})
    with pytest.raises(ValueError, match="push"):
        batch.step(push={"cube": [0, 1]})


def test_moment_with_pushes_is_refused(gripper):
    sim = fork1s.Simulation(gripper, dt=1 / 60)
    sim.push("cube", force=[0.5, 0, 0])
    batch = fork1s.Batch(gripper, 2, dt=1 / 60)
    before = batch.hashes()
    with pytest.raises(fork1s.UsageError, match="pushes for the next call"):
        batch.restore(sim.save())
    assert_array_equal(batch.hashes(), before)
