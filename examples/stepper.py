"""A hand takes a box from a table, lifts, shakes and turns it: MuJoCo's data, at 60 steps a second.

python examples/stepper.py               with our step
python examples/stepper.py --mujoco      with MuJoCo's own
python examples/stepper.py --view        in MuJoCo's viewer, where that is installed
"""

import argparse
import csv
from pathlib import Path

import mujoco
import numpy as np

import fork1s.mujoco

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--mujoco", action="store_true")
parser.add_argument("--view", action="store_true")
arguments = parser.parse_args()

scenes = Path(__file__).resolve().parents[1] / "scenes"
model = mujoco.MjModel.from_xml_path(str(scenes / "grasp_box.xml"))
model.opt.timestep = 1 / 60
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
palm = data.mocap_pos[0].copy()

# Set-points in rad, the palm's way in m and rad, linear between rows.
rows = [row for row in csv.reader((scenes / "grasp_box.csv").open()) if not row[0].startswith("#")]
times, *columns = np.array(rows[1:], dtype=float).T
tracks = dict(zip(rows[0][1:], columns))

stepper = None if arguments.mujoco else fork1s.mujoco.Stepper(model)
viewer = None
if arguments.view:
    import mujoco.viewer

    viewer = mujoco.viewer.launch_passive(model, data)
box = model.body("box").id
heights = []
while data.time < times[-1] and len(heights) < 60 * times[-1]:
    now = {name: np.interp(data.time + model.opt.timestep, times, track) for name, track in tracks.items()}
    for name, value in now.items():
        if not name.startswith("palm."):
            data.ctrl[model.actuator(name).id] = value
    data.mocap_pos[0] = palm + [now.get(f"palm.{axis}", 0) for axis in "xyz"]
    turn = np.array([now.get(f"palm.r{axis}", 0) for axis in "xyz"])
    mujoco.mju_axisAngle2Quat(
        data.mocap_quat[0], turn / max(np.linalg.norm(turn), 1e-12), np.linalg.norm(turn)
    )
    if stepper:
        stepper.step(data)
    else:
        mujoco.mj_step(model, data)
    if viewer:
        viewer.sync()
    heights.append(data.xpos[box, 2])
    if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
        print(f"unstable after {len(heights) / 60:.2f} s")
        raise SystemExit(1)

apart = np.linalg.norm(data.xpos[box] - data.mocap_pos[0])
print(f"lifted to {max(heights):.3f} m, and at the end {1e3 * apart:.1f} mm from the palm's middle")
