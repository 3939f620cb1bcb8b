"""Functional mock-up units that `fork1s export` writes, run by FMPy, beside Python's own simulation of the same model."""

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import fork1s

fmpy = pytest.importorskip("fmpy")
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
