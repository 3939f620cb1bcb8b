"""How much memory a Batch of hands takes: at birth, and after resets of all members.

    python benchmarks/python_batch_memory.py [SCENE] [--count 1024] > benchmarks/results/python_batch_memory.csv
    python benchmarks/python_batch_memory.py --draw >> benchmarks/results/python_batch_memory.csv

--draw: every member has factors of stiffness, friction and mass of its own, others at every reset. Needs the package
installed (tools/wheel.sh). Resident memory of the process less what it had with the model loaded, in
megabytes.
"""

import argparse
import csv
import sys
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
start = resident_mb()
batch = fork1s.Batch(model, arguments.count, **({"seeds": 7} if arguments.draw else {}))
rows = csv.writer(sys.stdout, lineterminator="\n")
drawn = "drawn" if arguments.draw else "none"
if not arguments.draw:
    rows.writerow(["members", "factors", "resets", "resident_mb"])
rows.writerow([arguments.count, drawn, 0, round(resident_mb() - start, 1)])
for reset in range(1, max(arguments.resets) + 1):
    batch.reset()
    if reset in arguments.resets:
        rows.writerow([arguments.count, drawn, reset, round(resident_mb() - start, 1)])
        sys.stdout.flush()
