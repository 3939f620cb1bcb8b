"""Models, simulations, snapshots and batches as pickles, and copies of them: the same bits, also in other processes."""

import copy
import multiprocessing
import pickle

import numpy as np
import pytest

import fork1s

CRANK = """<mujoco model="crank"><worldbody>
  <geom type="plane" size="1 1 1"/>
  <body name="crank" pos="0 0 .4"><joint name="turn" axis="0 1 0" stiffness=".5" damping=".01"/>
    <geom type="capsule" fromto="0 0 0 .2 0 0" size=".01" mass=".1"/>
    <body name="rod" pos=".2 0 0"><joint name="elbow" axis="0 1 0" stiffness=".2" damping=".01"/>
      <geom type="capsule" fromto="0 0 0 .2 0 -.1" size=".01" mass=".1"/></body></body>
  <body name="ball" pos=".3 0 .03"><freejoint/><geom size=".03" mass=".1"/></body>
</worldbody>
<actuator><position name="servo" joint="turn" kp="1" ctrlrange="-1 1"/></actuator>
<keyframe><key name="bent" qpos=".2 .1 .3 0 .05 1 0 0 0"/></keyframe></mujoco>"""


def again(value):
    return pickle.loads(pickle.dumps(value))


def moved(model, **options):
    """A simulation that has bent, touched and been pushed."""
    sim = fork1s.Simulation(model, **options)
    sim.control_values = sim.control_values + 0.1
    sim.step(25)
    return sim


def assert_same_steps(a, b, steps=50):
    assert a.hash() == b.hash() and a.time == b.time
    assert np.array_equal(a.poses, b.poses)
    for _ in range(steps):
        a.step(), b.step()
        assert a.hash() == b.hash()
    assert np.array_equal(a.poses, b.poses) and a.time == b.time


# What a process of its own runs: the state after `steps` more steps.
def hash_after(sim, steps):
    sim.step(steps)
    return sim.hash()


def restored_hash_after(model, snapshot, steps):
    sim = fork1s.Simulation(model)
    sim.restore(snapshot)
    return hash_after(sim, steps)


def hashes_after(batch, steps):
    batch.step(steps=steps)
    return batch.hashes()


@pytest.mark.parametrize("name", ["hand", "fourbar_gripper", "peg_gripper", "quadruped"])
@pytest.mark.parametrize("copied", [again, copy.copy, copy.deepcopy])
def test_a_simulation_goes_on_with_the_same_bits(scenes, name, copied):
    sim = moved(fork1s.load(scenes / f"{name}.xml"))
    assert_same_steps(sim, copied(sim))


@pytest.mark.parametrize(
    "options",
    [
        {"recovery": "curved"},
        {"recovery": "expanded"},
        {"recovery": "twist"},
        {"detail": "all"},
        {"integrator": "euler", "dt": 1 / 240},
        {"error": True},
    ],
)
def test_options_of_a_simulation_are_kept(gripper, options):
    sim = moved(gripper, **options)
    assert_same_steps(sim, again(sim))


def test_what_was_set_is_kept():
    sim = fork1s.Simulation(fork1s.load(CRANK), keyframe="bent")
    sim.step(10)
    sim.set_stiffness({"elbow": 0.4})
    sim.set_state(joints={"turn": 0.5})
    sim.step(3)
    sim.set_detail("all")
    sim.step(3)
    sim.controls["servo"] = 0.3
    sim.push("ball", force=[0, 0.2, 0], point=[0.3, 0, 0.04])
    copied = again(sim)
    assert copied.state_change == sim.state_change and copied.controls["servo"] == 0.3
    assert copied.actuator_forces["servo"] == pytest.approx(sim.actuator_forces["servo"], abs=0)
    assert_same_steps(sim, copied)


