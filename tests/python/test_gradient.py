"""Gradients of runs: the matrices of the scheme, differences of whole runs, limits, refusals."""

import copy
import signal
import threading
import time

import numpy as np
import pytest

import fork1s

SPRING = """
<mujoco>
  <option gravity="0 0 0" timestep="0.02"/>
  <worldbody>
    <body name="mass">
      <joint name="x" type="slide" axis="1 0 0" stiffness="50" damping="0.4"/>
      <geom name="mass" type="sphere" size="0.1" mass="2"/>
    </body>
  </worldbody>
  <actuator><motor name="push" joint="x" gear="3" ctrllimited="true" ctrlrange="-1 1"/></actuator>
</mujoco>
"""
GAMMA = 1 - np.sqrt(0.5)


def scheme(stiffness=50.0, mass=2.0, dt=0.02):
    """x' of (x, v) by two stages for the force at the end of the first and of the second stage, per unit of push."""
    damping = 0.4 * np.sqrt(stiffness / 50)  # the ratio stays
    J = np.array([[0, 1], [-stiffness / mass, -damping / mass]])
    b = np.array([0, 3 / mass])
    stage = np.linalg.inv(np.eye(2) - GAMMA * dt * J)
    A = stage @ stage @ (np.eye(2) + (1 - 2 * GAMMA) * dt * J)
    k1 = stage @ b
    k2 = stage @ ((1 - GAMMA) * dt * J @ k1)
    return A, dt * ((1 - GAMMA) * k1 + GAMMA * k2), dt * GAMMA * stage @ b


def rollout(rows, move, **parameters):
    A, first, second = scheme(**parameters)
    x, last, value = np.array([0.0, 0.0]), 0.0, 0.0
    for u in rows:
        at_first = last + GAMMA * (u - last) if move else u
        x = A @ x + first * at_first + second * u
        value += x[0] ** 2
        last = u
    return value


def squared(sim):
    return sim.joint_displacements[0] ** 2


def spring():
    return fork1s.Simulation(fork1s.load(SPRING), dt=0.02)


@pytest.mark.parametrize("move", [False, True])
@pytest.mark.parametrize("threads", [1, 3])
def test_of_a_spring_is_that_of_the_scheme(move, threads):
    rows = 0.8 * np.sin(0.3 * np.arange(25))
    sim = spring()
    before = sim.hash()
    found = fork1s.run_gradient(sim, squared, {"push": rows}, move=move, threads=threads)
    assert sim.hash() == before
    assert found.inputs == ["push"] and found.coordinates == ["x"] and found.switches == []
    # Each step to 1e-6 of its motion.
    assert found.value == pytest.approx(rollout(rows, move), rel=1e-5)
    expected = [
        (rollout(rows + 1e-3 * one, move) - rollout(rows - 1e-3 * one, move)) / 2e-3 for one in np.eye(25)
    ]
    np.testing.assert_allclose(found.controls[:, 0], expected, atol=1e-5 * np.abs(expected).max())
    assert found.difference < 1e-5
    # By the first position and speed, of which positions are linear.
    A = scheme()[0]
    power, by_start = np.eye(2), np.zeros(2)
    x, last = np.zeros(2), 0.0
    _, first, second = scheme()
    for u in rows:
        x = A @ x + first * (last + GAMMA * (u - last) if move else u) + second * u
        power, last = A @ power, u
        by_start += 2 * x[0] * power[0]
    # To one side a square bends by the change itself, 1e-7 of a length.
    np.testing.assert_allclose(found.start, by_start, atol=1e-5 * np.abs(by_start).max())


def test_rows_of_several_steps_and_an_array_of_all_controls():
    rows = np.array([[0.5], [-0.2], [0.7]])
    for move in (False, True):
        found = fork1s.run_gradient(spring(), squared, rows, steps=4, move=move)
        ends = (
            np.interp(np.arange(1, 13), [0, 4, 8, 12], [0, *rows[:, 0]]) if move else np.repeat(rows[:, 0], 4)
        )
        assert found.value == pytest.approx(rollout(ends, move), rel=1e-5)
        assert found.controls.shape == (3, 1) and found.difference < 1e-5


