#!/usr/bin/env python3
"""Whether `fork1s run --accuracy` keeps its word, on mechanisms drawn at random.

    python benchmarks/accuracy_met.py [--first SEED] [--seeds N] [--program build/release/bin/fork1s] > met.csv

For each seed a model and an accuracy are drawn, and the program chooses a setting. That setting is run again beside one
of a 32nd of its step with all modes, and the largest distance between them, over all bodies and whole 1/60 s, is the true
error. A row a seed; at the end, on standard error, how many were met, and how many of these are farther off than asked.
Needs the package fork1s.
"""

import argparse
import json
import random
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import fork1s

PARTS = 32  # steps of the truth within one of the setting
SECONDS = 1.2
# Accuracies that are drawn from, in mm or in percent of the motion.
ASKED = ["0.2mm", "1mm", "5mm", "0.5%", "2%"]


def vector(draw: random.Random, size: float) -> str:
    """Three numbers up to `size`."""
    return " ".join(f"{draw.uniform(-size, size):.4f}" for _ in range(3))


def chain(draw: random.Random, links: int, joint: str, first: str, tip: str = "") -> str:
    """Nested links of 0.1 to 0.2 m, each with a hinge about an axis near y."""
    text = tip
    for i in reversed(range(links)):
        length = draw.uniform(0.1, 0.2)
        axis = f"{draw.uniform(-0.5, 0.5):.3f} 1 {draw.uniform(-0.5, 0.5):.3f}"
        hinge = f'<joint name="j{i}" axis="{axis}" {joint}/>' if i or not first else first
        name = "tip" if i == links - 1 else f"link{i}"
        place = "0 0 0" if i == 0 else f"{draw.uniform(0.1, 0.2):.3f} 0 0"
        text = (
            f'<body name="{name}" pos="{place}">{hinge}<geom type="capsule" size="0.02" '
            f'fromto="0 0 0 {length:.3f} 0 0" mass="{draw.uniform(0.1, 0.5):.3f}"/>{text}</body>'
        )
    return text


def tree(draw: random.Random) -> str:
    spring = f'stiffness="{10 ** draw.uniform(0, 1.5):.3f}" damping="{10 ** draw.uniform(-2, -1):.4f}"'
    return f'<body pos="0 0 2">{chain(draw, draw.randint(2, 6), spring, "")}</body>'


def stop(draw: random.Random) -> str:
    stops = f'limited="true" range="-0.5 {draw.uniform(0.3, 0.8):.3f}" damping="0.002"'
    return f'<body pos="0 0 2">{chain(draw, draw.randint(2, 4), stops, "")}</body>'


def landing(draw: random.Random) -> str:
    shape = draw.choice(
        ['type="sphere" size="0.05"', 'type="box" size="0.05 0.03 0.08"', 'type="capsule" size="0.03 0.06"']
    )
    return (
        f'<geom type="plane" size="5 5 1"/><body name="ball" pos="0 0 {draw.uniform(0.2, 0.6):.3f}" '
        f'euler="{vector(draw, 1)}"><freejoint/><geom {shape} mass="{draw.uniform(0.1, 1):.3f}"/></body>'
    )


def whip(draw: random.Random) -> str:
    spring = f'stiffness="{draw.uniform(0.5, 3):.3f}" damping="0.02"'
    height = draw.uniform(0.15, 0.3)
    return f'<geom type="plane" size="5 5 1"/><body pos="0 0 {height:.3f}">{chain(draw, draw.randint(2, 3), spring, "")}</body>'


def floating(draw: random.Random) -> str:
    spring = f'stiffness="{10 ** draw.uniform(0, 1):.3f}" damping="0.02"'
    return chain(draw, draw.randint(2, 5), spring, '<freejoint name="base"/>')


def rope(draw: random.Random) -> str:
    length = draw.uniform(0.3, 0.6)
    start = f"{draw.uniform(0.05, 0.25):.3f} {draw.uniform(-0.1, 0.1):.3f} {2 - draw.uniform(0.05, 0.2):.3f}"
    return (
        f'<site name="eye" pos="0 0 2"/><body name="ball" pos="{start}"><freejoint/><geom size="0.05" mass="0.5"/>'
        f'<site name="hook" pos="0 0 0.05"/></body>|<tendon><spatial limited="true" range="0 {length:.3f}">'
        '<site site="eye"/><site site="hook"/></spatial></tendon>'
    )


