#!/usr/bin/env python3
"""Which function of a step calls which, with its share of the instructions of all steps.

    tools/call_tree.py                 # writes the tree of scenes/grasp_box.xml into docs/architecture.md
    tools/call_tree.py SCENE [TABLE]   # prints that of another model, driven by a table of controls

Counted by callgrind on build/release, ten seconds of the scene. Functions that the compiler inlines count as their
callers; wrappers of the standard library and lambdas are left out, what has less than a fiftieth, and what a function
calls where it stands again.
"""

import re
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "architecture.md"
BEGIN, END = "<!-- calls: tools/call_tree.py -->\n", "<!-- end of calls -->"
START = "World::Step"
LEAST = 0.02
DEEPEST = 10  # calls


def short(name: str) -> str:
    """The name without arguments, templates and namespaces; empty for what only passes calls on."""
    if name.startswith("std::") or "{lambda" in name or "_Function_handler" in name or "ParallelFor" in name:
        return ""
    name = re.sub(r"\(anonymous namespace\)::|fork1s::|internal::", "", name)
    while "<" in name and "operator" not in name:
        shorter = re.sub(r"<[^<>]*>", "", name)
        if shorter == name:
            break
        name = shorter
    name = name.split("(")[0].split("'")[0].strip()
    return name.split(" ")[-1]


def read(path: Path) -> tuple[dict[str, int], dict[str, dict[str, int]]]:
    """Own instructions by function, and inclusive ones of every call by caller and callee."""
    names: dict[str, str] = {}

    def name_of(text: str) -> str:
        key, _, name = text.partition(" ")
        if name:
            names[key] = name
        return names[key]

    own: dict[str, int] = defaultdict(int)
    calls: dict[str, dict[str, int]] = defaultdict(lambda: defaultdict(int))
    caller = callee = ""
    of_call = False
    for line in path.read_text(errors="replace").splitlines():
        if line.startswith("fn="):
            caller = name_of(line[3:])
        elif line.startswith("cfn="):
            callee = name_of(line[4:])
        elif line.startswith("calls="):
            of_call = True
        elif line and (line[0].isdigit() or line[0] in "+-*"):
            cost = int(line.split()[1]) if len(line.split()) > 1 else 0
            if of_call:
                calls[caller][callee] += cost
            else:
                own[caller] += cost
            of_call = False
    return own, calls


def tree(own: dict[str, int], calls: dict[str, dict[str, int]]) -> list[str]:
    """Lines of the tree from START, the dearest callee first."""
    start = next(name for name in calls if short(name) == START)
    whole = own[start] + sum(calls[start].values())

    def callees(name: str, seen: frozenset[str]) -> dict[str, tuple[str, int]]:
        """Of a function, through what only passes calls on."""
        found: dict[str, tuple[str, int]] = {}
        for callee, cost in calls[name].items():
            if callee in seen:
                continue
            label = short(callee)
            inner = {label: (callee, cost)} if label else callees(callee, seen | {callee})
            for key, (of, part) in inner.items():
                found[key] = (of, found.get(key, (of, 0))[1] + part)
        return found

    lines: list[str] = []
    shown: set[str] = set()

    def walk(label: str, name: str, cost: int, depth: int, seen: frozenset[str]) -> None:
        lines.append(f"{'  ' * depth}{label:<{58 - 2 * depth}}{100 * cost / whole:5.0f} %")
        if name in shown:
            return
        shown.add(name)
        below = callees(name, seen)
        for key, (of, part) in sorted(below.items(), key=lambda item: -item[1][1]):
            if depth < DEEPEST and part >= LEAST * whole and not key.startswith("Eigen"):
                walk(key, of, min(part, cost), depth + 1, seen | {of})

    walk(START, start, whole, 0, frozenset({start}))
    return lines


def main() -> int:
    """Counts, and writes or prints the tree."""
    scene = sys.argv[1] if len(sys.argv) > 1 else str(ROOT / "scenes" / "grasp_box.xml")
    table = sys.argv[2:3] if len(sys.argv) > 1 else [str(ROOT / "scenes" / "grasp_box.csv")]
    soak = ROOT / "build" / "release" / "benchmarks" / "soak"
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "callgrind"
        subprocess.run(
            [
                "valgrind",
                "--tool=callgrind",
                "--compress-pos=no",
                "--separate-callers2=fork1s::ParallelFor*",
                f"--callgrind-out-file={out}",
                str(soak),
                scene,
                str(10 / 3600),
                *table,
            ],
            check=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        lines = tree(*read(out))
    if len(sys.argv) > 1:
        print("\n".join(lines))
        return 0
    page = PAGE.read_text()
    before, rest = page.split(BEGIN)
    after = rest.split(END)[1]
    PAGE.write_text(before + BEGIN + "\n" + "\n".join("    " + line for line in lines) + "\n\n" + END + after)
    return 0


if __name__ == "__main__":
    sys.exit(main())
