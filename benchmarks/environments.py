"""Actions a second of the environments for learning, driven by random actions. CSV.

    python benchmarks/environments.py > docs/learning/environments.csv

Needs the package installed (tools/wheel.sh) with its extra `learn`. Medians of five runs of 20 actions each, after 20 that are not
counted, of 256 members on two threads; both integrators take turns.
"""

import statistics
import time

import gymnasium
import numpy as np

import fork1s.learn

COUNT, ACTIONS, THREADS = 256, 20, 2


def seconds(env: gymnasium.vector.VectorEnv, actions: list) -> float:
    start = time.perf_counter()
    for action in actions:
        env.step(action)
    return time.perf_counter() - start


print("environment,integrator,members,threads,actions_a_second,us_an_action")
for task in fork1s.learn.TASKS:
    environments = {
        integrator: gymnasium.make_vec(
            f"fork1s/{task.name}-v0", num_envs=COUNT, threads=THREADS, integrator=integrator
        )
        for integrator in ("two-stage", "euler")
    }
    rng = np.random.default_rng(0)
    spent: dict[str, list[float]] = {integrator: [] for integrator in environments}
    for env in environments.values():
        env.reset(seed=1)
    for repetition in range(6):
        actions = [rng.uniform(-1, 1, (COUNT, task.actions)) for _ in range(ACTIONS)]
        for integrator, env in environments.items():
            took = seconds(env, actions)
            if repetition > 0:
                spent[integrator].append(took)
    for integrator, times in spent.items():
        per_action = statistics.median(times) / (COUNT * ACTIONS)
        print(
            f"{task.name},{integrator},{COUNT},{THREADS},{1 / per_action:.0f},{1e6 * per_action:.1f}",
            flush=True,
        )
