"""Gradients of what a run comes to.

By controls over time: every step of the run is linearized, x' = A x + B u, y = P x + Q u with y what the cost adds up,
and from the last step back (adjoint)

    dJ/du_k = Q_k + λ_{k+1} B_k,    λ_k = P_k + λ_{k+1} A_k,    λ = 0 after the last,

so the time it takes grows with the number of steps, of coordinates and of controls, but not with the number of values.
By parameters of the model: central differences of whole runs.
"""

from __future__ import annotations

import copy
import math
import os
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from numbers import Integral
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from . import _core
from ._errors import NumericsError, UnknownNameError, UsageError
from ._sweep_task import model_at

Array = npt.NDArray[np.float64]
Cost = Callable[[_core.Simulation], float]

TO_ROUNDING = 1e-15  # newton_tolerance


class RunSwitch(NamedTuple):
    """A step of a run whose derivative differs by side: `RunGradient.switches`."""

    step: int
    """From 0."""
    of: str
    """Coordinate, rate or input."""
    share: float
    """By which differences to both sides differ."""
    change: str
    """What differs in the steps."""


@dataclass(frozen=True)
class RunGradient:
    """Answer of `run_gradient`."""

    value: float
    """Sum of the cost over all steps."""
    controls: Array
    """(T, m) derivative of the value by each control of each row."""
    inputs: list[str]
    """(m) names of the controls that are differentiated, the columns of `controls`."""
    start: Array
    """(N,) derivative by the state at the start, counted as `LinearizedStep` counts dx."""
    coordinates: list[str]
    """(n) names; `start` has them first, then their rates, then activations."""
    switches: list[RunSwitch]
    """Where the run stands on a switch; the derivative there is the mean of both sides."""
    difference: float
    """Share of the largest part of the derivative along a direction through all controls by which two runs of their own
    differ from it; of what rounding leaves where that is larger. nan where all controls are at their limits."""

    def __repr__(self) -> str:
        switches = f", {len(self.switches)} switches" if self.switches else ""
        return f"<fork1s.RunGradient of {self.controls.shape} controls: {self.value:.6g}{switches}>"


@dataclass(frozen=True)
class ParameterGradient:
    """Answer of `parameter_gradient`."""

    value: Array
    """The metric at the point, of the shape that it has."""
    by: dict[str, Array]
    """Its derivative by each parameter, of the same shape."""
    bends: dict[str, float]
    """Share by which differences to both sides differ, of parameters where it is above 0.01: the metric bends there, or is
    not solved to rounding."""

    def jacobian(self) -> Array:
        """(k, p), of k numbers by the parameters in the order in which they were given."""
        return np.stack([slope.ravel() for slope in self.by.values()], axis=1)

    def __repr__(self) -> str:
        return f"<fork1s.ParameterGradient of {self.value.size} numbers by {', '.join(self.by)}>"


class _Path(NamedTuple):
    """Controls at the end of all steps: of step k share[k] of row row[k], and the rest of the one before."""

    rows: Array  # (T, m)
    columns: list[int]  # of the controls of the simulation
    row: npt.NDArray[np.int64]  # (steps,)
    share: Array  # (steps, 1)
    start: Array  # (m,) before the first row
    move: bool

    def ends(self, rows: Array) -> Array:
        before = np.vstack([self.start, rows])[self.row]
        return np.asarray(self.share * rows[self.row] + (1 - self.share) * before)

    def by_rows(self, by_ends: Array) -> Array:
        """Derivatives by the rows of what has these by the ends of all steps."""
        by = np.zeros((len(self.rows) + 1, by_ends.shape[1]))
        np.add.at(by, self.row + 1, self.share * by_ends)
        np.add.at(by, self.row, (1 - self.share) * by_ends)
        return by[1:]


