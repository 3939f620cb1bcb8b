"""How fast a Batch of hands steps on one thread and on two, and what Python adds.

    python benchmarks/python_batch.py [SCENE] [--count 1024] > benchmarks/results/python_batch.csv

Needs the package installed (tools/wheel.sh). One thread and two take turns, so that other work on the machine meets
both; ratios of medians are worth more than times. Python's share is what a call takes beyond the wall time that the
report gives for its steps.
"""

import argparse
import csv
import statistics
import sys
import time
from pathlib import Path

import fork1s
import numpy as np

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("scene", nargs="?", default=str(Path(__file__).resolve().parents[1] / "scenes" / "hand.xml"))
parser.add_argument("--count", type=int, default=1024)
parser.add_argument("--rounds", type=int, default=15)
arguments = parser.parse_args()

model = fork1s.load(arguments.scene)
batches = {threads: fork1s.Batch(model, arguments.count, threads=threads) for threads in (1, 2)}
rng = np.random.default_rng(0)
controls = batches[1].control_values + 0.05 * rng.standard_normal(batches[1].control_values.shape)


def seconds(threads: int, steps: int) -> tuple[float, float]:
    start = time.perf_counter()
    report = batches[threads].step(controls, steps=steps)
    return time.perf_counter() - start, report.wall


for batch in batches.values():
    batch.step(controls, steps=20)  # contacts are made
spent: dict[tuple[int, int], list[tuple[float, float]]] = {(t, steps): [] for steps in (1, 10) for t in (1, 2)}
for _ in range(arguments.rounds):
    for (threads, steps), times in spent.items():
        times.append(seconds(threads, steps))

median = {key: statistics.median(call for call, _ in times) for key, times in spent.items()}
python = {key: statistics.median(1 - wall / call for call, wall in times) for key, times in spent.items()}
out = csv.writer(sys.stdout, lineterminator="\n")
out.writerow(["scene", "members", "threads", "steps_a_call", "us_a_member_and_step", "steps_a_second",
              "python_share_percent", "ratio_to_one_thread"])
for threads in (1, 2):
    for steps in (1, 10):
        whole = median[threads, steps]
        out.writerow([
            Path(arguments.scene).stem, arguments.count, threads, steps,
            f"{1e6 * whole / steps / arguments.count:.2f}", f"{arguments.count * steps / whole:.0f}",
            f"{100 * python[threads, steps]:.2f}", f"{median[1, steps] / whole:.2f}",
        ])