def test_controls_beyond_their_limits_change_nothing():
    rows = np.array([0.5, 1.2, 0.4])
    found = fork1s.run_gradient(spring(), squared, {"push": rows})
    assert found.controls[1, 0] == 0
    assert found.value == pytest.approx(rollout(np.minimum(rows, 1), False), rel=1e-5)
    assert found.controls[0, 0] > 0 and found.controls[2, 0] > 0


def test_through_a_grip_is_the_difference_of_runs():
    sim = fork1s.Simulation(fork1s.load(fork1s.scene("fourbar_gripper")), dt=1 / 60)
    sim.controls.update({"left_grip": 0.35, "right_grip": 0.35})
    sim.step(60)
    assert len(sim.contacts) > 0

    def lifted(at):
        return at.pose("cube")[2, 3] + 1e-3 * at.contacts["force"][:, 0].sum() ** 2

    rows = {"left_grip": 0.35 + 0.02 * np.sin(np.arange(8)), "right_grip": np.full(8, 0.36)}
    found = fork1s.run_gradient(sim, lifted, rows, inputs=["right_grip"])
    assert found.inputs == ["right_grip"] and found.switches == []
    assert found.difference < 1e-4
    other = copy.deepcopy(sim)
    other.newton_tolerance = 1e-15
    there = other.save()
    for row in (0, 5):
        values = []
        for change in (1e-5, -1e-5):
            other.restore(there)
            value = 0.0
            for k in range(8):
                right = rows["right_grip"][k] + (change if k == row else 0)
                other.controls.update({"left_grip": rows["left_grip"][k], "right_grip": right})
                other.step()
                value += lifted(other)
            values.append(value)
        expected = (values[0] - values[1]) / 2e-5
        assert found.controls[row, 0] == pytest.approx(expected, rel=1e-4)


DRAGGED = """
<mujoco>
  <option timestep="0.0166666667"/>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 0.1" friction="0.6"/>
    <body name="block" pos="0 0 0.05">
      <freejoint/>
      <geom name="block" type="box" size="0.05 0.05 0.05" mass="1" friction="0.6"/>
    </body>
    <body name="arm" pos="-0.2 0 0.05">
      <joint name="feed" type="slide" axis="1 0 0" damping="20" frictionloss="2"/>
      <geom name="arm" type="capsule" fromto="0 0 0 0.13 0 0" size="0.015" mass="0.4" friction="0.4"/>
      <body name="stick" pos="0 0.1 0">
        <joint name="stick" axis="0 0 1" damping="0.01" stiffness="0.3" frictionloss="0.05"/>
        <geom type="sphere" pos="0.05 0 0" size="0.02" mass="0.1" contype="0" conaffinity="0"/>
      </body>
    </body>
  </worldbody>
  <actuator><position name="feed" joint="feed" kp="800"/></actuator>
</mujoco>
"""


def test_through_friction_that_sticks_and_slides():
    # The arm meets the block, drags it over the floor and stops; both frictions remember their forces.
    sim = fork1s.Simulation(fork1s.load(DRAGGED), dt=1 / 60)
    rows = 0.12 * np.minimum(1, np.arange(1, 31) / 20)

    def place(at):
        return at.pose("block")[0, 3] + 0.1 * at.qvel[-1]

    found = fork1s.run_gradient(sim, place, {"feed": rows}, move=True)
    assert sim.pose("block")[0, 3] == 0
    assert np.abs(found.controls[:20]).max() > 0.1
    # Where it meets the block derivatives differ by side, in no more than a hundredth of what the steps before tell.
    assert found.difference < (0.01 if found.switches else 1e-5)
    sim.controls["feed"] = 0.12
    sim.step(40)
    assert sim.pose("block")[0, 3] > 0.03
    found = fork1s.run_gradient(sim, place, {"feed": np.full(20, 0.12)})
    assert found.switches == [] and found.difference < 1e-5


