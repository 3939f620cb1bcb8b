"""Functional mock-up units that `fork1s export` writes, run by FMPy, beside Python's own simulation of the same model."""

import json
import re
import subprocess
from collections.abc import Callable
from ctypes import byref, c_char, c_size_t, c_uint8, c_void_p
from pathlib import Path

import numpy as np
import pytest

import fork1s

fmpy = pytest.importorskip("fmpy")
from fmpy.fmi1 import FMICallException  # noqa: E402
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE  # noqa: E402
from fmpy.fmi3 import FMU3Slave, fmi3LogMessageCallback  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402

SCENES = Path(__file__).resolve().parents[3] / "scenes"
BUILT = Path(__file__).resolve().parents[3] / "build" / "release"
PROGRAM = BUILT / "bin" / "fork1s"
pytestmark = pytest.mark.skipif(
    not list(BUILT.glob("lib*/**/fork1s/fmu/libfork1s_fmu.so")),
    reason=f"no unit's program in {BUILT}: build the target fork1s_fmu_folder",
)
DT = 0.01


def export(model: Path, out: Path, *options: str) -> dict:
    done = subprocess.run(
        [PROGRAM, "export", model, out, "--json", *options], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(done.stdout)


class Unit:
    """An instance of a unit, in step mode unless told otherwise; its variables by name."""

    def __init__(self, path: Path, folder: Path, start: float = 0, initialize: bool = True) -> None:
        self.description = fmpy.read_model_description(path)
        fmpy.extract(path, folder)
        self.is_2 = self.description.fmiVersion == "2.0"
        self.messages: list[str] = []
        arguments = {
            "guid": self.description.guid,
            "unzipDirectory": str(folder),
            "modelIdentifier": self.description.coSimulation.modelIdentifier,
            "instanceName": "unit",
        }
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.fmu = (FMU2Slave if self.is_2 else FMU3Slave)(**arguments)
        if self.is_2:
            self.fmu.instantiate(callbacks=self._callbacks2(), loggingOn=True)
            self.fmu.setupExperiment(startTime=start)
        else:
            self.fmu.instantiate(logMessage=self._log3(), loggingOn=True)
        self.start = start
        if initialize:
            self.enter()
            self.fmu.exitInitializationMode()

    def _log3(self) -> fmi3LogMessageCallback:
        def log(_environment, _status, _category, message) -> None:
            self.messages.append(message.decode())

        self._kept = fmi3LogMessageCallback(log)
        return self._kept

    def _callbacks2(self) -> fmi2CallbackFunctions:
        def log(_environment, _name, _status, _category, message) -> None:
            self.messages.append(message.decode())

        self._kept = fmi2CallbackFunctions()
        self._kept.logger = fmi2CallbackLoggerTYPE(log)
        return self._kept

    def enter(self) -> None:
        if self.is_2:
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(startTime=self.start)

    def get(self, *names: str) -> np.ndarray:
        references = [self.references[n] for n in names]
        return np.array(self.fmu.getReal(references) if self.is_2 else self.fmu.getFloat64(references))

    def set(self, values: dict[str, float]) -> None:
        references = [self.references[n] for n in values]
        (self.fmu.setReal if self.is_2 else self.fmu.setFloat64)(references, list(values.values()))

    def step(self, time: float, size: float) -> None:
        self.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=size)

    def numbers(self, prefix: str, count: int) -> np.ndarray:
        return self.get(*(f"{prefix}[{i}]" for i in range(1, count + 1)))

    def pose(self, body: str) -> np.ndarray:
        return np.concatenate(
            [self.numbers(f"bodies.{body}.position", 3), self.numbers(f"bodies.{body}.orientation", 4)]
        )

    def outputs(self) -> np.ndarray:
        names = [v.name for v in self.description.modelVariables if v.causality == "output"]
        return self.get(*names)

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()


