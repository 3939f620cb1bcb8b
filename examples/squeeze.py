"""How hard a gripper has to squeeze at each moment of a shake: controls over time by the gradient of a run.

    python examples/squeeze.py [FOLDER]        # twenty seconds; FOLDER gets squeeze.csv and squeeze.svg

Needs fork1s and scipy; the picture needs matplotlib. docs/gradients.md tells the story.
"""

import sys
import time
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

import fork1s

MASS, FRICTION, USE = (
    0.2,
    0.6,
    0.8,
)  # kg, of the cube and its two contacts; how much of the friction may be used
GRIPPER = f"""
<mujoco>
  <worldbody>
    <body name="palm" pos="0 0 0.3">
      <joint name="lift" type="slide" axis="0 0 1" damping="50"/>
      <geom type="box" size="0.06 0.02 0.01" mass="0.5" contype="0" conaffinity="0"/>
      <body name="left" pos="-0.03 0 -0.05">
        <joint name="left" type="slide" axis="1 0 0" damping="5"/>
        <geom name="left" type="sphere" size="0.01" mass="0.05" friction="{FRICTION}"/>
      </body>
      <body name="right" pos="0.03 0 -0.05">
        <joint name="right" type="slide" axis="-1 0 0" damping="5"/>
        <geom name="right" type="sphere" size="0.01" mass="0.05" friction="{FRICTION}"/>
      </body>
    </body>
    <body name="cube" pos="0 0 0.25">
      <freejoint/>
      <geom name="cube" type="box" size="0.02 0.02 0.02" mass="{MASS}" friction="{FRICTION}"/>
    </body>
  </worldbody>
  <actuator>
    <position name="lift" joint="lift" kp="20000"/>
    <motor name="left" joint="left"/>
    <motor name="right" joint="right"/>
  </actuator>
</mujoco>
"""
DT, ROWS, HEIGHT, FREQUENCY = 1 / 60, 60, 0.015, 3  # s, steps, m, Hz
TIMES = DT * np.arange(1, ROWS + 1)
LIFT = HEIGHT * (1 - np.cos(2 * np.pi * FREQUENCY * TIMES))
START = 6.0  # N


def cost(sim):
    """Squares of the forces, and what they are to keep: friction within its share, and the cube in its place."""
    beyond = np.maximum(0, sim.contacts["friction_use"] - USE)
    slipped = sim.pose("cube")[2, 3] - sim.pose("palm")[2, 3] + 0.05
    forces = sim.control_values[1:]
    return 0.01 * float(forces @ forces) + 10 * float(beyond @ beyond) + 1e5 * slipped**2


def held():
    sim = fork1s.Simulation(fork1s.load(GRIPPER), dt=DT)
    sim.controls.update({"left": START, "right": START})
    sim.step(60)
    return sim


def gradient(sim, forces):
    rows = {"lift": LIFT, "left": forces[:, 0], "right": forces[:, 1]}
    return fork1s.run_gradient(sim, cost, rows, inputs=["left", "right"], move=True)


def needed():
    """By hand [N]: both contacts carry the weight and the acceleration with that share of their friction."""
    w = 2 * np.pi * FREQUENCY
    return MASS * (9.81 + HEIGHT * w**2 * np.cos(w * TIMES)) / (2 * FRICTION * USE)


def solve(iterations=60):
    sim = held()
    gradients = 0

    def of(values):
        nonlocal gradients
        gradients += 1
        found = gradient(sim, values.reshape(ROWS, 2))
        return found.value, found.controls.ravel()

    answer = minimize(
        of,
        np.full(2 * ROWS, START),
        jac=True,
        method="L-BFGS-B",
        bounds=[(0.5, 30)] * (2 * ROWS),
        options={"maxiter": iterations},
    )
    return sim, answer.x.reshape(ROWS, 2), float(answer.fun), gradients


def picture(forces, path):
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams["svg.hashsalt"] = "fork1s"
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
    axes.plot(TIMES, needed(), label="by hand", color="0.6", linewidth=4)
    axes.plot(TIMES, forces[:, 0], label="left, found")
    axes.plot(TIMES, forces[:, 1], "--", label="right, found")
    axes.axhline(START, color="0.8", label="start")
    axes.set(xlabel="time [s]", ylabel="squeeze [N]", title="80 % of friction, shaken at 3 Hz")
    axes.legend()
    figure.savefig(path, metadata={"Date": None})


def main():
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    folder.mkdir(parents=True, exist_ok=True)
    sim, forces, value, gradients = solve()
    first = gradient(sim, np.full((ROWS, 2), START))
    print(f"cost {first.value:.3f} at the start, {value:.3f} after {gradients} gradients")
    inner = slice(4, ROWS - 4)
    off = np.abs(forces.mean(axis=1) / needed() - 1)[inner].max()
    print(f"off from the answer by hand by {100 * off:.1f} % at most, without the first and last four steps")

    there = sim.save()
    started = time.perf_counter()
    for _ in range(10):
        sim.restore(there)
        for k in range(ROWS):
            sim.control_values = [LIFT[k], *forces[k]]
            sim.step(move=True)
    run = (time.perf_counter() - started) / 10
    sim.restore(there)
    started = time.perf_counter()
    found = gradient(sim, 0.9 * forces)
    print(
        f"a gradient takes as long as {(time.perf_counter() - started) / run:.0f} runs on this machine; central "
        f"differences of {forces.size} values take {2 * forces.size + 1}. Off from a direction by two runs: {found.difference:.1e}"
    )
    table = np.column_stack([TIMES, LIFT, forces, needed()])
    header = "time_s,lift_m,left_N,right_N,by_hand_N"
    np.savetxt(folder / "squeeze.csv", table, delimiter=",", header=header, comments="", fmt="%.6g")
    try:
        picture(forces, folder / "squeeze.svg")
    except ModuleNotFoundError:
        print("no picture: matplotlib is not installed")


if __name__ == "__main__":
    main()