def test_of_a_walker_that_stands_on_its_feet():
    sim = fork1s.Simulation(fork1s.load(fork1s.scene("quadruped")), dt=1 / 60)
    sim.step(60)
    assert len(sim.contacts) >= 3
    rows = np.repeat(sim.control_values[None], 12, axis=0)
    found = fork1s.run_gradient(sim, lambda at: at.pose(at.bodies[0])[2, 3], rows)
    assert found.switches == [] and found.difference < 1e-5
    assert np.abs(found.controls).max() > 1e-3

    # By a chain of its own: the same with the forces that friction remembers, and wrong without.
    def chained(friction_forces):
        copied, moments = copy.deepcopy(sim), []
        for row in rows:
            moments.append(copied.save())
            copied.control_values = row
            copied.step()
        moments.append(copied.save())
        costate, by = 0.0, np.zeros_like(rows)
        for k in reversed(range(len(rows))):
            copied.restore(moments[k])
            copied.control_values = rows[k]
            step = copied.linearize(
                end=moments[k + 1],
                friction_forces=friction_forces,
                start_controls=True,
                outcome=lambda at: at.pose(at.bodies[0])[2, 3],
            )
            costate = np.zeros(len(step.A)) if k == len(rows) - 1 else costate
            by[k] += step.outcome_B[0] + costate @ step.B
            by[k - 1] += (k > 0) * (step.outcome_B_start[0] + costate @ step.B_start)
            costate = step.outcome_A[0] + costate @ step.A
        return by

    scale = np.abs(found.controls).max()
    np.testing.assert_allclose(chained(True), found.controls, atol=1e-7 * scale)
    assert np.abs(chained(False) - found.controls).max() > 1e-4 * scale


def test_by_parameters_of_the_model():
    rows = 0.8 * np.sin(0.3 * np.arange(25))

    def metric(model, point):
        sim = fork1s.Simulation(model, dt=0.02)
        sim.newton_tolerance = 1e-15
        value = 0.0
        for u in rows:
            sim.controls["push"] = u
            sim.step()
            value += squared(sim)
        return value

    found = fork1s.parameter_gradient(SPRING, metric, {"geom:mass.mass": 2.0, "stiffness:x": 50.0})
    assert found.value == pytest.approx(rollout(rows, False), rel=1e-9) and found.bends == {}
    for name, argument, at in (("geom:mass.mass", "mass", 2.0), ("stiffness:x", "stiffness", 50.0)):
        change = 1e-4 * at
        sides = [rollout(rows, False, **{argument: at + side * change}) for side in (1, -1)]
        assert found.by[name] == pytest.approx((sides[0] - sides[1]) / (2 * change), rel=1e-5)
    table = fork1s.parameter_gradient(
        SPRING, lambda model, point: [2 * point["a"], point["a"] * point["b"]], {"a": 3, "b": 5}
    )
    np.testing.assert_allclose(table.jacobian(), [[2, 0], [5, 3]], rtol=1e-9)
    beside = fork1s.parameter_gradient(
        SPRING, lambda model, point: [1e3 * point["a"], abs(point["a"] - 3)], {"a": 3.0}
    )
    assert beside.bends["a"] > 1
    bent = fork1s.parameter_gradient(SPRING, lambda model, point: abs(point["a"] - 3), {"a": 3.0})
    assert bent.bends["a"] > 1 and bent.value == 0
    with pytest.raises(fork1s.UsageError, match="shape"):
        fork1s.parameter_gradient(SPRING, lambda model, point: np.zeros(1 if point["a"] > 3 else 2), {"a": 3})
    with pytest.raises(fork1s.UsageError, match="finite"):
        fork1s.parameter_gradient(SPRING, lambda model, point: np.inf, {"a": 3})


def test_tolerance_stays_with_the_simulation():
    sim = spring()
    assert sim.newton_tolerance == 1e-6
    sim.newton_tolerance = 1e-12
    sim.set_state(joints={"x": 0.01})
    sim.set_stiffness({"x": 60})
    assert copy.deepcopy(sim).newton_tolerance == 1e-12
    with pytest.raises(fork1s.UsageError, match="newton_tolerance"):
        sim.newton_tolerance = 0


def by_differences(sim, cost, rows, name, row, change=1e-5):
    other = copy.deepcopy(sim)
    other.newton_tolerance = 1e-15
    there = other.save()
    values = []
    for by in (change, -change):
        other.restore(there)
        value = 0.0
        for k, u in enumerate(rows):
            other.controls[name] = u + (by if k == row else 0)
            other.step()
            value += cost(other)
        values.append(value)
    return (values[0] - values[1]) / (2 * change)


