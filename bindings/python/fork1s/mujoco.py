"""Beside MuJoCo: our step inside of its viewer, renderer, sensors and environments."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._errors import UsageError
from ._load import load
from ._mujoco_objects import needed

if TYPE_CHECKING:
    import mujoco
else:
    mujoco = needed()

Array = npt.NDArray[np.float64]


class StepperWarning(UserWarning):
    """What a model has and a Stepper leaves out, said once at construction."""


class Stepper:
    """Steps a `mujoco.MjData` in place with fork1s instead of `mujoco.mj_step`.

        stepper = fork1s.mujoco.Stepper(model, dt=1 / 60)
        while viewer.is_running():
            data.ctrl[:] = ...
            stepper.step(data)
            viewer.sync()

    Read from `data` before a step: ctrl, xfrc_applied, poses of mocap bodies; and qpos and qvel if they differ from what
    the last step wrote, which takes milliseconds, since the simulation then begins again there. Written after it: qpos,
    qvel, time, and, by `mujoco.mj_forward`, all that follows from these: poses, contacts, sensors. MuJoCo's own contact
    forces (efc_force, touch sensors) are its view of that state; `simulation.contacts` has those of the step.

    Args:
        model: what `mujoco.MjModel` has when the Stepper is made counts; later changes do not.
        dt: s; default: the model's `opt.timestep`.
        forward: False leaves out `mj_forward` and updates poses alone (`mj_kinematics`, `mj_comPos`).
        **options: as of `fork1s.load`: interface, modes, pd, ...

    Raises:
        UsageError: the model has what a Stepper cannot carry: joints that do not move here, activations of actuators.
        ModelError: and others, as `fork1s.load` and `fork1s.Simulation` do.

    Attributes:
        simulation: the `fork1s.Simulation` inside.
        report: of the last step (`StepReport`).
    """

    def __init__(
        self, model: mujoco.MjModel, *, dt: float | None = None, forward: bool = True, **options: Any
    ) -> None:
        if model.na > 0:
            raise UsageError(
                "Stepper: it does not carry activations of actuators (na > 0); simulate the model by fork1s.Simulation"
            )
        self._mj = model
        self._forward = forward
        self._model = load(model, **options)
        left_out = [note for note in self._model.notes if note.startswith("dropped")]
        if left_out:
            warnings.warn("left out: " + "; ".join(left_out), StepperWarning, stacklevel=2)
        self.simulation = _core.Simulation(self._model, dt=float(model.opt.timestep if dt is None else dt))
        self.report: _core.StepReport | None = None
        self._map_joints()
        self._map_inputs()
        self._written: tuple[Array, Array, float] | None = None

    def _name(self, kind: mujoco.mjtObj, word: str, index: int) -> str:
        # The importer names what has no name in the same way.
        return str(mujoco.mj_id2name(self._mj, kind, index) or f"{word}{index}")

    def _map_joints(self) -> None:
        mj, ours = self._mj, self.simulation.joints
        qpos: list[int] = []
        qvel: list[int] = []
        for joint in range(mj.njnt):
            name = self._name(mujoco.mjtObj.mjOBJ_JOINT, "joint", joint)
            if name not in ours:
                raise UsageError(
                    f"Stepper: joint '{name}' cannot be carried: it does not move in fork1s, where a weld or the option base "
                    "holds its body"
                )
            for numbers, address, key in ((qpos, mj.jnt_qposadr, "qpos"), (qvel, mj.jnt_dofadr, "qvel")):
                place = ours[name][key]
                numbers.extend(range(address[joint], address[joint] + place.stop - place.start))
        # Ours are in the order of the file, as MuJoCo's.
        self._qpos, self._qvel = np.array(qpos, dtype=int), np.array(qvel, dtype=int)

    def _map_inputs(self) -> None:
        mj, names = self._mj, list(self.simulation.controls)
        self._ctrl = []
        for actuator in range(mj.nu):
            name = self._name(mujoco.mjtObj.mjOBJ_ACTUATOR, "actuator", actuator)
            if name in names:
                self._ctrl.append((actuator, names.index(name)))
        self._mocap = []
        bodies = {name: i for i, name in enumerate(self.simulation.bodies)}
        for body in range(mj.nbody):
            name = self._name(mujoco.mjtObj.mjOBJ_BODY, "body", body)
            if mj.body_mocapid[body] >= 0 and f"{name}.x" in names:
                self._mocap.append((name, int(mj.body_mocapid[body]), names.index(f"{name}.x")))
        self._start = {name: self.simulation.pose(name) for name, _, _ in self._mocap}
        self._bodies = [
            (body, name)
            for body in range(1, mj.nbody)
            if (name := self._name(mujoco.mjtObj.mjOBJ_BODY, "body", body)) in bodies
        ]

    def _take_state(self, data: mujoco.MjData) -> None:
        """The simulation begins again where `data` is."""
        sim = self.simulation
        poses: dict[str, Array] = {}
        velocities = {}
        for name, mocap, _ in self._mocap:
            poses[name] = np.concatenate([data.mocap_pos[mocap], data.mocap_quat[mocap]])
            velocities[name] = np.zeros(6)
        sim.set_state(data.qpos[self._qpos], data.qvel[self._qvel], poses=poses, velocities=velocities)
        self._start = {name: sim.pose(name) for name, _, _ in self._mocap}

    def _take_inputs(self, data: mujoco.MjData, share: float) -> None:
        values = self.simulation.control_values
        for actuator, place in self._ctrl:
            values[place] = data.ctrl[actuator]
        for name, mocap, place in self._mocap:
            start = self._start[name]
            matrix = np.zeros(9)
            mujoco.mju_quat2Mat(matrix, data.mocap_quat[mocap])
            quaternion, turn = np.zeros(4), np.zeros(3)
            mujoco.mju_mat2Quat(quaternion, (matrix.reshape(3, 3) @ start[:3, :3].T).ravel())
            mujoco.mju_quat2Vel(turn, quaternion, 1)
            target = np.concatenate([data.mocap_pos[mocap] - start[:3, 3], turn])
            values[place : place + 6] += share * (target - values[place : place + 6])
        self.simulation.control_values = values
        for body, name in self._bodies:
            wrench = data.xfrc_applied[body]
            if (
                wrench.any()
            ):  # force and torque at the centre of mass, which MuJoCo knows from its last forward
                self.simulation.push(name, force=wrench[:3], torque=wrench[3:], point=data.xipos[body])

    def _write(self, data: mujoco.MjData) -> None:
        sim = self.simulation
        data.qpos[self._qpos] = sim.qpos
        data.qvel[self._qvel] = sim.qvel

    def step(self, data: mujoco.MjData, steps: int = 1) -> _core.StepReport:
        """Advances `data` by `steps` time steps of `simulation.dt`; a mocap body's way is spread over them."""
        written = self._written
        if (
            written is None
            or not np.array_equal(written[0], data.qpos)
            or not np.array_equal(written[1], data.qvel)
            or written[2] != data.time
        ):
            self._take_state(data)
        for n in range(steps if self._mocap else 1):
            self._take_inputs(data, 1 / (steps - n) if self._mocap else 1)
            self.report = self.simulation.step(1 if self._mocap else steps)
        data.time += steps * self.simulation.dt
        self._write(data)
        self._written = (data.qpos.copy(), data.qvel.copy(), data.time)
        if self._forward:
            mujoco.mj_forward(self._mj, data)
        else:
            mujoco.mj_kinematics(self._mj, data)
            mujoco.mj_comPos(self._mj, data)
        assert self.report is not None
        return self.report
