#!/usr/bin/env python3
"""What a step by expansions takes beside one by exact poses: chains of N links, whose tip moves by r coordinates.

    python benchmarks/expansion_gain.py

Chains of hinges about alternating axes on springs of 10 N m/rad, 1 m long, swing under weight. Mean of the quicker nine in ten
steps of 1/60 s, the two in turn in one process. Needs the package fork1s.
"""

import time

import numpy as np

import fork1s

STEPS = 240


def chain(links: int, modes: int) -> str:
    """MJCF of a chain on a fixed base."""
    length = 1 / links
    inner = ""
    for i in reversed(range(links)):
        axis = ["0 1 0", "0 0 1", "1 0 0"][i % 3]
        position = length if i else 0
        inner = (
            f'<body name="l{i}" pos="{position} 0 0"><joint name="j{i}" axis="{axis}" stiffness="10" damping="0.05"/>'
            f'<geom type="capsule" fromto="0 0 0 {length} 0 0" size="0.01" mass="{1 / links}"/>{inner}</body>'
        )
    return (
        f'<mujoco><custom><text name="fork1s_interface" data="l{links - 1}"/>'
        f'<numeric name="fork1s_modes" data="{modes}"/></custom><worldbody>{inner}</worldbody></mujoco>'
    )


def step_times(text: str) -> tuple[dict[str, float], int]:
    """Time of a step [us] by either; steps that went by expansions."""
    model = fork1s.load(text)
    simulations = {word: fork1s.Simulation(model, dt=1 / 60, recovery=word) for word in ("exact", "expanded")}
    times: dict[str, list[float]] = {word: [] for word in simulations}
    by_expansion = 0
    for _ in range(STEPS):
        for word, simulation in simulations.items():
            start = time.perf_counter()
            report = simulation.step()
            times[word].append(time.perf_counter() - start)
            by_expansion += report.expanded_steps if word == "expanded" else 0
    quicker = {word: sorted(own)[: STEPS * 9 // 10] for word, own in times.items()}
    return {word: 1e6 * float(np.mean(own)) for word, own in quicker.items()}, by_expansion


def main() -> None:
    """Prints a row of a chain."""
    print("links,coordinates,exact_us,expanded_us,steps_by_expansion")
    for modes in (0, 6, 18):
        for links in (8, 12, 16, 24, 36, 60, 90):
            own, count = step_times(chain(links, modes))
            coordinates = min(links, 6 + modes)
            print(f"{links},{coordinates},{own['exact']:.1f},{own['expanded']:.1f},{count}", flush=True)


if __name__ == "__main__":
    main()