SERVO = """
<mujoco>
  <worldbody>
    <body><joint name="hinge" damping="0.02" armature="1e-6"/><geom size="0.01" pos="0.02 0 0" mass="0.01"/></body>
  </worldbody>
  <actuator><position name="servo" joint="hinge" kp="5"/></actuator>
</mujoco>
"""


def test_of_a_stiff_servo_whose_held_set_point_jumps():
    # The first stage takes a share of the jump, which depends on where the set-point was before.
    sim = fork1s.Simulation(fork1s.load(SERVO), dt=1 / 60)
    rows = [0.3, 0.1, 0.1, 0.4, 0.2, 0.2]

    def angle(at):
        return at.qpos[0]

    found = fork1s.run_gradient(sim, angle, {"servo": rows})
    assert found.difference < 1e-5
    for row in (0, 2):
        assert found.controls[row, 0] == pytest.approx(
            by_differences(sim, angle, rows, "servo", row), rel=1e-5
        )


def test_of_loops_that_a_run_leaves_open_by_its_tolerance(scenes):
    sim = fork1s.Simulation(fork1s.load(scenes / "vehicle.xml"), dt=1 / 60)
    sim.step(30)
    name = next(iter(sim.controls))
    rows = [sim.controls[name] + 0.02 * (-1) ** k for k in range(6)]

    def moved(at):
        return float(at.poses[:, :3].sum()) + 0.01 * float(at.qvel @ at.qvel)

    found = fork1s.run_gradient(sim, moved, {name: rows})
    assert found.switches == [] and found.difference < 1e-4
    assert found.controls[1, 0] == pytest.approx(by_differences(sim, moved, rows, name, 1), rel=1e-4)


def test_a_recording_keeps_its_tolerance(tmp_path):
    sim = spring()
    sim.record(tmp_path / "run.h5")
    sim.step()
    with pytest.raises(fork1s.UsageError, match="newton_tolerance: a recording goes on"):
        sim.newton_tolerance = 1e-15
    # Copies do not record: the steps of a gradient are none of the recording.
    fork1s.run_gradient(sim, squared, {"push": [0.1, 0.2]})
    sim.stop_recording()
    sim.newton_tolerance = 1e-15


def test_pushes_are_left_out():
    sim = spring()
    alone = fork1s.run_gradient(sim, squared, {"push": [0.1, 0.2]})
    sim.push("mass", force=[50, 0, 0])
    pushed = fork1s.run_gradient(sim, squared, {"push": [0.1, 0.2]})
    assert pushed.value == alone.value
    np.testing.assert_array_equal(pushed.controls, alone.controls)
    sim.step()
    assert sim.qpos[0] > 1e-3  # and wait for the next step


def test_at_a_limit_it_is_that_inwards():
    found = fork1s.run_gradient(spring(), squared, {"push": [0.5, 1.0, -1.0, 0.3]})
    assert (found.controls[:, 0] != 0).all() and found.difference < 1e-5
    assert np.isnan(fork1s.run_gradient(spring(), squared, {"push": [1.0, -1.0]}).difference)
    np.testing.assert_array_equal(spring().control_limits, [[-1, 1]])


def test_of_nothing_is_nothing_and_says_so():
    found = fork1s.run_gradient(spring(), lambda at: 3.0, {"push": [0.5, 0.4]})
    assert found.value == 6 and (found.controls == 0).all() and found.difference == 0


WELD = """
<mujoco>
  <worldbody>
    <body name="hook"><joint name="lift" type="slide" axis="0 0 1"/><geom size="0.02" mass="1"/></body>
    <body name="load" pos="0 0 -0.1"><freejoint/><geom size="0.02" mass="0.1"/></body>
  </worldbody>
  <equality><weld name="grab" body1="hook" body2="load" active="false"/></equality>
  <actuator><motor name="lift" joint="lift"/></actuator>
</mujoco>
"""


def test_switches_are_no_inputs():
    sim = fork1s.Simulation(fork1s.load(WELD), dt=1 / 60)
    assert [sim.controls.kind(name) for name in ("lift", "grab")] == ["actuator", "switch"]
    rows = {"lift": [10.0, 11.0], "grab": [0, 1]}
    with pytest.raises(fork1s.UsageError, match="'grab' is a switch"):
        fork1s.run_gradient(sim, lambda at: at.qpos[0], rows)
    assert fork1s.run_gradient(sim, lambda at: at.qpos[0], rows, inputs=["lift"]).difference < 1e-4


