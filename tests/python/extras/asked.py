"""Metrics that tests of sweeps ask, in a module that workers can import."""

import os
import signal
import time

import fork1s


def deflection(model, point):
    """Of the forearm's end under 1 N, to first order, and in which pose it rests: a real computation of 1 ms."""
    answer = fork1s.statics(model, "forearm", force=[0, 1, 0], gravity=[0, 0, 0])
    return {"moved": float(answer.linear.position[1] - answer.reference[1]), "stable": bool(answer.stable)}


def logged(model, point):
    """The same, and a line in the file that the point names: how often each point was asked."""
    with open(point["log"], "a", encoding="ascii") as log:
        log.write(f"{point['seed']}\n")
    return deflection(model, point)


def slid(model, point):
    """How far a cube is pushed beneath jaws that close, by simulation."""
    sim = fork1s.Simulation(model, dt=1 / 60)
    sim.controls.update({"left_grip": point["grip"], "right_grip": point["grip"]})
    sim.push("cube", force=[point["push"], 0, 0])
    sim.step(4)
    return sim.pose("cube")[0, 3]


def deadly(model, point):
    if point["seed"] == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    if point["seed"] == 5:
        raise ValueError("five is refused")
    return deflection(model, point)


def slow(model, point):
    time.sleep(point.get("wait", 0.0))
    return deflection(model, point)
