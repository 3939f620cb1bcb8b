"""A gripper takes a cube, lifts it by 100 mm and shakes it: one loop, our step in it or MuJoCo's.

    python examples/stepper_cube.py          # CSV: how far the cube has slipped through the jaws, by step and step size

The gripper's mount slides on two axes with servos of 2 kN/m, so the loop is plain MuJoCo: write ctrl, step, read xpos.
"""

import csv
import sys

import mujoco
import numpy as np

import fork1s.mujoco


def gripper(timestep=1 / 60, integrator=None):
    """The scene with a mount that moves. integrator: a name as MuJoCo's files have it; None: as it is there by default."""
    spec = mujoco.MjSpec.from_file(str(fork1s.scene("fourbar_gripper")))
    for name, axis in (("side", [0, 1, 0]), ("lift", [0, 0, 1])):
        spec.body("mount").add_joint(
            name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, damping=[40, 0, 0]
        )
        servo = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_position(kp=2000)
    model = spec.compile()
    model.opt.timestep = timestep
    if integrator:
        model.opt.integrator = getattr(mujoco.mjtIntegrator, "mjINT_" + integrator.upper())
    return model


def tune(model):
    """What a user of MuJoCo's would do against slip: elliptic cones, stiff friction, stiff loops."""
    model.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    model.opt.impratio = 10
    model.eq_solref[:, 0] = 0.002
    return model


def run(model, step, seconds=6.0):
    """Closes in 0.7 s, lifts from 1 to 2 s, shakes sideways at 2 Hz from 3 to 5 s: way of the cube past the jaws [mm]
    every 1/60 s, and its height [mm]."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    ctrl = {model.actuator(i).name: i for i in range(model.nu)}
    cube, jaws = model.body("cube").id, [model.body("left_jaw").id, model.body("right_jaw").id]
    every = round(1 / 60 / model.opt.timestep)
    seen = []
    for i in range(round(60 * seconds)):
        t = i / 60
        data.ctrl[[ctrl["left_grip"], ctrl["right_grip"]]] = np.interp(t, [0, 0.7], [0, 0.45])
        data.ctrl[ctrl["lift"]] = np.interp(t, [1, 2], [0, 0.1])
        data.ctrl[ctrl["side"]] = 0.02 * np.sin(4 * np.pi * (t - 3)) if 3 <= t < 5 else 0
        for _ in range(every):
            step(data)
        seen.append(np.append(data.xpos[cube] - data.xpos[jaws].mean(axis=0), data.xpos[cube, 2]))
    seen = 1000 * np.array(seen)
    return np.linalg.norm(seen[:, :3] - seen[59, :3], axis=1), seen[:, 3]


def rows():
    for timestep in (1 / 60, 1 / 480, 1 / 1920):
        ours = gripper(timestep)
        yield "fork1s", timestep, ours, fork1s.mujoco.Stepper(ours).step
        for name, model in (
            ("MuJoCo, its default (Euler)", gripper(timestep)),
            ("MuJoCo implicitfast", gripper(timestep, "implicitfast")),
            ("MuJoCo discrete", gripper(timestep, "discrete")),
            ("MuJoCo discrete, tuned", tune(gripper(timestep, "discrete"))),
        ):
            yield name, timestep, model, lambda data, model=model: mujoco.mj_step(model, data)


def main():
    out = csv.writer(sys.stdout, lineterminator="\n")
    out.writerow(
        ["step", "dt_s", "slipped_2s_mm", "slipped_3s_mm", "slipped_6s_mm", "height_6s_mm", "dropped_s"]
    )
    for name, timestep, model, step in rows():
        slipped, height = run(model, step)
        fallen = np.flatnonzero((height < 20) & (np.arange(len(height)) > 120))
        out.writerow(
            [
                name,
                f"{timestep:.6g}",
                *(f"{slipped[n]:.3g}" for n in (119, 179, 359)),
                f"{height[-1]:.1f}",
                f"{fallen[0] / 60:.2f}" if len(fallen) else "",
            ]
        )


if __name__ == "__main__":
    main()
