"""How much memory a Batch of hands takes: at birth, and after resets of all members.

    python benchmarks/python_batch_memory.py [SCENE] [--count 1024] > benchmarks/results/python_batch_memory.csv
    python benchmarks/python_batch_memory.py --draw >> benchmarks/results/python_batch_memory.csv

--draw: every member has factors of stiffness, friction and mass of its own, others at every reset. Needs the package
installed (tools/wheel.sh). Times are those of making the batch and of the last reset. Resident memory of the process less what it had with the model loaded, in
megabytes.
"""

import argparse
import csv
import sys
import time
from pathlib import Path

import fork1s

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument(
    "scene", nargs="?", default=str(Path(__file__).resolve().parents[1] / "scenes" / "hand.xml")
)
parser.add_argument("--count", type=int, default=1024)
parser.add_argument("--resets", type=int, nargs="*", default=[1, 15, 100, 1000])
parser.add_argument("--draw", action="store_true")
arguments = parser.parse_args()


def resident_mb() -> float:
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS")) / 1024


model = fork1s.load(arguments.scene)
start, began = resident_mb(), time.perf_counter()
batch = fork1s.Batch(model, arguments.count, **({"seeds": 7} if arguments.draw else {}))
took = time.perf_counter() - began
rows = csv.writer(sys.stdout, lineterminator="\n")
drawn = "drawn" if arguments.draw else "none"
if not arguments.draw:
    rows.writerow(["members", "factors", "resets", "resident_mb", "us_a_member"])


def write(resets: int, seconds: float) -> None:
    memory, each = round(resident_mb() - start, 1), round(1e6 * seconds / arguments.count, 1)
    rows.writerow([arguments.count, drawn, resets, memory, each])
    sys.stdout.flush()


write(0, took)
for reset in range(1, max(arguments.resets) + 1):
    began = time.perf_counter()
    batch.reset()
    took = time.perf_counter() - began
    if reset in arguments.resets:
        write(reset, took)
