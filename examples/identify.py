"""Friction, stiffness and mass from a recorded motion: a fit by the gradient of runs, and one without.

python examples/identify.py        # ten seconds; needs fork1s and scipy. docs/gradients.md tells the story.
"""

import numpy as np
from scipy.optimize import least_squares, minimize

import fork1s

BENCH = """
<mujoco>
  <worldbody>
    <geom name="table" type="plane" size="1 1 0.1" friction="{friction}"/>
    <body name="block" pos="0 0 0.03">
      <freejoint/>
      <geom name="block" type="box" size="0.05 0.05 0.03" mass="{mass}" friction="{friction}"/>
    </body>
    <body name="slide" pos="-0.2 0.012 0.03">
      <joint name="feed" type="slide" axis="1 0 0" damping="20"/>
      <geom type="box" size="0.02 0.02 0.01" mass="0.3" contype="0" conaffinity="0"/>
      <body name="finger">
        <joint name="spring" type="slide" axis="1 0 0" stiffness="{stiffness}" damping="2"/>
        <geom name="finger" type="capsule" fromto="0 0 0 0.135 0 0" size="0.012" mass="0.1" friction="0.5"/>
      </body>
    </body>
  </worldbody>
  <actuator><position name="feed" joint="feed" kp="5000"/></actuator>
</mujoco>
"""
TRUTH = {"friction": 0.42, "stiffness": 320.0, "mass": 1.1}  # N/m, kg
GUESS = {"friction": 0.3, "stiffness": 200.0, "mass": 0.8}
PATH = 0.1 * np.clip(np.arange(60) / 40, 0, 1)  # m, of the feed, a row a step


def bench(friction, stiffness, mass):
    return fork1s.load(BENCH.format(friction=friction, stiffness=stiffness, mass=mass))


def motion(model):
    """Where the block is after each step [m], its turn as what moves a corner: the finger pushes beside its middle."""
    sim = fork1s.Simulation(model, dt=1 / 60)
    sim.newton_tolerance = 1e-15
    rows = []
    for feed in PATH:
        sim.controls["feed"] = feed
        sim.step(move=True)
        X = sim.pose("block")
        rows.append([X[0, 3], X[1, 3], 0.05 * np.arctan2(X[1, 0], X[0, 0])])
    return np.array(rows)


def fit(with_gradient, recorded, runs=300):
    """Parameters, root mean square of what they miss [mm], and how many runs it took."""
    count = 0

    def missed(model, point):
        nonlocal count
        count += 1
        return 1000 * (motion(model) - recorded).ravel()

    def point(x):
        return dict(zip(TRUTH, np.exp(x).tolist(), strict=True))

    def by_logarithms(x):
        at = point(x)
        return fork1s.parameter_gradient(bench, missed, at).jacobian() * np.array(list(at.values()))

    x = np.log(list(GUESS.values()))
    if with_gradient:
        answer = least_squares(lambda x: missed(bench(**point(x)), None), x, jac=by_logarithms)
    else:
        answer = minimize(
            lambda x: float(np.mean(missed(bench(**point(x)), None) ** 2)),
            x,
            method="Nelder-Mead",
            options={"maxfev": runs, "fatol": 1e-12, "xatol": 1e-9},
        )
    off = missed(bench(**point(answer.x)), None)
    return point(answer.x), float(np.sqrt(np.mean(off**2))), count


def main():
    recorded = motion(bench(**TRUTH))
    print(
        f"the block goes {1000 * recorded[-1, 0]:.1f} mm and turns by {np.degrees(recorded[-1, 2] / 0.05):.1f} degrees"
    )
    for name, with_gradient in (("by gradients", True), ("by values alone", False)):
        found, off, count = fit(with_gradient, recorded)
        numbers = ", ".join(f"{key} {value:.4g}" for key, value in found.items())
        print(f"{name}: {numbers}; misses {off:.2g} mm after {count} runs")


if __name__ == "__main__":
    main()