def test_an_interrupt_ends_all_threads(scenes):
    sim = fork1s.Simulation(fork1s.load(scenes / "hand.xml"), dt=1 / 60)
    names = [name for name in sim.controls if sim.controls.kind(name) == "actuator"]
    rows = {name: np.zeros(2000) for name in names}
    timer = threading.Timer(1.0, signal.raise_signal, [signal.SIGINT])
    timer.start()
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        fork1s.run_gradient(sim, lambda at: 0.0, rows)
    # All of it takes over ten seconds; a step's share is hundredths.
    assert time.monotonic() - began < 5


def test_what_is_wrong_is_told_and_changes_nothing():
    sim = spring()
    before = sim.hash()
    rows = {"push": [0.1, 0.2]}
    with pytest.raises(fork1s.UnknownNameError, match="'pull'"):
        fork1s.run_gradient(sim, squared, {"pull": [0.1]})
    with pytest.raises(fork1s.UnknownNameError, match="'pull'"):
        fork1s.run_gradient(sim, squared, rows, inputs=["pull"])
    with pytest.raises(fork1s.UsageError, match=r"\(2,\)"):
        fork1s.run_gradient(sim, squared, [0.1, 0.2])
    with pytest.raises(fork1s.UsageError, match="no step"):
        fork1s.run_gradient(sim, squared, {"push": []})
    with pytest.raises(fork1s.UsageError, match="not finite"):
        fork1s.run_gradient(sim, squared, {"push": [np.nan]})
    with pytest.raises(fork1s.UsageError, match="after step [01] is nan"):
        fork1s.run_gradient(sim, lambda at: np.nan, rows)
    with pytest.raises(ZeroDivisionError):
        fork1s.run_gradient(sim, lambda at: 1 / 0, rows, threads=1)
    for wrong in (
        {"steps": 0},
        {"steps": 1.5},
        {"threads": 0},
        {"inputs": "push"},
        {"inputs": []},
        {"change": 0},
    ):
        with pytest.raises(fork1s.UsageError, match=next(iter(wrong))):
            fork1s.run_gradient(sim, squared, rows, **wrong)
    for wrong in ({"change": 0}, {"change": np.nan}):
        with pytest.raises(fork1s.UsageError, match="change"):
            fork1s.parameter_gradient(SPRING, lambda model, point: 0.0, {"a": 1.0}, **wrong)
    for point in ({}, {"a": np.nan}):
        with pytest.raises(fork1s.UsageError, match="point"):
            fork1s.parameter_gradient(SPRING, lambda model, point: 0.0, point)
    with pytest.raises(fork1s.UsageError, match="another dt"):
        sim.linearize(end=fork1s.Simulation(fork1s.load(SPRING), dt=0.01).save())
    assert sim.hash() == before and sim.newton_tolerance == 1e-6
    hand = fork1s.Simulation(fork1s.load(fork1s.scene("hand")), dt=1 / 60)
    with pytest.raises(fork1s.UsageError, match="driven base"):
        fork1s.run_gradient(hand, lambda at: 0.0, hand.control_values[None])


def test_outcome_of_a_step_is_differentiated():
    sim = spring()
    step = sim.linearize(
        outcome=lambda at: [at.joint_displacements[0], at.joint_rates[0] ** 2], move=True, start_controls=True
    )
    np.testing.assert_allclose(step.outcome_A[0], step.A[0], rtol=1e-9)
    np.testing.assert_allclose(step.outcome_B[0] + step.outcome_B_start[0], step.B[0] + step.B_start[0])
    np.testing.assert_allclose(step.outcome_A[1], 0, atol=1e-9)  # at rest
    before = sim.hash()
    with pytest.raises(ZeroDivisionError):
        sim.linearize(outcome=lambda at: 1 / 0)
    sizes = iter(range(1, 100))
    with pytest.raises(ValueError, match="as many"):
        sim.linearize(outcome=lambda at: np.zeros(next(sizes)))
    assert sim.hash() == before and sim.newton_tolerance == 1e-6
