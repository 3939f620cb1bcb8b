#!/usr/bin/env python3
"""One damped mode whose set-point jumps by 1 at t = 0 and is held, in steps of h = 1: how far it goes beyond its
set-point, and its error at the ends of ten steps (rms) beside the closed form. Table of
docs/decisions/001-time-stepping.md, "Controls that jump"; code of its own, of no part of the product."""

import cmath
import math

GAMMA = 1 - 1 / math.sqrt(2)
ONWARD = (1 - GAMMA) / GAMMA


def stage(omega, zeta, x, p, b, u):
    """End of an implicit stage of length b from configuration x and momentum p (mass 1)."""
    v = (p + b * omega**2 * (u - x)) / (1 + 2 * b * zeta * omega + (b * omega) ** 2)
    return x + b * v, v


def two_stages(omega, zeta, x, v, first=1.0):
    x1, v1 = stage(omega, zeta, x, v, GAMMA, first)
    return stage(omega, zeta, x + ONWARD * (x1 - x), v + ONWARD * (v1 - v), GAMMA, 1)


def two_halves(omega, zeta, x, v):
    return stage(omega, zeta, *stage(omega, zeta, x, v, 0.5, 1), 0.5, 1)


def share_in_first_stage(omega, zeta):
    matrix = 1 + 2 * GAMMA * zeta * omega + (GAMMA * omega) ** 2
    stiffness, mass = (GAMMA * omega) ** 2 / matrix, 1 / matrix
    return min(1, (1 - stiffness) / (ONWARD * stiffness * (1 + mass - stiffness)))


def closed_form(omega, zeta, t):
    root = cmath.sqrt(zeta**2 - 1 + 1e-12)  # beside the double root
    a, b = omega * (-zeta + root), omega * (-zeta - root)
    return 1 - ((b * cmath.exp(a * t) - a * cmath.exp(b * t)) / (b - a)).real


def measure(omega, zeta, first_step):
    x, v = first_step(omega, zeta, 0.0, 0.0)
    path = [x]
    for _ in range(39):
        x, v = two_stages(omega, zeta, x, v)
        path.append(x)
    squares = [(path[k] - closed_form(omega, zeta, k + 1)) ** 2 for k in range(10)]
    return max(0, max(path) - 1), math.sqrt(sum(squares) / 10)


def main():
    print(
        "| ω h, damping ratio | one jump: beyond, rms | two halves of backward Euler | part of the jump in the first stage |"
    )
    print("|---|---|---|---|")
    for omega, zeta in ((1, 0.4), (5, 0.4), (10, 1), (30, 3), (100, 0.4)):
        c = share_in_first_stage(omega, zeta)
        ways = (two_stages, two_halves, lambda o, z, x, v, c=c: two_stages(o, z, x, v, c))
        print(
            f"| {omega}, {zeta} | "
            + " | ".join("{:.3f}, {:.3f}".format(*measure(omega, zeta, way)) for way in ways)
            + " |"
        )


if __name__ == "__main__":
    main()
