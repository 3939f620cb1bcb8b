"""What is switched while a simulation runs: welds, and cups that hold by suction."""

import copy

import numpy as np
import pytest

import fork1s

CRANE = """
<mujoco>
  <worldbody>
    <body name="mast" pos="0 0 2">
      <joint name="swing" axis="0 1 0" stiffness="4000" damping="200"/>
      <geom type="capsule" fromto="0 0 0 1 0 0" size="0.03" mass="5" contype="0" conaffinity="0"/>
    </body>
    <body name="crate" pos="1 0 1.5"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="3"/></body>
  </worldbody>
  <equality><weld name="hook" body1="mast" body2="crate" active="false"/></equality>
</mujoco>
"""


def test_a_weld_holds_from_when_it_is_switched_on_until_it_is_off():
    sim = fork1s.Simulation(fork1s.load(CRANE), dt=1 / 60)
    assert dict(sim.controls) == {"hook": 0}
    sim.controls["hook"] = 1
    sim.step(240)
    held = sim.pose("crate")[2, 3]
    saved = sim.save()
    # 5 kg at 0.5 m and 3 kg at 1 m on 4000 N m/rad; to second order the turn of 0.0135 rad changes the arms by 0.7 %.
    assert held == pytest.approx(1.5 - (5 * 0.5 + 3 * 1) * 9.81 / 4000, abs=2e-4)
    sim.step(10)
    assert sim.pose("crate")[2, 3] == pytest.approx(held, abs=1e-5)
    sim.controls["hook"] = 0
    sim.step(12)
    assert sim.pose("crate")[2, 3] == pytest.approx(held - 0.5 * 9.81 * 0.2**2, abs=1e-4)
    sim.restore(saved)
    other = copy.copy(sim)
    for each in sim, other:
        each.step(5)
    assert sim.hash() == other.hash() and sim.pose("crate")[2, 3] == pytest.approx(held, abs=1e-5)


def starting_on(text: str) -> str:
    return text.replace(' active="false"', "")


@pytest.mark.parametrize("by_option", [False, True])
def test_a_weld_that_starts_on_is_released(by_option):
    text = starting_on(CRANE)
    if by_option:
        model = fork1s.load(text, switched="hook")
    else:
        custom = '<custom><text name="fork1s_switched" data="hook"/></custom>'
        model = fork1s.load(text.replace("<worldbody>", custom + "<worldbody>"))
    dt = 1 / 240
    sim = fork1s.Simulation(model, dt=dt)
    assert dict(sim.controls) == {"hook": 1}
    # Damping of 200 N·m·s/rad on 5.5 kg·m²: what swings falls by exp(-18 t), to 1e-4 of 14 mm in 0.5 s. The rest as above.
    sim.step(120)
    held = sim.pose("crate")[2, 3]
    assert held == pytest.approx(1.5 - (5 * 0.5 + 3 * 1) * 9.81 / 4000, abs=2e-4)
    speed = sim.velocities[sim.bodies.index("crate")][5]
    saved = sim.save()
    sim.controls["hook"] = 0
    fallen = held - np.array([sim.step(1) and sim.pose("crate")[2, 3] for _ in range(60)])
    # Both stages of a step are exact for a constant acceleration: rounding alone.
    t = dt * np.arange(1, 61)
    np.testing.assert_allclose(fallen, 0.5 * 9.81 * t**2 - speed * t, atol=1e-9)
    end = sim.hash()
    sim.restore(saved)
    assert sim.controls["hook"] == 1
    sim.controls["hook"] = 0
    sim.step(60)
    assert sim.hash() == end


def test_an_active_weld_that_is_not_named_is_no_control():
    assert dict(fork1s.Simulation(fork1s.load(starting_on(CRANE))).controls) == {}
    with pytest.raises(
        fork1s.UsageError, match="no weld and no connect is called 'hok'; near names are 'hook'"
    ):
        fork1s.load(starting_on(CRANE), switched=["hok"])
    with pytest.raises(TypeError, match="switched must be a name or a sequence of names"):
        fork1s.load(CRANE, switched=1)


def test_members_of_a_batch_switch_on_their_own():
    batch = fork1s.Batch(fork1s.load(CRANE), 2, dt=1 / 60)
    batch.step(np.array([[0.0], [1.0]]), 12)
    fallen = 1.5 - batch.poses("crate")[:, 0, 2]
    assert fallen[0] == pytest.approx(0.5 * 9.81 * 0.2**2, abs=1e-4)
    assert abs(fallen[1]) < 0.03


def test_contacts_tell_the_pull_of_a_cup():
    model = fork1s.load("""
<mujoco>
  <worldbody>
    <body name="cup" pos="0 0 0.5">
      <joint name="lift" type="slide" axis="0 0 1" stiffness="1e5" damping="500"/>
      <geom type="box" size="0.05 0.05 0.01" mass="1" gap="0.002" margin="0.002"/>
    </body>
    <body name="box" pos="0 0 0.44"><freejoint/><geom type="box" size="0.05 0.05 0.05" mass="2"/></body>
  </worldbody>
  <actuator><adhesion name="suction" body="cup" ctrlrange="0 1" gain="100"/></actuator>
</mujoco>
""")
    sim = fork1s.Simulation(model, dt=1 / 60)
    sim.controls["suction"] = 1
    sim.step(120)
    contacts = sim.contacts
    side = np.where(contacts["bodies"][:, 1] == sim.bodies.index("box"), 1, -1)[:, None]
    pull, force = (side * contacts["pull"]).sum(axis=0), (side * contacts["force"]).sum(axis=0)
    np.testing.assert_allclose(pull, [0, 0, 100], atol=1e-6)
    np.testing.assert_allclose(pull + force, [0, 0, 2 * 9.81], atol=1e-3)
    sim.controls["suction"] = 0
    sim.step(30)
    assert len(sim.contacts) == 0 and sim.pose("box")[2, 3] < 0