@pytest.fixture(scope="module", params=["2", "3"])
def fmi(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture(scope="module")
def unit_of(tmp_path_factory: pytest.TempPathFactory, fmi: str) -> Callable[..., Unit]:
    """Makes instances of a scene's unit, each of its own copy of the archive."""
    folder = tmp_path_factory.mktemp("fmu")
    made: dict[tuple, Path] = {}
    count = 0

    def make(scene: str, *options: str, **arguments) -> Unit:
        nonlocal count
        count += 1
        key = (scene, *options)
        if key not in made:
            made[key] = folder / f"{Path(scene).stem}_{len(made)}.fmu"
            export(SCENES / scene, made[key], "--fmi", fmi, "--dt", str(DT), *options)
        return Unit(made[key], folder / f"unpacked_{count}", **arguments)

    return make


def python_of(scene: str, **load) -> fork1s.Simulation:
    return fork1s.Simulation(fork1s.load(SCENES / scene, **load), dt=DT)


def identifier(name: str) -> str:
    return name if name.isidentifier() else f"'{name}'"


@pytest.mark.parametrize("scene", ["hand.xml", "fourbar_gripper.xml", "quadruped.xml"])
def test_description_is_valid(scene: str, fmi: str, tmp_path: Path) -> None:
    out = tmp_path / "model.fmu"
    made = export(SCENES / scene, out, "--fmi", fmi)
    assert made["dt"] > 0
    assert validate_fmu(out) == []
    description = fmpy.read_model_description(out, validate=True)
    assert description.fmiVersion == ("2.0" if fmi == "2" else "3.0")
    assert description.variableNamingConvention == "structured"
    assert len([v for v in description.modelVariables if v.causality == "input"]) == made["inputs"]


@pytest.mark.parametrize(
    ("scene", "options", "load"),
    [
        ("hand.xml", ("--keyframe", "open"), {"keyframe": "open"}),
        ("fourbar_gripper.xml", (), {}),
        ("quadruped.xml", (), {}),
    ],
)
def test_motion_is_that_of_python_to_the_bit(unit_of, scene: str, options: tuple, load: dict) -> None:
    unit, sim = unit_of(scene, *options), python_of(scene, **load)
    bodies = [
        v.name.split(".")[1] for v in unit.description.modelVariables if v.name.endswith(".position[1]")
    ]
    bodies = [b for b in bodies if f"bodies.{b}.position[1]" in unit.references]
    assert bodies
    start = np.array(sim.control_values)
    names = [f"controls.{identifier(n)}" for n in sim.controls]
    for k in range(50):  # a second, two steps a communication step
        target = start + 0.02 * np.sin(0.3 * k)
        sim.control_values = target
        unit.set(dict(zip(names, target, strict=True)))
        sim.step(2)
        unit.step(2 * k * DT, 2 * DT)
        for body in bodies:
            i = sim.bodies.index(body.strip("'"))
            np.testing.assert_array_equal(unit.pose(body), sim.poses[i])
            velocity = np.concatenate(
                [
                    unit.numbers(f"bodies.{body}.angular_velocity", 3),
                    unit.numbers(f"bodies.{body}.velocity", 3),
                ]
            )
            np.testing.assert_array_equal(velocity, sim.velocities[i])
    assert unit.get("time")[0] == sim.time
    assert unit.get("dt")[0] == DT
    unit.close()


def test_switched_equalities_are_inputs_and_switch_as_in_run(tmp_path: Path, fmi: str) -> None:
    """One weld starts on and is let go, one starts off and is switched on: a load changes hands."""
    model = tmp_path / "cranes.xml"
    mast = (
        '<body name="{0}" pos="0 {1} 2"><joint axis="0 1 0" stiffness="4000" damping="200"/>'
        '<geom type="capsule" fromto="0 0 0 1 0 0" size="0.03" mass="5" contype="0" conaffinity="0"/></body>'
    )
    model.write_text(
        f"""<mujoco><custom><text name="fork1s_switched" data="first"/></custom>
        <worldbody>{mast.format("left", -0.2)}{mast.format("right", 0.2)}
        <body name="crate" pos="1 0 1.5"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="3"/></body></worldbody>
        <equality><weld name="first" body1="left" body2="crate"/>
        <weld name="second" body1="right" body2="crate" active="false"/></equality></mujoco>"""
    )
    export(model, tmp_path / "cranes.fmu", "--fmi", fmi, "--dt", str(DT))
    unit = Unit(tmp_path / "cranes.fmu", tmp_path / "unpacked")
    variables = {v.name: v for v in unit.description.modelVariables}
    for name, start in (("first", 1), ("second", 0)):
        input_of = variables[f"controls.{name}"]
        assert input_of.causality == "input"
        assert [float(x) for x in (input_of.start, input_of.min, input_of.max)] == [start, 0, 1]
    sim = fork1s.Simulation(fork1s.load(model), dt=DT)
    moved = fork1s.Simulation(fork1s.load(model), dt=DT)
    crate = sim.bodies.index("crate")
    # Held by the first for 0.2 s, by none for 0.1 s, by the second from then on.
    values = [(1, 0)] * 20 + [(0, 0)] * 10 + [(0, 1)] * 20
    heights = []
    speed, fallen = 0.0, np.empty(3)
    for k, (first, second) in enumerate(values):
        unit.set({"controls.first": first, "controls.second": second})
        unit.step(k * DT, DT)
        sim.controls["first"], sim.controls["second"] = first, second
        sim.step(1)
        np.testing.assert_array_equal(unit.pose("crate"), sim.poses[crate])
        moved.controls["first"], moved.controls["second"] = first, second
        moved.step(1, move=True)
        heights.append(unit.pose("crate")[2])
        if k == 19:
            speed = sim.velocities[crate][5]
        if k == 29:
            fallen = unit.pose("crate")[:3]
    # Steps are exact for a constant acceleration: rounding alone.
    assert heights[19] - heights[29] == pytest.approx(0.5 * 9.81 * 0.1**2 - speed * 0.1, abs=1e-12)
    # The second closes what was fallen, by exp(-t / 0.02 s).
    assert heights[-1] == pytest.approx(1.5, abs=0.02)
    table = tmp_path / "controls.csv"
    rows = ["time,first,second", "0,1,0", "0.2,1,0", "0.2001,0,0", "0.3,0,0", "0.3001,0,1"]
    table.write_text("\n".join(rows) + "\n")

    def place_in_run(time: float) -> list[float]:
        done = subprocess.run(
            [PROGRAM, "run", model, "--json", "--dt", str(DT), "--time", str(time), "--controls", table],
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        [free] = [b for b in json.loads(done.stdout)["free_bodies"] if b["body"] == "crate"]
        return free["position_m"]

    np.testing.assert_array_equal(place_in_run(0.3), fallen)
    np.testing.assert_array_equal(place_in_run(0.5), moved.poses[crate][:3])
    # Those of a table move over the step, which is cut in parts where the second stops the fall: that holds up to a step
    # later, by v h = 10 mm of the fall, of which the masts' damping leaves exp(-18/s 0.2 s) = 0.03.
    np.testing.assert_allclose(place_in_run(0.5), unit.pose("crate")[:3], atol=5e-4)
    unit.close()


def test_simulate_fmu_runs_it(fmi: str, tmp_path: Path) -> None:
    out = tmp_path / "gripper.fmu"
    export(SCENES / "fourbar_gripper.xml", out, "--fmi", fmi, "--dt", str(DT))
    result = fmpy.simulate_fmu(str(out), stop_time=0.2, output_interval=2 * DT)
    sim = python_of("fourbar_gripper.xml")
    sim.step(20)
    joint = next(iter(sim.joints))
    np.testing.assert_array_equal(
        result[f"joints.{identifier(joint)}.position"][-1], sim.qpos[sim.joints[joint]["qpos"]]
    )


def test_state_is_restored_to_the_bit_and_two_instances_are_apart(unit_of) -> None:
    unit, other = unit_of("fourbar_gripper.xml"), unit_of("fourbar_gripper.xml")
    control = next(n for n in unit.references if n.startswith("controls."))
    unit.set({control: 0.3})
    for k in range(20):
        unit.step(k * DT, DT)
    take, put, free = (
        (unit.fmu.getFMUstate, unit.fmu.setFMUstate, unit.fmu.freeFMUstate)
        if unit.is_2
        else (unit.fmu.getFMUState, unit.fmu.setFMUState, unit.fmu.freeFMUState)
    )
    state = take()

    def on() -> np.ndarray:
        rows = []
        for k in range(20, 40):
            unit.step(k * DT, DT)
            rows.append(unit.outputs())
        return np.array(rows)

    first = on()
    unit.set({control: 0})
    put(state)
    assert unit.get(control)[0] == 0.3
    np.testing.assert_array_equal(on(), first)
    free(state)
    # An instance that nothing was done to stands as it did.
    assert other.get("time")[0] == 0
    assert other.get(control)[0] != 0.3
    unit.fmu.reset()
    np.testing.assert_array_equal(unit.outputs(), other.outputs())


def serialized(unit: Unit) -> bytes:
    """The present state as bytes."""
    fmu = unit.fmu
    if unit.is_2:
        state = fmu.getFMUstate()
        data = fmu.serializeFMUstate(state)
        fmu.freeFMUstate(state)
    else:
        state = fmu.getFMUState()
        data = fmu.serializeFMUState(state)
        fmu.freeFMUState(state)
    return data


def restore(unit: Unit, data: bytes) -> None:
    """Sets the state that was serialized as `data`."""
    fmu = unit.fmu
    if unit.is_2:
        state = fmu.deSerializeFMUstate(data)
        fmu.setFMUstate(state)
        fmu.freeFMUstate(state)
    else:
        state = fmu.deserializeFMUState(data)
        fmu.setFMUState(state)
        fmu.freeFMUState(state)


@pytest.mark.parametrize(
    ("scene", "options"),
    [("hand.xml", ("--keyframe", "open")), ("fourbar_gripper.xml", ()), ("quadruped.xml", ())],
)
def test_serialized_state_continues_with_the_same_bits_in_a_fresh_instance(
    unit_of, scene: str, options: tuple
) -> None:
    unit, other = unit_of(scene, *options), unit_of(scene, *options, initialize=False)
    description = unit.description.coSimulation
    assert description.canSerializeFMUstate
    controls = [n for n in unit.references if n.startswith("controls.")]
    force = next(n for n in unit.references if n.endswith(".force[3]"))
    start = unit.get(*controls)
    for k in range(20):
        unit.set(dict(zip(controls, start + 0.02 * k, strict=True)))
        unit.step(k * DT, DT)
    # Inputs of the next step are part of the state.
    unit.set({controls[0]: start[0] + 0.3, force: 0.1})
    if unit.is_2:
        unit.fmu.setRealInputDerivatives([unit.references[controls[0]]], [1], [0.2])
    data = serialized(unit)
    assert serialized(unit) == data
    restore(other, data)
    assert serialized(other) == data
    np.testing.assert_array_equal(other.get(*unit.references), unit.get(*unit.references))
    for k in range(20, 50):
        unit.step(k * DT, DT)
        other.step(k * DT, DT)
        np.testing.assert_array_equal(other.outputs(), unit.outputs())
    assert serialized(other) == serialized(unit) != data
    unit.close()
    other.close()


def test_damaged_and_foreign_bytes_of_a_state_are_refused(unit_of) -> None:
    unit = unit_of("fourbar_gripper.xml")
    for k in range(20):
        unit.step(k * DT, DT)
    data, before = serialized(unit), unit.outputs()

    def refused(bad: bytes, sentence: str) -> None:
        count = len(unit.messages)
        with pytest.raises(FMICallException, match="error"):
            restore(unit, bad)
        assert len(unit.messages) == count + 1
        assert sentence in unit.messages[-1]

    for size in {0, 1, 20, 60, 100, 150, len(data) // 2, len(data) - 1}:
        refused(data[:size], "the bytes of the state")
    refused(data + b"0", "the bytes of the state")
    for at in range(0, len(data), 1 + len(data) // 97):
        damaged = bytearray(data)
        damaged[at] ^= 0x55
        refused(bytes(damaged), "the state")
    version = fork1s.__version__.encode()
    refused(
        data.replace(version, version[:-1] + b"x", 1),
        f"written by version {fork1s.__version__[:-1]}x of fork1s, and this is {fork1s.__version__}",
    )
    for options in (("--stiffness-scale", "2"), ("--integrator", "euler")):
        refused(serialized(unit_of("fourbar_gripper.xml", *options)), "the state is of another unit")
    refused(serialized(unit_of("quadruped.xml")), "the state is of another unit")

    state = (unit.fmu.getFMUstate if unit.is_2 else unit.fmu.getFMUState)()
    write = unit.fmu.fmi2SerializeFMUstate if unit.is_2 else unit.fmu.fmi3SerializeFMUState
    byte = c_char if unit.is_2 else c_uint8
    for size in (len(data) - 1, len(data) + 1):
        place = (byte * size)()
        with pytest.raises(FMICallException, match="error"):
            write(unit.fmu.component, state, place, size)
        assert f"has {size} bytes and needs {len(data)}" in unit.messages[-1]
        assert bytes(place) == bytes(size)
    for name, arguments in (
        ("SerializedFMUstateSize", (None, byref(c_size_t()))),
        ("SerializeFMUstate", (None, (byte * 8)(), 8)),
        ("SerializeFMUstate", (state, None, len(data))),
        ("DeSerializeFMUstate", (None, 8, byref(c_void_p()))),
        ("DeSerializeFMUstate", ((byte * len(data))(*data), len(data), None)),
    ):
        if not unit.is_2:
            name = name.replace("FMUstate", "FMUState").replace("DeS", "Des")
        with pytest.raises(FMICallException, match="error"):
            getattr(unit.fmu, ("fmi2" if unit.is_2 else "fmi3") + name)(unit.fmu.component, *arguments)
        assert "is NULL" in unit.messages[-1]
    (unit.fmu.freeFMUstate if unit.is_2 else unit.fmu.freeFMUState)(state)

    np.testing.assert_array_equal(unit.outputs(), before)
    assert serialized(unit) == data
    restore(unit, data)
    unit.step(20 * DT, DT)
    unit.close()


def test_force_at_the_centre_of_mass_gives_its_impulse(tmp_path: Path, fmi: str) -> None:
    """A free body without weight: v = F t / m and omega = T t / I, along axes of inertia."""
    model, out = tmp_path / "ball.xml", tmp_path / "ball.fmu"
    model.write_text(
        '<mujoco><option gravity="0 0 0"/><worldbody><body name="ball"><freejoint/>'
        '<inertial mass="2" pos="0.1 0 0" diaginertia="0.5 0.5 0.5"/><geom size="0.1" contype="0" conaffinity="0"/>'
        "</body></worldbody></mujoco>"
    )
    export(model, out, "--fmi", fmi, "--dt", str(DT))
    unit = Unit(out, tmp_path / "unpacked")
    unit.set({"bodies.ball.force[2]": 4.0, "bodies.ball.torque[1]": 1.0})
    unit.step(0, 10 * DT)
    turning, velocity = (
        unit.numbers("bodies.ball.angular_velocity", 3),
        unit.numbers("bodies.ball.velocity", 3),
    )
    # The origin moves as the centre does: the torque turns about the line through both. Rounding of ten steps.
    np.testing.assert_allclose(velocity, [0, 0.2, 0], atol=1e-12)
    np.testing.assert_allclose(turning, [0.2, 0, 0], atol=1e-12)


def test_input_derivatives_move_controls_as_python_does(unit_of, fmi: str) -> None:
    if fmi == "3":
        pytest.skip("FMI 3.0 has no derivatives of inputs")
    unit, sim = unit_of("fourbar_gripper.xml"), python_of("fourbar_gripper.xml")
    controls = [n for n in unit.references if n.startswith("controls.")]
    values = np.array(sim.control_values)
    rate = 0.5
    for k in range(10):
        unit.set(dict(zip(controls, values, strict=True)))
        references = [unit.references[n] for n in controls]
        unit.fmu.setRealInputDerivatives(references, [1] * len(references), [rate] * len(references))
        unit.step(4 * k * DT, 4 * DT)
        values = values + rate * (4 * DT)
        sim.control_values = values
        sim.step(4, move=True)
    body = next(n for n in unit.references if n.endswith(".position[1]") and n.startswith("bodies.")).split(
        "."
    )[1]
    np.testing.assert_array_equal(unit.pose(body), sim.poses[sim.bodies.index(body)])


def test_misuse_is_an_error_with_a_sentence(unit_of) -> None:
    unit = unit_of("fourbar_gripper.xml", initialize=False)
    output = next(n for n in unit.references if n.endswith(".position[1]"))
    control = next(n for n in unit.references if n.startswith("controls."))

    def refused(call: Callable[[], object], sentence: str) -> None:
        with pytest.raises(FMICallException, match="error"):
            call()
        assert sentence in unit.messages[-1]

    refused(lambda: unit.step(0, DT), "is not in step mode; initialize it first")
    unit.enter()
    unit.fmu.exitInitializationMode()
    before = unit.outputs()
    refused(lambda: unit.step(0, 1.5 * DT), "must be a multiple of the internal step of 0.01")
    refused(lambda: unit.step(0, 0), "must be a multiple")
    refused(lambda: unit.step(0, 2.0**31 * DT), "more than 2147483647 internal steps")
    refused(lambda: unit.step(1, DT), "the communication point is 1 s and the unit is at 0 s")
    refused(lambda: unit.set({output: 0.0}), f"'{output}' is no input and cannot be set")
    refused(lambda: unit.set({control: float("nan")}), f"'{control}' must be finite")
    unit.references["none"] = 100000
    refused(lambda: unit.get("none"), "there is no variable 100000")
    np.testing.assert_array_equal(unit.outputs(), before)
    unit.step(0, DT)
    unit.close()


def test_unsolved_step_is_undone_and_said(tmp_path: Path, fmi: str) -> None:
    model = tmp_path / "ball.xml"
    model.write_text(
        '<mujoco><worldbody><body name="ball"><freejoint/><geom size="0.1" mass="1"/></body></worldbody></mujoco>'
    )
    export(model, tmp_path / "ball.fmu", "--fmi", fmi, "--dt", str(DT))
    unit = Unit(tmp_path / "ball.fmu", tmp_path / "unpacked")
    unit.step(0, DT)
    before = unit.pose("ball")
    unit.set({"bodies.ball.force[1]": 1e308, "bodies.ball.torque[1]": 1e308})
    with pytest.raises(FMICallException, match="discard"):
        unit.step(DT, DT)
    assert "could not be solved even in its shortest parts and was undone" in unit.messages[-1]
    np.testing.assert_array_equal(unit.pose("ball"), before)
    unit.set({"bodies.ball.force[1]": 0.0, "bodies.ball.torque[1]": 0.0})
    unit.step(DT, DT)
    assert np.isfinite(unit.pose("ball")).all()
    unit.close()


def test_control_beyond_its_range_is_said_once(tmp_path: Path, fmi: str) -> None:
    model = tmp_path / "arm.xml"
    model.write_text(
        """<mujoco><worldbody><body name="arm"><joint name="j" axis="0 1 0" stiffness="1" damping="1"/>
        <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02"/></body></worldbody>
        <actuator><position name="set" joint="j" kp="10" ctrlrange="-1 1"/></actuator></mujoco>"""
    )
    export(model, tmp_path / "arm.fmu", "--fmi", fmi, "--dt", str(DT))
    ways = []
    for value in (1.0, 5.0):
        unit = Unit(tmp_path / "arm.fmu", tmp_path / f"unpacked_{value}")
        for i in range(3):
            unit.set({"controls.set": value})
            unit.step(i * DT, DT)
        assert sum("outside its range from -1 to 1" in m for m in unit.messages) == (value > 1)
        ways.append(unit.pose("arm"))
        unit.close()
    np.testing.assert_array_equal(*ways)


def test_other_resources_are_refused(fmi: str, tmp_path: Path) -> None:
    out = tmp_path / "gripper.fmu"
    export(SCENES / "fourbar_gripper.xml", out, "--fmi", fmi)
    fmpy.extract(out, tmp_path / "unpacked")
    description = fmpy.read_model_description(out)
    (tmp_path / "unpacked" / "resources" / "scene.json").write_text("{}")
    slave = (FMU2Slave if fmi == "2" else FMU3Slave)(
        guid=description.guid,
        unzipDirectory=str(tmp_path / "unpacked"),
        modelIdentifier=description.coSimulation.modelIdentifier,
    )
    with pytest.raises(Exception, match="Failed to instantiate"):
        slave.instantiate()
    slave.guid = "{other}"
    with pytest.raises(Exception, match="Failed to instantiate"):
        slave.instantiate()


def test_same_model_gives_the_same_archive(tmp_path: Path, fmi: str) -> None:
    archives = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        out = tmp_path / name / "unit.fmu"
        export(SCENES / "fourbar_gripper.xml", out, "--fmi", fmi)
        archives.append(out.read_bytes())
    assert archives[0] == archives[1]


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("unit.fmu", "--fmi", "4"), "--fmi"),
        (("unit.fmu", "--bodies", "nobody"), "--bodies"),
        (("unit.fmu", "--fps", "30"), "--fps"),
        (("model.xml", "--fmi", "2"), "belongs to the export of a model to OUT.fmu"),
    ],
)
def test_command_line_refuses(options: tuple[str, ...], sentence: str, tmp_path: Path) -> None:
    out, *rest = options
    done = subprocess.run(
        [PROGRAM, "export", SCENES / "fourbar_gripper.xml", tmp_path / out, *rest],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert sentence in done.stderr
    assert not (tmp_path / out).exists()


def test_program_of_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (SCENES.parent / "docs" / "fmi.md").read_text()
    command = re.search(r"^    fork1s export (\S+) (\S+) (.*)$", text, flags=re.MULTILINE)
    [program] = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    assert command
    export(SCENES.parent / command[1], tmp_path / command[2], *command[3].split())
    monkeypatch.chdir(tmp_path)
    exec(compile(program, "docs/fmi.md", "exec"), {})
