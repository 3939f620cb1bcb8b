"""What the programs in this folder share: the request, the tree of bodies it describes, and the answer.

`fork1s bench` runs PEER.py REQUEST and reads JSON from what it prints.

    request  {"scene": as recordings describe one, "dt": s, "steps": n, "every": steps between samples,
              "bodies": names whose origins are asked for}
    answer   {"version": of the simulator, "step_s": [n], "positions": [sample][body] of [x, y, z],
              "setup": a sentence on how it was set up}
             or {"error": a sentence}

The first sample is the start. A scene that comes here is one tree of hinges and slides on a fixed base, with springs and
dampers at its joints; nothing touches, and no motor runs. Python makes each call a microsecond or two longer.
"""

import json
import sys
import time
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np


@dataclass
class Body:
    name: str
    parent: int  # in the list of bodies; -1: the world
    X_PB: np.ndarray  # 4 x 4, of the body in its parent at the reference
    mass: float
    center: np.ndarray  # in the body
    inertia: np.ndarray  # 3 x 3 about the centre, in the body's axes
    joint: "Joint | None"  # None: welded to its parent


@dataclass
class Joint:
    name: str
    turns: bool  # about the axis; else it slides along it
    axis: np.ndarray  # in the body
    anchor: np.ndarray  # a point of the axis, in the body
    stiffness: float
    damping: float
    armature: float
    rest: float


def pose(value):
    """A 4 x 4 matrix of what the request has."""
    X = np.eye(4)
    X[:3, :3] = np.array(value["R"], dtype=float).reshape(3, 3)
    X[:3, 3] = value["p"]
    return X


def bodies_of(scene):
    """The bodies, parents before children. Body 0 of the mechanism, its base, is the world here."""
    mechanism = scene["mechanisms"][0]
    joint_of = {}
    for j in mechanism["joints"]:
        freedom = j["freedoms"][0]
        screw = np.array(freedom["screw_B"], dtype=float).ravel()
        turns = bool(np.linalg.norm(screw[:3]) > 0.5)
        axis = screw[:3] if turns else screw[3:]
        # v = anchor x axis
        anchor = np.cross(axis, screw[3:]) if turns else np.zeros(3)
        numbers = [float(freedom[k]) for k in ("stiffness", "damping", "armature", "rest")]
        joint_of[j["body"]] = Joint(j["name"], turns, axis, anchor, *numbers)
    X_WR = pose(mechanism["X_WR"])
    bodies = []
    for i, b in enumerate(mechanism["bodies"][1:], start=1):
        X = pose(b["X_PB"])
        inertia = b["inertia"]
        bodies.append(
            Body(
                b["name"],
                b["parent"] - 1,
                X if b["parent"] > 0 else X_WR @ X,
                float(inertia["mass"]),
                np.array(inertia["center"], dtype=float).ravel(),
                np.array(inertia["rotational"], dtype=float).reshape(3, 3),
                joint_of.get(i),
            )
        )
    return bodies


def principal(inertia):
    """Moments of inertia and their axes, a right-handed 3 x 3."""
    moments, axes = np.linalg.eigh(inertia)
    if np.linalg.det(axes) < 0:
        axes[:, 0] = -axes[:, 0]
    return moments, axes


def serve(make):
    """Answers the request by `make(bodies, gravity, dt)`, an object with `name`, `package`, `setup`, `step()` and
    `position(name)`."""
    with open(sys.argv[1], encoding="utf-8") as file:
        request = json.load(file)
    try:
        bodies = bodies_of(request["scene"])
        gravity = np.array(request["scene"]["gravity"], dtype=float).ravel()
        simulator = make(bodies, gravity, request["dt"])
        names = request["bodies"]

        def sample():
            return [[float(x) for x in simulator.position(name)] for name in names]

        positions, step_s = [sample()], []
        for i in range(request["steps"]):
            begin = time.perf_counter()
            simulator.step()
            step_s.append(time.perf_counter() - begin)
            if (i + 1) % request["every"] == 0:
                positions.append(sample())
                if not np.all(np.isfinite(positions[-1])) or np.max(np.abs(positions[-1])) > 1e6:
                    raise ArithmeticError(f"became unstable at {(i + 1) * request['dt']:.4g} s")
        answer = {
            "version": f"{simulator.name} {version(simulator.package)}",
            "setup": simulator.setup,
            "step_s": step_s,
            "positions": positions,
        }
    except Exception as fault:  # whatever a simulator raises is an answer
        answer = {"error": f"{fault}"[:300] or type(fault).__name__}
    json.dump(answer, sys.stdout)
