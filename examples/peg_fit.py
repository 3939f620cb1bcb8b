"""Stiffnesses of a gripper with which a peg goes into a hole beside its path: a sweep, a target, a fit.

    python examples/peg_fit.py [FOLDER]        # eight seconds; FOLDER gets peg.parquet, peg.csv and peg.svg

Needs fork1s[sweep]; the picture needs matplotlib. docs/sweeps.md tells the story.
"""

import sys
from pathlib import Path

import numpy as np

import fork1s

SCENE = Path(__file__).resolve().parents[1] / "scenes" / "peg_gripper.xml"
NOSE = np.array([0, 0, -0.063, 1])  # of the peg, in its own frame
DEEP = 40.0  # mm: counts as in
PLANE = {"wrist": ["wrist_y"], "fingers": ["left_bend", "right_bend"], "pad": ["left_pad (freedom 2)"]}


def insert(model):
    """Feeds the peg down by 55 mm in 1.7 s with 12 N at most: depth of its nose [mm], largest force on it [N]."""
    sim = fork1s.Simulation(model, dt=1 / 120)
    force = 0.0
    for i in range(240):
        sim.controls["feed"] = 0.055 * min(1, i / 200)
        sim.step()
        contacts = sim.contacts["force"]
        if len(contacts):
            force = max(force, float(np.linalg.norm(contacts.sum(axis=0))))
    return -1000 * float((sim.pose("peg") @ NOSE)[2]), force


def with_factors(model, point):
    """Springs of the wrist, fingers and pads that bend in the plane in which the hole is off."""
    now = model.stiffnesses
    return model.with_stiffness(
        {joint: now[joint] * point[part] for part, joints in PLANE.items() for joint in joints}
    )


def metric(model, point):
    model = with_factors(model, point)
    depth, force = insert(model)
    C = model.compliance("peg")
    # The point of the peg's axis that a moment turns and does not shift, from the nose up.
    centre = -1000 * (C[3, 1] / C[1, 1] + NOSE[2])
    return {"depth_mm": depth, "force_N": force, "turn": C[1, 1], "shift": C[3, 3], "centre_mm": centre}


def tilted(model, point):
    depth, force = insert(model)
    return {"depth_mm": depth, "force_N": force}


def picture(table, path):
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams["svg.hashsalt"] = "fork1s"
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
    shown = axes.scatter(table["turn"], table["centre_mm"], c=table["depth_mm"], s=22, cmap="viridis")
    axes.set(
        xscale="log",
        xlabel="turn per moment at the peg [rad/(N·m)]",
        ylabel="centre of compliance above the nose [mm]",
        title="343 grippers: how deep the peg goes with 12 N",
    )
    figure.colorbar(shown, label="depth [mm]")
    figure.savefig(path, metadata={"Date": None})


def main():
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    folder.mkdir(parents=True, exist_ok=True)
    model = fork1s.load(SCENE)
    print("as drawn: {:.1f} mm deep, {:.1f} N".format(*insert(model)))
    for scale in (0.3, 0.1, 0.03, 0.01):
        print(
            "all springs times {:g}: {:.1f} mm deep, {:.1f} N".format(
                scale, *insert(fork1s.load(SCENE, stiffness_scale=scale))
            )
        )

    # 1. Which of 343 grippers take it in?
    factors = np.round(np.geomspace(0.005, 20, 7), 6)
    table = fork1s.sweep(
        model,
        {part: factors for part in PLANE},
        metric,
        path=folder / "peg.parquet",
        progress=sys.stderr.isatty(),
    )
    table.drop(columns=["seconds", "worker"]).to_csv(folder / "peg.csv", index=False, float_format="%.6g")
    inside = table[table["depth_mm"] > DEEP]
    print(f"{len(inside)} of {len(table)} go in")

    # 2. Of those that press with 2 N at most, the one that is stiffest against being turned. Across, the same compliance
    #    is wanted, so that it does not matter to which side the hole is tilted.
    gentle = inside[inside["force_N"] < 2]
    best = with_factors(model, gentle.loc[gentle["turn"].idxmin()])
    C = best.compliance("peg")
    target = np.full((6, 6), np.nan)
    target[1, 1] = target[0, 0] = C[1, 1]
    target[3, 3] = target[4, 4] = C[3, 3]
    target[1, 3] = C[1, 3]
    print(f"wanted: turn {C[1, 1]:.3f} rad/(N·m), shift {1000 * C[3, 3]:.2f} mm/N, both ways")

    # 3. Stiffnesses that have it.
    bounds = {name: (0.001 * k, 100 * k) for name, k in model.stiffnesses.items() if name != "feed"}
    fit = best.fit_stiffness({"peg": target}, list(bounds), bounds=bounds)
    print(fit)

    # 4. The same hole tilted to eight sides, and the peg off to the same side.
    angle = np.arange(8) * np.pi / 4
    tilt = 0.0349 / 2
    holes = [
        {
            "body:hole.pos": [0.0015 * np.cos(a), 0.0015 * np.sin(a), 0.0],
            "body:hole.quat": [np.cos(tilt), -np.sin(tilt) * np.sin(a), np.sin(tilt) * np.cos(a), 0.0],
        }
        for a in angle
    ]
    for name, gripper in (("as drawn", model), ("best of the sweep", best), ("fitted", fit.model)):
        sides = fork1s.sweep(gripper, holes, tilted, progress=False)
        print(
            f"{name}, eight sides: {sides['depth_mm'].min():.1f} to {sides['depth_mm'].max():.1f} mm deep, "
            f"{sides['force_N'].max():.1f} N at most; errors: {sides['error'].notna().sum()}"
        )
    try:
        picture(table, folder / "peg.svg")
    except ModuleNotFoundError:
        print("no picture: matplotlib is not installed")


if __name__ == "__main__":
    main()
