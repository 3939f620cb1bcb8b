#!/usr/bin/env python3
"""What Simulation.linearize takes, in steps of the same simulation, after a second of each scene at 1/60 s. Needs the Python package.

python3 benchmarks/linearize_cost.py hand grasp_box hexapod vehicle > benchmarks/results/linearize_cost.csv
"""

import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import fork1s

ROUNDS, STEPS = 15, 60


def duration(work: Callable[..., object], *arguments: int) -> float:
    start = time.perf_counter()
    work(*arguments)
    return time.perf_counter() - start


if len(sys.argv) < 2:
    sys.exit("usage: linearize_cost.py SCENE...")
print("scene,coordinates,inputs,step_us,linearize_us,steps,difference")
for name in sys.argv[1:]:
    model = fork1s.load(Path(__file__).resolve().parents[1] / "scenes" / f"{name}.xml")
    sim = fork1s.Simulation(model, dt=1 / 60)
    sim.step(60)
    linear = sim.linearize()
    there = sim.save()
    steps, linearizations = [], []
    for _ in range(ROUNDS):  # in turn, so that both meet the same other work
        sim.restore(there)
        steps.append(duration(sim.step, STEPS) / STEPS)
        sim.restore(there)
        linearizations.append(duration(sim.linearize))
    step, whole = statistics.median(steps), statistics.median(linearizations)
    counts = f"{len(linear.coordinates)},{len(linear.inputs)}"
    print(f"{name},{counts},{1e6 * step:.1f},{1e6 * whole:.0f},{whole / step:.0f},{linear.difference:.1e}")
