"""Arguments that cannot be used are refused by name: what was given, what is wanted."""

import copy
import os
import pickle
import warnings
from pathlib import Path

import numpy as np
import pytest

import fork1s

ARM = """<mujoco><worldbody><body name="base"><geom size=".1" mass="1"/><body name="tip" pos="0 0 .5">
  <joint name="elbow" axis="0 1 0" stiffness="5" damping=".1"/><geom size=".1" mass="1"/></body></body></worldbody>
  <actuator><motor name="motor" joint="elbow"/></actuator></mujoco>"""
BALL = """<mujoco><worldbody><geom type="plane" size="1 1 1"/><body name="ball" pos="0 0 .1"><freejoint/>
  <geom size=".1" mass="1"/></body></worldbody></mujoco>"""
NOT_UTF8 = os.fsdecode(b"na\xffme")  # as Python holds such a name of a file


@pytest.fixture
def model():
    return fork1s.load(ARM)


@pytest.fixture
def sim(model):
    return fork1s.Simulation(model)


@pytest.fixture
def batch(model):
    return fork1s.Batch(model, 2)


# How each array of numbers is given, and its shape.
ARRAYS = {
    "control_values": (1, lambda model, sim, batch, a: setattr(sim, "control_values", a)),
    "force": (3, lambda model, sim, batch, a: sim.push("tip", a)),
    "torque": (3, lambda model, sim, batch, a: sim.push("tip", torque=a)),
    "origin": (3, lambda model, sim, batch, a: sim.ray(a, [0, 0, 1])),
    "qpos": (1, lambda model, sim, batch, a: sim.set_state(a)),
    "qvel": (1, lambda model, sim, batch, a: setattr(sim, "qvel", a)),
    "point": (3, lambda model, sim, batch, a: sim.jacobian("tip", a)),
    "base_pose": (3, lambda model, sim, batch, a: fork1s.load(ARM, base_pose=a)),
    "gravity": (3, lambda model, sim, batch, a: fork1s.statics(model, "tip", gravity=a)),
    "stiffness": (2, lambda model, sim, batch, a: fork1s.Batch(model, 2, stiffness=a)),
    "mask": (2, lambda model, sim, batch, a: batch.reset(a)),
    "controls": ((2, 1), lambda model, sim, batch, a: batch.step(a)),
    r"controls\['motor'\]": (
        2,
        lambda model, sim, batch, a: fork1s.compare(model, time=0.1, controls={"motor": a, "time": [0, 1]}),
    ),
}


@pytest.mark.parametrize("argument", ARRAYS)
@pytest.mark.parametrize(
    "kind, error, message",
    [
        ("complex", TypeError, "must be an array of real numbers, not an array of type complex128"),
        ("datetime64[s]", TypeError, "not an array of type datetime64"),
        ("U8", TypeError, "not an array of type <U8"),
        ("masked", ValueError, "has masked entries; fill them first"),
    ],
)
def test_arrays_that_are_no_real_numbers(model, sim, batch, argument, kind, error, message):
    shape, give = ARRAYS[argument]
    array = np.ma.masked_all(shape) if kind == "masked" else np.zeros(shape, dtype=kind)
    with pytest.raises(error, match=f"^{argument} .*{message}"):
        give(model, sim, batch, array)


def test_a_masked_array_without_masked_entries_is_an_array(sim):
    sim.control_values = np.ma.array([0.5], mask=[False])
    assert sim.control_values[0] == 0.5


WHOLE = {
    "modes": [
        lambda model, sim, batch, n: fork1s.load(ARM, modes=n),
        lambda model, sim, batch, n: sim.set_detail(modes=n),
    ],
    "steps": [lambda model, sim, batch, n: sim.step(n), lambda model, sim, batch, n: batch.step(steps=n)],
    "count": [lambda model, sim, batch, n: fork1s.Batch(model, n)],
    "threads": [lambda model, sim, batch, n: fork1s.Batch(model, 2, threads=n)],
    "refinements": [lambda model, sim, batch, n: fork1s.compare(model, time=0.1, refinements=n)],
    "port": [lambda model, sim, batch, n: fork1s.show(sim, port=n)],
}


