#!/usr/bin/env python3
"""How far a scene stepped by `expanded` is from the same by `exact`, and that from itself at a small step.

    python benchmarks/expanded_error.py firemen:2 hammer:5 peg_in_hole:5

SCENE:SECONDS of scenes/, at 1/60 s, with the table of controls beside it. Millimetres, root mean squares over all bodies
and steps. Needs the package fork1s.
"""

import csv
import sys
from pathlib import Path

import numpy as np

import fork1s

SCENES = Path(__file__).resolve().parents[1] / "scenes"
SMALL = 16  # steps of the finer run within one


def read_controls(path: Path) -> tuple[list[str], np.ndarray]:
    """Names of the controls, and rows of time and values."""
    if not path.exists():
        return [], np.zeros((1, 1))
    rows = [row for row in csv.reader(path.read_text().splitlines()) if row and not row[0].startswith("#")]
    return rows[0][1:], np.array(rows[1:], float)


def positions(scene: str, seconds: float, parts: int, recovery: str) -> np.ndarray:
    """Origins of all bodies [m] after every 1/60 s: (steps, bodies, 3)."""
    model = fork1s.load(str(SCENES / f"{scene}.xml"))
    simulation = fork1s.Simulation(model, dt=1 / 60 / parts, recovery=recovery)
    names, table = read_controls(SCENES / f"{scene}.csv")
    out = []
    for step in range(round(seconds * 60)):
        for part in range(parts):
            time = (step * parts + part + 1) / 60 / parts
            for column, name in enumerate(names, 1):
                if name in simulation.controls:
                    simulation.controls[name] = float(np.interp(time, table[:, 0], table[:, column]))
            simulation.step(move=True)
        out.append(np.array(simulation.poses)[:, :3])
    return np.array(out)


def rms_mm(difference: np.ndarray) -> float:
    """Root mean square length [mm]."""
    return 1e3 * float(np.sqrt((np.linalg.norm(difference, axis=-1) ** 2).mean()))


def main() -> None:
    """Prints a row of a scene."""
    print("scene,moves_mm,expanded_from_exact_mm,exact_from_small_step_mm")
    for argument in sys.argv[1:]:
        scene, seconds = argument.split(":")
        exact = positions(scene, float(seconds), 1, "exact")
        expanded = positions(scene, float(seconds), 1, "expanded")
        fine = positions(scene, float(seconds), SMALL, "exact")
        print(
            f"{scene},{rms_mm(exact - exact[0]):.1f},{rms_mm(expanded - exact):.4f},{rms_mm(exact - fine):.4f}"
        )


if __name__ == "__main__":
    main()
