"""A quadruped learns to walk over rough ground: 18 numbers found by CMA-ES, in a few minutes on two cores.

    python examples/learn_quadruped.py [--generations 120] [--out FOLDER]    # trains: FOLDER/quadruped.csv, .json
    python examples/learn_quadruped.py --picture FOLDER                     # draws FOLDER/quadruped.svg of the CSV
    python examples/learn_quadruped.py --test FOLDER                        # FOLDER/quadruped.json on 64 fresh members

Needs fork1s[learn]; the picture needs matplotlib. docs/learning.md tells what came of it.
"""

import argparse
import csv
import json
import time
from pathlib import Path

import cma
import gymnasium
import numpy as np

import fork1s.learn  # noqa: F401 - registers the environments

PER_CANDIDATE = 4  # members, each with stiffness, friction and mass of its own
CANDIDATES = 16
DIAGONAL = np.array([1, -1, -1, 1.0])  # front left, front right, rear left, rear right: a trot
SIDE = np.array([1, -1, 1, -1.0])


def policy(numbers, seen):
    """Actions (n, 12) for observations (n, 50) by the numbers of each member, (n, 18).

    Every leg does the same, the diagonals half a beat apart: each of its three joints takes a constant, the clock's
    sine and cosine, and what leans, rolls and turns the trunk.
    """
    n = len(seen)
    sine, cosine, lean, roll, turn = seen[:, 0], seen[:, 1], seen[:, 2], seen[:, 3], seen[:, 5]
    features = np.empty((n, 4, 6))
    features[..., 0] = 1
    features[..., 1] = sine[:, None] * DIAGONAL
    features[..., 2] = cosine[:, None] * DIAGONAL
    features[..., 3] = lean[:, None]
    features[..., 4] = roll[:, None] * SIDE
    features[..., 5] = turn[:, None] * SIDE
    actions = np.einsum("nlf,njf->nlj", features, numbers.reshape(n, 3, 6))
    actions[..., 0] *= SIDE  # spreading is outward on both sides
    return np.clip(actions.reshape(n, 12), -1, 1)


def episode(environment, numbers, seed):
    """Sum of rewards (n,) up to the first end, and how far each came [m]."""
    seen, _ = environment.reset(seed=seed)
    n = environment.num_envs
    total, going, reached = np.zeros(n), np.ones(n, dtype=bool), np.zeros(n)
    while going.any():
        seen, reward, terminated, truncated, _ = environment.step(policy(numbers, seen))
        total += np.where(going, reward, 0)
        x = environment.unwrapped.members.now.poses["trunk"][:, 0]
        reached = np.where(going, x, reached)
        going &= ~(terminated | truncated)
    return total, reached


def train(generations, out):
    out.mkdir(parents=True, exist_ok=True)
    environment = gymnasium.make_vec("fork1s/Quadruped-v0", num_envs=CANDIDATES * PER_CANDIDATE)
    search = cma.CMAEvolutionStrategy(np.zeros(18), 0.3, {"popsize": CANDIDATES, "seed": 1, "verbose": -9})
    start = time.perf_counter()
    with open(out / "quadruped.csv", "w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(
            ["generation", "seconds", "mean_reward", "best_reward", "mean_distance_m", "best_distance_m"]
        )
        for generation in range(generations):
            candidates = search.ask()
            numbers = np.repeat(candidates, PER_CANDIDATE, axis=0)
            total, reached = episode(environment, numbers, seed=generation)
            score = total.reshape(CANDIDATES, PER_CANDIDATE).mean(axis=1)
            distance = reached.reshape(CANDIDATES, PER_CANDIDATE).mean(axis=1)
            search.tell(candidates, list(-score))
            best = int(score.argmax())
            rows.writerow(
                [
                    generation,
                    f"{time.perf_counter() - start:.1f}",
                    f"{score.mean():.4f}",
                    f"{score[best]:.4f}",
                    f"{distance.mean():.4f}",
                    f"{distance[best]:.4f}",
                ]
            )
            file.flush()
            print(
                f"{generation:3d}  {time.perf_counter() - start:5.0f} s  mean {distance.mean():6.3f} m  "
                f"best {distance[best]:6.3f} m",
                flush=True,
            )
    found = search.result.xfavorite
    (out / "quadruped.json").write_text(json.dumps([round(float(v), 6) for v in found]) + "\n")
    test(out)


def test(out):
    """What was found, on 64 members that nobody trained on."""
    numbers = np.array(json.loads((out / "quadruped.json").read_text()))
    environment = gymnasium.make_vec("fork1s/Quadruped-v0", num_envs=64)
    for name, values in (("standing", np.zeros(18)), ("learnt", numbers)):
        _, reached = episode(environment, np.tile(values, (64, 1)), seed=10_000)
        print(
            f"{name}: {reached.mean():.2f} m in 4 s on average, {reached.min():.2f} to {reached.max():.2f} m of 64"
        )


def picture(out):
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams["svg.hashsalt"] = "fork1s"
    import matplotlib.pyplot as plt

    table = np.genfromtxt(out / "quadruped.csv", delimiter=",", names=True)
    figure, axes = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
    axes.plot(table["seconds"], table["best_distance_m"], label="best of 16 candidates")
    axes.plot(table["seconds"], table["mean_distance_m"], label="mean of 16")
    axes.set(
        xlabel="training [s]",
        ylabel="distance walked in 4 s [m]",
        title="A quadruped learns to walk on rough ground",
    )
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(out / "quadruped.svg", metadata={"Date": None})


if __name__ == "__main__":
    arguments = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    arguments.add_argument("--generations", type=int, default=120)
    arguments.add_argument("--out", type=Path, default=Path("."))
    arguments.add_argument("--picture", type=Path)
    arguments.add_argument("--test", type=Path)
    given = arguments.parse_args()
    if given.picture:
        picture(given.picture)
    elif given.test:
        test(given.test)
    else:
        train(given.generations, given.out)