def run_gradient(
    sim: _core.Simulation,
    cost: Cost,
    controls: npt.ArrayLike | Mapping[str, npt.ArrayLike],
    *,
    inputs: Sequence[str] | None = None,
    steps: int = 1,
    move: bool = False,
    change: float = 1e-6,
    threads: int | None = None,
) -> RunGradient:
    """What a run from the present state on comes to, and its gradient by every control of every row and by the state.

        def height(sim):
            return sim.pose("cube")[2, 3]

        found = fork1s.run_gradient(sim, height, {"grip": np.linspace(0, 0.4, 60)})
        found.value, found.controls                                # m; (60, 1) m per unit of the control

    Through contact, stops and loops, as the steps themselves are: nothing is smoothed. Each step takes
    2 (N + q + 2 m) + 3 more for N of the state, q forces of friction and m inputs, solved to rounding and spread over
    threads (`Simulation.linearize`). By controls beyond their limits the derivative is 0, at a limit that inwards. Pushes are
    left out.

    Args:
        sim: at the start of the run; it is left as it was.
        cost: function of the simulation after a step that returns a number; the value is their sum. It may ask for
            poses, contacts, sensors, controls, `time`, and is to change nothing. It is called by several threads, each
            with a simulation of its own.
        controls: (T, m) rows in the order of `sim.controls`, or a mapping from names to (T,); those that are not named
            keep their values.
        inputs: names of the controls by which to differentiate; default: all that are given. Coordinates of a driven
            base and switches are refused.
        steps: of each row.
        move: controls move linearly from row to row, from those of the last step, instead of being held.
        change: as of `linearize`.
        threads: default: as many as there are cores.

    Raises:
        NumericsError: where a step is not solved.
        UsageError: for controls of other shapes than these.
        UnknownNameError: for names that are not those of controls.
    """
    if not isinstance(steps, Integral) or steps < 1:
        raise UsageError(f"steps = {steps!r}; give a whole number of 1 or more")
    if threads is not None and (not isinstance(threads, Integral) or threads < 1):
        raise UsageError(f"threads = {threads!r}; give a whole number of 1 or more, or None for all cores")
    if isinstance(inputs, str):
        raise UsageError(f"inputs = {inputs!r}; give a sequence of names")
    path = _path_of(sim, controls, steps, move)
    names = list(sim.controls)
    given = [names[i] for i in path.columns]
    if inputs is None:
        inputs = given
    places = _places(inputs, given, "inputs")  # among the columns of the path
    why = {
        "base": "a coordinate of a driven base, whose motion follows from several rows",
        "switch": "a switch, which is on or off",
    }
    for name in inputs:
        if (kind := sim.controls.kind(name)) in why:
            raise UsageError(
                f"inputs: '{name}' is {why[kind]}: it is not differentiated; name the others in `inputs`"
            )
    if not inputs:
        raise UsageError("inputs: there is nothing to differentiate by; name at least one control")

    total = len(path.row)
    # Copies do not record.
    copies = [copy.deepcopy(sim) for _ in range(min(threads or _cores(), total))]
    for copied in copies:
        copied.step(0)  # pending pushes are left out
    moments: list[_core.Snapshot] = []
    costs = _run(copies[0], cost, path, path.rows, moments)
    ends = path.ends(path.rows)
    lower, upper = sim.control_limits[path.columns].T
    free = (ends >= lower) & (ends <= upper)

    def linearize(worker: _core.Simulation, k: int) -> _core.LinearizedStep:
        worker.restore(moments[k])
        _set(worker, path, ends[k])
        return worker.linearize(
            inputs=inputs,
            change=change,
            move=move,
            end=moments[k + 1],
            friction_forces=True,
            start_controls=True,
            outcome=lambda at: _number(cost(at), f"the cost after step {k}"),
        )

    found = _over_threads(copies, linearize, total)
    by_ends = np.zeros((total, len(inputs)))
    costate = np.zeros(found[-1].A.shape[0])
    for k in reversed(range(total)):
        step = found[k]
        by_ends[k] += step.outcome_B[0] + costate @ step.B
        if k > 0:
            by_ends[k - 1] += step.outcome_B_start[0] + costate @ step.B_start
        costate = step.outcome_A[0] + costate @ step.A
    gradient = path.by_rows(by_ends * free[:, places])
    return RunGradient(
        value=float(costs.sum()),
        controls=gradient,
        inputs=list(inputs),
        start=costate[: len(costate) - len(found[0].forces)],
        coordinates=found[0].coordinates,
        switches=[
            RunSwitch(k, s.of, s.share, s.change) for k, step in enumerate(found) for s in step.switches
        ],
        difference=_difference(copies[0], cost, path, places, gradient, moments[0]),
    )


