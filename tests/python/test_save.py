"""A moment saved and gone back to."""

import numpy as np
import pytest

import fork1s

GRIPPER = """<mujoco><worldbody>
  <geom type="plane" size="1 1 1"/>
  <body name="left" pos="0 0 .05"><joint name="l" type="slide" axis="1 0 0" stiffness="200" damping="2"/>
    <geom type="box" size=".01 .03 .03" pos="-.05 0 0" mass=".1"/></body>
  <body name="right" pos="0 0 .05"><joint name="r" type="slide" axis="1 0 0" stiffness="200" damping="2"/>
    <geom type="box" size=".01 .03 .03" pos=".05 0 0" mass=".1"/></body>
  <body name="ball" pos="0 0 .03"><freejoint/><geom size=".03" mass=".1"/></body>
</worldbody>
<actuator><position name="pl" joint="l" kp="200" ctrlrange="-.1 .1"/>
<position name="pr" joint="r" kp="200" ctrlrange="-.1 .1"/></actuator></mujoco>"""


def grip(sim):
    sim.controls["pl"], sim.controls["pr"] = 0.03, -0.03


@pytest.fixture
def model():
    return fork1s.load(GRIPPER, interface=["left", "right"])


def test_same_bits(model):
    sim = fork1s.Simulation(model)
    grip(sim)
    sim.step(40)
    sim.push("ball", force=[0, 0.2, 0])
    moment, hash_then, time_then = sim.save(), sim.hash(), sim.time
    sim.step(30)
    later, poses = sim.hash(), sim.poses
    assert later != hash_then
    for other in (sim, fork1s.Simulation(model)):
        other.controls["pl"] = -0.1
        other.restore(moment)
        assert other.hash() == hash_then and other.time == time_then
        assert other.controls["pl"] == 0.03
        other.step(30)  # the push comes back with it
        assert other.hash() == later
        assert np.array_equal(other.poses, poses)


def test_through_detail_and_state(model):
    sim = fork1s.Simulation(model)
    grip(sim)
    sim.step(20)
    moment, hash_then = sim.save(), sim.hash()
    sim.set_detail("all")
    sim.set_state(poses={"ball": [0, 0, 1]})
    sim.step(5)
    sim.restore(moment)
    assert sim.hash() == hash_then
    assert repr(moment) == "<fork1s.Snapshot after 20 steps>"


def test_of_another_model(model):
    sim = fork1s.Simulation(model)
    sim.step(3)
    before = sim.hash()
    ball = fork1s.Simulation(
        fork1s.load(
            """<mujoco model="other"><worldbody><body name="ball"><freejoint/><geom size=".1"/></body>
            </worldbody></mujoco>"""
        )
    )
    with pytest.raises(fork1s.UsageError, match="another scene"):
        sim.restore(ball.save())
    with pytest.raises(TypeError):
        sim.restore(b"bytes")
    assert sim.hash() == before


def test_of_another_dt_or_stiffness(model):
    sim = fork1s.Simulation(model, dt=1 / 60)
    sim.step(3)
    moment, before = sim.save(), sim.hash()
    other = fork1s.Simulation(model, dt=1 / 120)
    with pytest.raises(fork1s.UsageError, match="restore: the moment is of another dt, 0.0166667 s, than"):
        other.restore(moment)
    sim.set_stiffness({"l": 300})
    changed = sim.hash()
    with pytest.raises(fork1s.UsageError, match="another stiffness: joint 'l' had 400 and has 300"):
        sim.restore(moment)
    assert sim.hash() == changed
    with pytest.raises(fork1s.UsageError, match="another stiffness"):
        fork1s.Simulation(model.with_stiffness({"r": 100})).restore(moment)
    sim.set_stiffness({"l": 400})
    sim.restore(moment)
    assert sim.hash() == before