def test_a_frozen_grasp_is_kept(gripper):
    sim = fork1s.Simulation(gripper)
    sim.controls["left_grip"] = sim.controls["right_grip"] = 0.3
    sim.step(120)
    sim.set_detail("object")
    sim.step(5)
    assert_same_steps(sim, again(sim))


def test_a_copy_is_a_simulation_of_its_own(gripper):
    sim = moved(gripper)
    before = sim.hash()
    for other in (copy.copy(sim), copy.deepcopy(sim)):
        assert other.model is sim.model
        other.step(5)
        assert sim.hash() == before != other.hash()


def test_the_error_estimate_of_a_copy_says_that_it_began_anew(gripper):
    sim = moved(gripper, error=True)
    assert sim.error_estimate.max > 0
    copied = again(sim)
    assert any("began again" in text for text in copied.error_estimate.warnings)
    copied.step(5)
    assert copied.error_estimate.max > 0


def test_a_snapshot_is_gone_back_to_in_another_simulation(gripper):
    sim = moved(gripper)
    sim.push("cube", force=[0.1, 0, 0])
    moment = sim.save()
    for copied in (again(moment), copy.copy(moment), copy.deepcopy(moment)):
        assert repr(copied) == repr(moment)
        other = fork1s.Simulation(gripper)
        other.restore(copied)
        sim.restore(moment)
        assert_same_steps(sim, other)


def test_a_snapshot_of_other_detail_is_gone_back_to(gripper):
    sim = moved(gripper, detail="parents")
    moment = again(sim.save())
    other = fork1s.Simulation(gripper)
    other.restore(moment)
    assert_same_steps(sim, other)
    with pytest.raises(fork1s.UsageError, match="another dt"):
        fork1s.Simulation(gripper, dt=1e-3).restore(moment)


def test_batches_go_on_with_the_same_bits(gripper):
    batch = fork1s.Batch(
        gripper, 3, seeds=[5, 6, 7], randomise={"mass": (0.5, 2), "start:cube.x": (-0.001, 0.001)}
    )
    batch.step(np.full(len(batch.controls), 0.1), 20)
    batch.reset([False, True, False])
    batch.step(steps=10)
    for copied in (again(batch), copy.copy(batch), copy.deepcopy(batch)):
        assert len(copied) == 3 and copied.threads == batch.threads and copied.controls == batch.controls
        assert {k: v.tolist() for k, v in copied.factors.items()} == {
            k: v.tolist() for k, v in batch.factors.items()
        }
        twin = again(batch)
        for one in (copied, twin):
            one.step(steps=50)
        assert np.array_equal(copied.hashes(), twin.hashes())
    copied, steps = again(batch), 50
    assert np.array_equal(hashes_after(copied, steps), hashes_after(batch, steps))
    for one in (batch, copied):  # what the seeds draw next
        one.reset([True, True, False])
    assert np.array_equal(hashes_after(copied, steps), hashes_after(batch, steps))
    plain = fork1s.Batch(gripper, 2, stiffness=[1, 2], dt=1 / 120)
    plain.step(steps=5)
    assert np.array_equal(hashes_after(again(plain), steps), hashes_after(plain, steps))


def test_models_need_no_file(tmp_path, scenes):
    path = tmp_path / "moving.xml"
    path.write_text(CRANK)
    model = fork1s.load(path, stiffness_scale=2.0)
    packed = pickle.dumps(model)
    path.unlink()
    read = pickle.loads(packed)
    assert read.path == model.path and read.stiffnesses == model.stiffnesses and read.notes == model.notes
    assert read.keyframes == ["bent"] and read.holds == model.holds
    assert_same_steps(moved(model), moved(read))
    assert again(model.with_stiffness({"turn": 3.0})).stiffnesses["turn"] == 3.0
    assert again(again(model)).stiffnesses == model.stiffnesses
    # A model never changes: a copy is the model.
    assert copy.copy(model) is model and copy.deepcopy(model) is model