def _cores() -> int:
    return len(os.sched_getaffinity(0))


def _number(value: Any, what: str) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise UsageError(f"{what} is {number}; it has to be a finite number")
    return number


def _path_of(
    sim: _core.Simulation, controls: npt.ArrayLike | Mapping[str, npt.ArrayLike], steps: int, move: bool
) -> _Path:
    names = list(sim.controls)
    if isinstance(controls, Mapping):
        columns = _places(list(controls), names, "controls")
        given = [np.asarray(values, dtype=float) for values in controls.values()]
        for name, values in zip(controls, given, strict=True):
            if values.ndim != 1 or len(values) != len(given[0]):
                raise UsageError(
                    f"controls: '{name}' has the shape {values.shape}; give as many numbers to each, one a row"
                )
        rows = np.stack(given, axis=1) if given else np.empty((0, 0))
    else:
        columns = list(range(len(names)))
        rows = np.array(controls, dtype=float)
        if rows.ndim != 2 or rows.shape[1] != len(names):
            raise UsageError(
                f"controls: the shape is {rows.shape}; it has to be (rows, {len(names)}), a column for each of "
                f"{', '.join(names)}"
            )
    if len(rows) == 0:
        raise UsageError("controls: there is no step to take; give at least one row")
    if not np.isfinite(rows).all():
        raise UsageError("controls: there are numbers that are not finite")
    row, within = np.divmod(np.arange(len(rows) * steps), steps)
    share = (within[:, None] + 1) / steps if move else np.ones((len(row), 1))
    return _Path(rows, columns, row, share, sim.start_controls[columns], move)


def _places(names: Sequence[str], known: Sequence[str], argument: str) -> list[int]:
    for name in names:
        if name not in known:
            raise UnknownNameError(f"{argument}: there is no '{name}'; there are {', '.join(known)}")
    return [known.index(name) for name in names]


def _set(sim: _core.Simulation, path: _Path, values: Array) -> None:
    all_values = sim.control_values
    all_values[path.columns] = values
    sim.control_values = all_values


def _run(
    copied: _core.Simulation,
    cost: Cost,
    path: _Path,
    rows: Array,
    moments: list[_core.Snapshot] | None = None,
) -> Array:
    """(steps,) the cost after each step. `moments` gets all of the run, the first too."""
    costs = np.empty(len(path.row))
    for k, end in enumerate(path.ends(rows)):
        if moments is not None:
            moments.append(copied.save())
        _set(copied, path, end)
        report = copied.step(move=path.move)
        if not report.finite or report.unconverged:
            raise NumericsError(f"step {k} of the run is not solved; shorten the time step")
        costs[k] = _number(cost(copied), f"the cost after step {k}")
    if moments is not None:
        moments.append(copied.save())
    return costs


