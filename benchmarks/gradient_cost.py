#!/usr/bin/env python3
"""What fork1s.run_gradient takes, in runs of as many steps, and how far it is off from two runs of their own, after a second
of each scene at 1/60 s with controls held. Needs the Python package.

python3 benchmarks/gradient_cost.py fourbar_gripper hand hexapod quadruped > benchmarks/results/gradient_cost.csv
"""

import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import fork1s

ROUNDS, STEPS = 7, 30


def duration(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


if len(sys.argv) < 2:
    sys.exit("usage: gradient_cost.py SCENE...")
print("scene,state,inputs,contacts,run_us,gradient_us,runs,runs_by_differences,switches,difference")
for name in sys.argv[1:]:
    model = fork1s.load(Path(__file__).resolve().parents[1] / "scenes" / f"{name}.xml")
    sim = fork1s.Simulation(model, dt=1 / 60)
    sim.step(60)
    inputs = [control for control in sim.controls if sim.controls.kind(control) == "actuator"]
    rows = {control: np.full(STEPS, sim.controls[control]) for control in inputs}

    def cost(at: fork1s.Simulation) -> float:
        return float(at.poses[:, :3].sum())

    there = sim.save()
    runs, gradients = [], []
    for _ in range(ROUNDS):  # in turn, so that both meet the same other work
        runs.append(duration(lambda sim=sim: sim.step(STEPS)))
        sim.restore(there)
        gradients.append(duration(lambda sim=sim, rows=rows: fork1s.run_gradient(sim, cost, rows, threads=1)))
    found = fork1s.run_gradient(sim, cost, rows)
    run, gradient = statistics.median(runs), statistics.median(gradients)
    counts = f"{len(found.start)},{len(inputs)},{len(sim.contacts)}"
    by_differences = 2 * STEPS * len(inputs) + 1
    print(
        f"{name},{counts},{1e6 * run:.0f},{1e6 * gradient:.0f},{gradient / run:.0f},{by_differences},"
        f"{len(found.switches)},{found.difference:.1e}"
    )
