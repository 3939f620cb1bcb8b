"""Compliant mechanisms in contact, reduced to the bodies that touch the world.

    import fork1s

    model = fork1s.load(fork1s.scene("hand"))
    sim = fork1s.Simulation(model, dt=1 / 60)
    report = sim.step(60)
    print(sim.poses)

Quantities are in m, kg, s, rad, N and in the world frame unless a line says otherwise; six-vectors are angular first;
quaternions are w x y z. docs/python.md explains the package from the beginning.
"""

import collections.abc as _collections_abc
import importlib as _importlib
import typing as _typing

from ._contacts import BATCH_CONTACT, CONTACT, RECORDED_CONTACT
from ._core import (
    ActuatorForces,
    Batch,
    BatchReport,
    BodyDifference,
    BodyErrorEstimate,
    ComparedTrace,
    Comparison,
    Controls,
    Deflection,
    ErrorEstimate,
    LinearizedStep,
    LinearModel,
    Matrices,
    Mechanism,
    Model,
    PointStiffness,
    RayHit,
    RecoveryBuffers,
    Sensors,
    Simulation,
    StateSpace,
    Statics,
    StepReport,
    Stiffness,
    compare,
    mujoco_version,
    statics,
)
from ._core import version as __version__
from ._errors import (
    Error,
    FileError,
    FormatError,
    ModelError,
    NumericsError,
    SweepError,
    SweepWarning,
    UnderdeterminedError,
    UnknownNameError,
    UsageError,
)
from ._fit import StiffnessFit, fit_stiffness
from ._gradient import ParameterGradient, RunGradient, RunSwitch, parameter_gradient, run_gradient
from ._load import load, scene
from ._named import NamedValues
from ._recording import RecordedValues, Recording, read_recording
from ._show import Page, Replay, replay, show
from ._sweep import sweep

__all__ = [
    "ActuatorForces",
    "BATCH_CONTACT",
    "Batch",
    "BatchReport",
    "BodyDifference",
    "BodyErrorEstimate",
    "CONTACT",
    "ComparedTrace",
    "Comparison",
    "Controls",
    "Deflection",
    "Error",
    "ErrorEstimate",
    "FileError",
    "FormatError",
    "LinearModel",
    "LinearizedStep",
    "Matrices",
    "Mechanism",
    "Model",
    "ModelError",
    "NamedValues",
    "NumericsError",
    "Page",
    "ParameterGradient",
    "PointStiffness",
    "RECORDED_CONTACT",
    "RayHit",
    "RecordedValues",
    "Recording",
    "RecoveryBuffers",
    "Replay",
    "RunGradient",
    "RunSwitch",
    "Sensors",
    "Simulation",
    "StateSpace",
    "Statics",
    "StepReport",
    "Stiffness",
    "StiffnessFit",
    "SweepError",
    "SweepWarning",
    "UnderdeterminedError",
    "UnknownNameError",
    "UsageError",
    "__version__",
    "compare",
    "fit_stiffness",
    "load",
    "mujoco_version",
    "parameter_gradient",
    "read_recording",
    "replay",
    "run_gradient",
    "scene",
    "show",
    "statics",
    "sweep",
]

_collections_abc.Mapping.register(Controls)
_collections_abc.Mapping.register(Sensors)


def __getattr__(name: str) -> _typing.Any:
    if name == "mujoco":  # needs the package mujoco, which fork1s itself does not
        return _importlib.import_module(".mujoco", __name__)
    raise AttributeError(f"module 'fork1s' has no attribute '{name}'")