def _over_threads(
    copies: list[_core.Simulation], work: Callable[[_core.Simulation, int], _core.LinearizedStep], count: int
) -> list[_core.LinearizedStep]:
    """work(simulation, k) for all k, each simulation in a thread of its own."""
    ends_early = threading.Event()

    def share(i: int) -> list[_core.LinearizedStep]:
        done = []
        for k in range(i, count, len(copies)):
            if ends_early.is_set():
                break
            try:
                done.append(work(copies[i], k))
            except BaseException:
                ends_early.set()
                raise
        return done

    with ThreadPoolExecutor(len(copies)) as pool:
        futures = [pool.submit(share, i) for i in range(len(copies))]
        try:
            # By turns, since a signal that meets another thread does not end a wait of this one.
            while wait(futures, timeout=0.05).not_done:
                pass
        except BaseException:
            ends_early.set()
            raise
    shares = [future.result() for future in futures]
    return [shares[k % len(copies)][k // len(copies)] for k in range(count)]


def _difference(
    copied: _core.Simulation,
    cost: Cost,
    path: _Path,
    places: list[int],
    gradient: Array,
    start: _core.Snapshot,
) -> float:
    """Along a direction in which all inputs of all rows change, of changing signs, but those at their limits."""
    change = 1e-6  # to both sides
    rows = path.rows[:, places]
    lower, upper = copied.control_limits[path.columns][places].T
    by = np.random.default_rng(1).choice([-1.0, 1.0], gradient.shape) * np.maximum(1.0, np.abs(rows))
    by *= (rows - change * np.abs(by) >= lower) & (rows + change * np.abs(by) <= upper)
    if not by.any():
        return math.nan
    direction = np.zeros_like(path.rows)
    direction[:, places] = by
    copied.newton_tolerance = TO_ROUNDING
    costs = []
    for side in (1, -1):
        copied.restore(start)
        costs.append(_run(copied, cost, path, path.rows + side * change * direction))
    off = abs(float((costs[0] - costs[1]).sum()) / (2 * change) - float((gradient * by).sum()))
    # Below what rounding leaves of the runs' difference a gradient is none.
    rounding = 1e-14 * float(np.abs(costs[0]).sum()) / change
    scale = max(float(np.abs(gradient * by).max()), rounding)
    return off / scale if scale > 0 else off


def parameter_gradient(
    model: Any,
    metric: Callable[[_core.Model, dict[str, float]], npt.ArrayLike],
    point: Mapping[str, float],
    *,
    change: float = 1e-5,
    threads: int | None = None,
) -> ParameterGradient:
    """A metric of a model and its gradient by parameters, named as in `sweep`: `stiffness:JOINT`, `KIND:NAME.FIELD`.

        def slipped(model, point):
            sim = fork1s.Simulation(model, dt=1 / 60)
            sim.newton_tolerance = 1e-15
            ...
            return distance

        found = fork1s.parameter_gradient("hand.xml", slipped, {"geom:cube.friction": 0.8, "stiffness:thumb": 2.0})
        found.value, found.by["geom:cube.friction"]

    Where the metric is an array, what a recording is missed by at each moment, `found.jacobian()` is what
    `scipy.optimize.least_squares` takes. By central differences: 2 p + 1 calls of the metric for p parameters, spread over threads.

    Args:
        model: what `sweep` takes: a path, text, a `Model`, a `mujoco.MjSpec`, or a function of the parameters.
        metric: function of the model and the point that returns a number or an array of them. Where it takes steps, their
            `newton_tolerance` has to be 1e-15, or differences are those of what is left unsolved.
        point: values of the parameters at which to differentiate.
        change: share of each value by which it is changed; of 0 this number itself.
        threads: default: as many as there are cores.

    Raises:
        UsageError: for a metric that is not finite, or of several shapes; else what the metric raises.
    """
    at = {name: float(value) for name, value in point.items()}
    if not at or not np.isfinite(list(at.values())).all():
        raise UsageError(f"the point is {at}; give at least one parameter, and finite values")
    if not 1e-12 < change < 0.1:
        raise UsageError(f"change = {change}; give a share between 1e-12 and 0.1")
    changes = {name: change * (abs(value) or 1.0) for name, value in at.items()}
    points = [at] + [{**at, name: at[name] + side * changes[name]} for name in at for side in (1, -1)]

    # One after the other, since fields are set in a MjSpec as it is given; the point itself last.
    models = [model_at(model, where) for where in reversed(points)][::-1]

    def value(i: int) -> Array:
        found = np.asarray(metric(models[i], dict(points[i])), dtype=float)
        if found.size == 0 or not np.isfinite(found).all():
            raise UsageError(f"the metric at {points[i]} is {found}; it has to be at least one finite number")
        return found

    with ThreadPoolExecutor(min(threads or _cores(), len(points))) as pool:
        values = list(pool.map(value, range(len(points))))
    for where, found in zip(points, values, strict=True):
        if found.shape != values[0].shape:
            raise UsageError(
                f"the metric at {where} has the shape {found.shape}, at the point {values[0].shape}"
            )
    by, bends = {}, {}
    for i, name in enumerate(at):
        up, down = values[1 + 2 * i], values[2 + 2 * i]
        by[name] = (up - down) / (2 * changes[name])
        moved, bent = np.abs(up - down), np.abs(up - 2 * values[0] + down)
        # What rounding leaves of the largest number is no bend.
        bent = np.where(bent > 1e-12 * np.abs(values[0]).max(), bent, 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = float(np.nan_to_num(bent / moved, nan=0, posinf=math.inf).max())
        if share > 0.01:
            bends[name] = share
    return ParameterGradient(values[0], by, bends)