@pytest.mark.parametrize("argument", WHOLE)
@pytest.mark.parametrize("number", [-1, 2**31, 2**100, -(2**100)])
def test_whole_numbers_out_of_range(model, sim, batch, argument, number):
    for give in WHOLE[argument]:
        with pytest.raises(
            fork1s.UsageError, match=f"^{argument}: must be a whole number from [01] to .*, not {number}$"
        ):
            give(model, sim, batch, number)


@pytest.mark.parametrize("argument", WHOLE)
@pytest.mark.parametrize("given", [1.5, "two", 1j])
def test_what_is_no_whole_number(model, sim, batch, argument, given):
    for give in WHOLE[argument]:
        with pytest.raises(TypeError, match=f"^{argument} must be a whole number, not "):
            give(model, sim, batch, given)


@pytest.mark.parametrize(
    "option, given, message",
    [
        ("interface", [1], "interface must be a name or a sequence of names"),
        ("base", 3, "base must be text, not 3"),
        ("stiffness_scale", "much", "stiffness_scale must be a number, not 'much'"),
        ("pd", (1, 2, 3), "pd must be two numbers"),
        ("pd", {"elbow": "x"}, "pd must be two numbers"),
        ("q", {"elbow": 1j}, "q must be a mapping from joint names to numbers"),
        ("ground", "low", "ground must be True, False or a height"),
        ("interface", 3, "interface must be a name or a sequence of names, not 3"),
        ("q", 3, "q must be a mapping, not 3"),
        ("packages", [1], r"packages must be a mapping, not \[1\]"),
        ("in_process", "yes", "in_process must be True or False, not 'yes'"),
    ],
)
def test_options_of_load_of_another_type(option, given, message):
    with pytest.raises(TypeError, match=message):
        fork1s.load(ARM, **{option: given})


def test_names_that_are_not_utf8_are_unknown(model, sim, batch):
    for error, reach in [
        (fork1s.UnknownNameError, lambda: sim.pose(NOT_UTF8)),
        (fork1s.UnknownNameError, lambda: sim.push(NOT_UTF8)),
        (fork1s.UnknownNameError, lambda: sim.controls[NOT_UTF8]),
        (fork1s.UnknownNameError, lambda: sim.controls.update({NOT_UTF8: 1})),
        (fork1s.UnknownNameError, lambda: sim.set_stiffness({NOT_UTF8: 1})),
        (fork1s.UnknownNameError, lambda: sim.set_state(poses={NOT_UTF8: [0, 0, 0]})),
        (fork1s.UnknownNameError, lambda: batch.poses(NOT_UTF8)),
        (fork1s.UnknownNameError, lambda: model.compliance(NOT_UTF8)),
        (fork1s.UnknownNameError, lambda: fork1s.Simulation(model, keyframe=NOT_UTF8)),
        (fork1s.UsageError, lambda: fork1s.load(ARM, interface=NOT_UTF8)),
        (fork1s.UsageError, lambda: fork1s.load(ARM, q={NOT_UTF8: 1})),
        (fork1s.UsageError, lambda: fork1s.Batch(model, 2, seeds=1, randomise={NOT_UTF8: (1, 2)})),
        (fork1s.ModelError, lambda: fork1s.statics(model, NOT_UTF8)),
    ]:
        with pytest.raises(error, match=NOT_UTF8):
            reach()
    assert NOT_UTF8 not in sim.controls and 3 not in sim.controls


def test_files_whose_names_are_not_utf8(tmp_path):
    path = tmp_path / f"{NOT_UTF8}.xml"
    path.write_text(ARM)
    model = fork1s.load(path)
    assert model.path == str(path)
    sim = fork1s.Simulation(model)
    recording = tmp_path / f"{NOT_UTF8}.h5"
    sim.record(recording)
    sim.step(3)
    sim.stop_recording()
    assert recording.exists()
    with pytest.raises(fork1s.FileError, match=NOT_UTF8):
        fork1s.load(tmp_path / f"{NOT_UTF8}_gone.xml")


def test_what_no_file_can_be_called(sim, tmp_path):
    with pytest.raises(ValueError, match="path must not hold a null character"):
        sim.record(f"{tmp_path}/a\0b.h5")
    for given in (3, None):
        with pytest.raises(TypeError, match=f"path must be a path, not {given}"):
            sim.record(given)


