"""Steps that are undone or do not converge where all controls of a model jump at random, twice a second for 4 s.

python benchmarks/random_torques.py MODEL [SEEDS]
"""

import sys

import numpy as np

import fork1s

model = fork1s.load(sys.argv[1])
print("seed,steps,unconverged,undone")
for seed in range(int(sys.argv[2]) if len(sys.argv) > 2 else 20):
    sim = fork1s.Simulation(model, dt=1 / 60)
    random = np.random.default_rng(seed)
    low, high = sim.control_limits.T
    unconverged = undone = 0
    for step in range(240):
        if step % 30 == 0:
            sim.control_values = random.uniform(low, high)
        report = sim.step()
        unconverged += report.unconverged
        undone += not report.finite
    print(f"{seed},{240},{unconverged},{undone}", flush=True)
