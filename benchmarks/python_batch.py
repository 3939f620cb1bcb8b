"""How fast a Batch of hands steps on one thread and on two, and what Python adds.

    python benchmarks/python_batch.py [SCENE] [--count 1024] > benchmarks/results/python_batch.csv

Needs the package installed (tools/wheel.sh). One thread and two take turns, so that other work on the machine meets
both. Other work takes more from two threads than from one, so rounds in which it took more than a twentieth of the
machine count only where too few others are found in --patience seconds; `others_percent` says what it took in those that
count. `ratio_of_processor_time` does not depend on that: twice what one thread spends over what two spend, which is how
much faster two threads are where each has a core. Python's share is what a call takes beyond the wall time that the
report gives for its steps.
"""

import argparse
import csv
import os
import statistics
import sys
import time
from pathlib import Path

import numpy as np

import fork1s

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument(
    "scene", nargs="?", default=str(Path(__file__).resolve().parents[1] / "scenes" / "hand.xml")
)
parser.add_argument("--count", type=int, default=1024)
parser.add_argument("--rounds", type=int, default=15)
parser.add_argument("--patience", type=float, default=30, help="s, for each row")
arguments = parser.parse_args()
TICK = os.sysconf("SC_CLK_TCK")

model = fork1s.load(arguments.scene)
batches = {threads: fork1s.Batch(model, arguments.count, threads=threads) for threads in (1, 2)}
rng = np.random.default_rng(0)
controls = batches[1].control_values + 0.05 * rng.standard_normal(batches[1].control_values.shape)


def busy() -> float:
    """s of all processors, so far, that anybody used."""
    user, nice, system, _, _, irq, softirq, steal, *_ = map(
        int, Path("/proc/stat").read_text().split("\n")[0].split()[1:]
    )
    return (user + nice + system + irq + softirq + steal) / TICK


def round_of(steps: int) -> dict:
    """Both batches advance about as long as others can be told from us; wall time and time without Python of each."""
    start, others = time.perf_counter(), busy() - time.process_time()
    times = {1: (0.0, 0.0, 0.0), 2: (0.0, 0.0, 0.0)}
    while time.perf_counter() - start < 0.4:
        for threads, batch in batches.items():
            began, spent = time.perf_counter(), time.process_time()
            report = batch.step(controls, steps=steps)
            call, spent = time.perf_counter() - began, time.process_time() - spent
            times[threads] = tuple(sum(pair) for pair in zip(times[threads], (call, report.wall, spent)))
        times["calls"] = times.get("calls", 0) + 1
    elapsed = time.perf_counter() - start
    times["others"] = max(0.0, busy() - time.process_time() - others) / elapsed / os.cpu_count()
    return times


for batch in batches.values():
    batch.step(controls, steps=20)  # contacts are made
out = csv.writer(sys.stdout, lineterminator="\n")
out.writerow(
    [
        "scene",
        "members",
        "threads",
        "steps_a_call",
        "us_a_member_and_step",
        "steps_a_second",
        "python_share_percent",
        "ratio_to_one_thread",
        "ratio_of_processor_time",
        "rounds",
        "others_percent",
    ]
)
for steps in (1, 2, 10):
    rounds, began = [], time.perf_counter()
    while sum(r["others"] < 0.05 for r in rounds) < arguments.rounds and (
        len(rounds) < arguments.rounds or time.perf_counter() - began < arguments.patience
    ):
        rounds.append(round_of(steps))
    counted = sorted(rounds, key=lambda r: r["others"])[: arguments.rounds]
    ratio = statistics.median(r[1][0] / r[2][0] for r in counted)
    processor = statistics.median(2 * r[1][2] / r[2][2] for r in counted)
    for threads in (1, 2):
        whole = statistics.median(r[threads][0] / r["calls"] for r in counted)
        python = statistics.median(1 - r[threads][1] / r[threads][0] for r in counted)
        out.writerow(
            [
                Path(arguments.scene).stem,
                arguments.count,
                threads,
                steps,
                f"{1e6 * whole / steps / arguments.count:.2f}",
                f"{arguments.count * steps / whole:.0f}",
                f"{100 * python:.2f}",
                f"{ratio if threads == 2 else 1:.2f}",
                f"{processor if threads == 2 else 1:.2f}",
                len(counted),
                f"{100 * statistics.median(r['others'] for r in counted):.1f}",
            ]
        )
    sys.stdout.flush()