def test_meshes_and_height_fields_are_kept():
    text = """<mujoco><asset>
        <mesh name="wedge" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1"/>
        <hfield name="hills" nrow="3" ncol="3" size="1 1 .1 .1" elevation="0 1 0 1 0 1 0 1 0"/></asset>
      <worldbody><geom type="hfield" hfield="hills"/>
        <body name="stone" pos="0 .1 .3"><freejoint/><geom type="mesh" mesh="wedge"/></body></worldbody></mujoco>"""
    model = fork1s.load(text)
    a, b = fork1s.Simulation(model), fork1s.Simulation(again(model))
    assert_same_steps(a, b)
    assert_same_steps(a, again(a))


def test_other_processes_give_the_same_bits(hand):
    sim = moved(hand)
    moment, other = sim.save(), again(sim)
    batch = fork1s.Batch(hand, 2, seeds=[1, 2])
    batch.step(steps=10)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        found = pool.apply(hash_after, (sim, 50))
        restored = pool.apply(restored_hash_after, (hand, moment, 50))
        batched = pool.apply(hashes_after, (batch, 50))
    assert found == restored == hash_after(other, 50) == hash_after(sim, 50)
    assert np.array_equal(batched, hashes_after(batch, 50))


def test_pickles_of_another_version_are_refused(monkeypatch):
    model = fork1s.load(CRANK)
    sim = fork1s.Simulation(model)
    batch = fork1s.Batch(model, 1)
    version = fork1s.__version__.encode()
    for value, what in ((model, "Model"), (sim, "Simulation"), (sim.save(), "Snapshot"), (batch, "Batch")):
        packed = pickle.dumps(value)
        assert version in packed
        other = packed.replace(version, b"9" + version[1:])
        with pytest.raises(
            fork1s.FormatError, match=f"pickle of (Model|{what}): was made by fork1s 9.* this is fork1s .*; "
        ):
            pickle.loads(other)


def test_damaged_pickles_are_refused():
    sim = fork1s.Simulation(fork1s.load(CRANK))
    for value in (sim, sim.save(), fork1s.Batch(sim.model, 1)):
        cls, state = type(value), value.__getstate__()
        place = next(i for i, part in enumerate(state) if isinstance(part, bytes))
        for damaged in (state[place][:-1], state[place][:40], b"", bytes(len(state[place]))):
            with pytest.raises(fork1s.FormatError, match=f"pickle of {cls.__name__}: .*; make it again"):
                cls.__new__(cls).__setstate__((*state[:place], damaged, *state[place + 1 :]))
        with pytest.raises(fork1s.FormatError, match=f"pickle of {cls.__name__}: .*; make it again"):
            cls.__new__(cls).__setstate__((1, 2))


def test_moment_of_a_batch(gripper):
    batch = fork1s.Batch(gripper, 3, seeds=4)
    batch.step(steps=5)
    moment = batch.save()
    hashes = batch.hashes()
    batch.step(steps=5)
    after = batch.hashes()
    read = pickle.loads(pickle.dumps(moment))
    assert len(read) == 3 and copy.deepcopy(moment) is moment
    other = fork1s.Batch(gripper, 3, seeds=9)
    other.restore(read)
    assert (other.hashes() == hashes).all()
    other.step(steps=5)
    assert (other.hashes() == after).all()


def test_members_with_another_detail(gripper):
    sim = fork1s.Simulation(gripper, dt=1 / 60)
    sim.step(4)
    sim.set_detail(modes=1)
    sim.step(2)
    batch = fork1s.Batch(gripper, 3, dt=1 / 60)
    batch.restore(sim.save(), mask=[True, False, True])
    again = pickle.loads(pickle.dumps(batch))
    assert (again.hashes() == batch.hashes()).all()
    for b in (batch, again):
        b.step(steps=3)
    assert (again.hashes() == batch.hashes()).all()
    sim.step(3)
    assert again.hashes()[2] == sim.hash()