@pytest.mark.parametrize("time", [float("inf"), 1e300])
def test_a_comparison_of_more_steps_than_can_be_counted(model, time):
    with pytest.raises(fork1s.UsageError, match="time: is more steps than can be counted"):
        fork1s.compare(model, time=time)


@pytest.mark.parametrize("force", [1e200, 1e308])
def test_a_step_under_a_force_beyond_all_bounds_leaves_a_finite_state(sim, force):
    ball = fork1s.Simulation(fork1s.load(BALL))
    for s, body in ((sim, "tip"), (ball, "ball")):
        for wrench in (
            {"force": [force, force, force]},
            {"torque": [force, force, force]},
            {"force": [1, 1, 1], "point": [force] * 3},
        ):
            moment = s.save()
            s.push(body, **wrench)
            s.step(3)
            assert np.isfinite(s.poses).all() and np.isfinite(s.velocities).all()
            s.restore(moment)
    assert sim.step().finite


@pytest.mark.parametrize(
    "make", [fork1s.Simulation, lambda model: fork1s.Batch(model, 2)], ids=["Simulation", "Batch"]
)
def test_a_file_in_place_of_a_model_is_refused_with_the_call_that_reads_it(make):
    for file in ("robot.xml", Path("robot.xml")):
        with pytest.raises(TypeError) as told:
            make(file)
        assert str(told.value) == f"model must be a fork1s.Model, not {file!r}; pass fork1s.load({file!r})"
    with pytest.raises(TypeError, match=r"not a value of type str; pass fork1s.load\(\.\.\.\)"):
        make("<mujoco>" + 100 * " " + "</mujoco>")
    for other in (3, 1.5):
        with pytest.raises(TypeError, match=f"model must be a fork1s.Model, not {other}$"):
            make(other)


def test_what_is_read_prints_its_values(gripper):
    sim = fork1s.Simulation(gripper)
    sim.controls["left_grip"] = 0.3
    sim.step(20)
    forces = sim.actuator_forces
    values = [f"{name}={forces[name]:.4g}" for name in sim.controls]
    assert repr(forces) == f"<fork1s.ActuatorForces {' '.join(values)}>"
    assert isinstance(forces, fork1s.ActuatorForces) and isinstance(forces, fork1s.Sensors)
    report = fork1s.Batch(gripper, 3).step(steps=2)
    assert repr(report) == f"<fork1s.BatchReport of 3 contacts={report.contacts.sum()} unconverged=0>"


def test_joint_displacements_go_by_name_and_by_place(gripper):
    sim = fork1s.Simulation(gripper)
    sim.controls["left_grip"] = 0.3
    sim.step(20)
    for values in (sim.joint_displacements, sim.joint_rates):
        assert [values[name] for name in sim.coordinates] == values.tolist() == list(values)
        assert float(values["left_crank"]) != 0
        with pytest.raises(fork1s.UnknownNameError, match="no joint coordinate 'crank'; there are: "):
            values["crank"]
        for plain in (2 * values, values[1:], values - values, np.sin(values), np.asarray(values)):
            assert type(plain) is np.ndarray
        assert type(values.sum()) is np.float64 and values[values > 0].size < values.size
        copied = values.copy()
        copied[:] = 0
        assert copied["left_crank"] == 0 != values["left_crank"]
        for same in (pickle.loads(pickle.dumps(values)), copy.copy(values), copy.deepcopy(values)):
            assert [same[name] for name in sim.coordinates] == values.tolist()
        # Names do not stay where the places change.
        for moved in (
            np.sort(values),
            np.partition(values, 1),
            np.roll(values, 1),
            values.take(range(len(values))[::-1]),
            values[::-1],
        ):
            with pytest.raises((IndexError, fork1s.UnknownNameError)):
                moved["left_crank"]


def test_long_steps_warn(gripper):
    with pytest.warns(UserWarning, match=r"^dt is 10 s: motion that is quicker"):
        fork1s.Simulation(gripper, dt=10)
    with pytest.warns(UserWarning, match="dt is 0.6 s"):
        fork1s.Batch(gripper, 2, dt=0.6)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fork1s.Simulation(gripper, dt=0.5)
