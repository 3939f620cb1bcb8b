"""Processor time of a simulated second, scene by scene. CSV.

    python benchmarks/simulated_second.py > docs/scale/simulated_second.csv

Steps of 1/60 s of a Batch on one thread, medians of 9; processor time, which other work on the machine disturbs less than it
does the clock. docs/scale.md reads it.
"""

import statistics
import sys
import time
from pathlib import Path

import numpy as np

import fork1s

SCENES = Path(__file__).resolve().parents[1] / "scenes"
CASES = {"fourbar_gripper": 0.4, "hand": None, "quadruped": 0.0, "hexapod_terrain": None, "vehicle": None}


def measure(name, setpoint, count=32):
    model = fork1s.load(SCENES / f"{name}.xml")
    batch = fork1s.Batch(model, count, dt=1 / 60, threads=1)
    controls = None if setpoint is None else np.full((count, len(batch.controls)), setpoint)
    batch.step(controls, steps=60)
    spent = []
    for _ in range(9):
        start = time.process_time()
        batch.step(controls, steps=20)
        spent.append((time.process_time() - start) / (20 * count) * 60)
    seconds = statistics.median(spent)
    print(
        f"{name},{1e6 * seconds / 60:.1f},{seconds:.6f},{1e6 * seconds / 3600:.2f}",
        flush=True,
    )


if __name__ == "__main__":
    print("scene,us_a_step,cpu_s_per_simulated_s,cpu_h_per_million_simulated_s")
    for case in sys.argv[1:] or CASES:
        measure(case, CASES.get(case))