def loop(draw: random.Random) -> str:
    width = draw.uniform(0.2, 0.3)
    spring = f'stiffness="{10 ** draw.uniform(-0.5, 1):.3f}" damping="0.01"'
    rods = "".join(
        f'<body name="{name}" pos="{x:.3f} 0 2"><joint name="{name}" axis="0 1 0" {spring}/>'
        f'<geom type="capsule" size="0.01" fromto="0 0 0 0 0 -0.2" mass="0.2"/>{{{name}}}</body>'
        for name, x in (("left", 0.0), ("right", width))
    )
    bar = (
        f'<body name="bar" pos="0 0 -0.2"><joint name="bar" axis="0 1 0"/><geom type="capsule" size="0.01" '
        f'fromto="0 0 0 {width:.3f} 0 0" mass="{draw.uniform(0.1, 1):.3f}"/></body>'
    )
    return rods.format(left=bar, right="") + (
        f'|<equality><connect body1="bar" body2="right" anchor="{width:.3f} 0 0"/></equality>'
    )


FAMILIES = [tree, stop, landing, whip, floating, rope, loop]


def draw_model(seed: int) -> tuple[str, str, str, str | None]:
    """Family, MJCF, the accuracy asked for, and a push for the program."""
    draw = random.Random(seed)
    family = FAMILIES[seed % len(FAMILIES)]
    world, _, rest = family(draw).partition("|")
    text = (
        f'<mujoco model="{family.__name__}{seed}"><compiler angle="radian"/><option timestep="{1 / 60:.17g}"/>'
        f"<worldbody>{world}</worldbody>{rest}</mujoco>"
    )
    body = {"loop": "bar"}.get(family.__name__, "ball" if family in (landing, rope) else "tip")
    push = f"{body}:{vector(draw, 2)}:0..0.2".replace(" ", ",")
    return family.__name__, text, draw.choice(ASKED), push


def positions(model: fork1s.Model, push: str, dt: float, every: int, integrator: str) -> np.ndarray:
    """Origins of all bodies [m] after every `every` steps: (samples, bodies, 3)."""
    simulation = fork1s.Simulation(model, dt=dt, integrator=integrator)
    body, force, _ = push.split(":")
    out = [np.array(simulation.poses)[:, :3]]
    steps = round(SECONDS / dt)
    for step in range(steps):
        if (step + 1) * dt < 0.2 + dt / 2:  # as the program's: a step has the push of its end
            simulation.push(body, [float(x) for x in force.split(",")])
        simulation.step()
        if (step + 1) % every == 0:
            out.append(np.array(simulation.poses)[:, :3])
    return np.array(out)


def try_out(seed: int, program: str, folder: Path) -> dict:
    """What the program told of a seed's model, and the truth."""
    family, text, asked, push = draw_model(seed)
    file = folder / f"{family}{seed}.xml"
    file.write_text(text)
    command = [
        program,
        "run",
        str(file),
        "--time",
        str(SECONDS),
        "--accuracy",
        asked,
        "--push",
        push,
        "--json",
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
    if done.returncode:
        sys.exit(f"{' '.join(command)}: {done.stderr}")
    accuracy = json.loads(done.stdout)["accuracy"]
    chosen, trials = accuracy["chosen"], accuracy["trials"]
    told = next(t for t in trials if all(t[k] == chosen[k] for k in chosen))
    dt, samples = chosen["dt_s"], round(1 / 60 / chosen["dt_s"])
    run = positions(fork1s.load(str(file), modes=chosen["modes"]), push, dt, samples, chosen["integrator"])
    true = positions(
        fork1s.load(str(file), modes=99), push, dt / PARTS, samples * PARTS, chosen["integrator"]
    )
    off = np.linalg.norm(run - true, axis=2).max()
    motion = np.linalg.norm(true - true[0], axis=2).max()
    number = float(asked.rstrip("m%"))
    allowed = number / 100 * motion if asked.endswith("%") else number / 1e3
    return {
        "family": family,
        "seed": seed,
        "asked": asked,
        "asked_mm": 1e3 * allowed,
        "met": int(accuracy["met"]),
        "dt_parts": round(1 / dt / 60),
        "runs": len(trials),
        "told_mm": told["error_mm"],
        "true_mm": 1e3 * off,
    }


def main() -> None:
    """Prints a row a seed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--seeds", type=int, default=42)
    parser.add_argument("--program", default="build/release/bin/fork1s")
    given = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(given.first, given.first + given.seeds):
            row = try_out(seed, given.program, Path(folder))
            if not rows:
                print(",".join(row))
            print(",".join(f"{x:.4g}" if isinstance(x, float) else str(x) for x in row.values()), flush=True)
            rows.append(row)
    met = [row for row in rows if row["met"]]
    beyond = [row["seed"] for row in met if row["true_mm"] > row["asked_mm"]]
    print(f"{len(met)} of {len(rows)} met; farther off than asked: {len(beyond)} {beyond}", file=sys.stderr)


if __name__ == "__main__":
    main()
