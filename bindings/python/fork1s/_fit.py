"""Stiffnesses for a wanted compliance.

With K = diag(k) on the joints of a mechanism at its pose, C(k) is what the bodies feel, and docs/method.md, section 3,
gives y_j, how they move per force along joint j. Then

    ∂C/∂k_j = -y_j y_jᵀ,     so with k_j = exp(x_j)     ∂C/∂x_j = -k_j y_j y_jᵀ,

exactly and from one decomposition for all joints; of tendons and their servos ∂C/∂x_j is a central difference. Logarithms keep stiffnesses positive and make steps relative, since a
spring ten times as stiff and one ten times as soft are as far away.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from . import _core
from ._errors import UnknownNameError, UsageError

Matrix = npt.NDArray[np.float64]

ROUNDING = 1e-12
"""Of C, as a share: a body that turns by less than 1e-6 rad per shift by the length of a link does not turn."""
FELT = 1e-9
"""Of the largest response, or of the compliance: a body that a joint or tendon moves by less does not feel it; rounding is below."""
LOG_STEP = 1e-4
"""Of the logarithm of a stiffness: central differences err by its square over 6, 2e-9, and by rounding over it, 1e-12."""


@dataclass(frozen=True)
class StiffnessFit:
    """Answer of `Model.fit_stiffness`."""

    model: _core.Model
    """With the stiffnesses found."""
    stiffness: dict[str, float]
    """Joint coordinate -> N·m/rad or N/m, of those that were free to change."""
    compliance: dict[str, Matrix]
    """Of each body of the target, (6, 6)."""
    missed: dict[str, Matrix]
    """compliance less target, (6, 6); NaN where the target left an entry open."""
    error: float
    """Largest entry missed, relative to the size of its block of the target: see `fit_stiffness`."""
    reached: bool
    """Whether `error` is within the tolerance."""
    at_bound: list[str]
    """Joints that would go on beyond their bounds."""
    unfelt: list[str] = field(default_factory=list)
    """Joints that no body of the target feels; they keep their stiffness."""
    iterations: int = 0

    def __repr__(self) -> str:
        found = ", ".join(f"{name} {k:.4g}" for name, k in self.stiffness.items())
        said = "reached" if self.reached else f"NOT reached, {100 * self.error:.2g} % off"
        bound = f"; at their bounds: {', '.join(self.at_bound)}" if self.at_bound else ""
        return f"<fork1s.StiffnessFit {said}{bound}: {found}>"


def fit_stiffness(
    model: _core.Model,
    target: npt.ArrayLike | Mapping[str, npt.ArrayLike],
    joints: Sequence[str] | None = None,
    *,
    bounds: tuple[float, float] | Mapping[str, tuple[float, float]] = (0.01, 100.0),
    tolerance: float = 0.01,
) -> StiffnessFit:
    """Stiffnesses of joints with which bodies have a wanted compliance: bounded least squares, exact gradients.

    Args:
        target: body -> its compliance as `Model.compliance` gives it, (6, 6); or that matrix alone where the model has
            one interface body. NaN leaves an entry open. (3, 3) is the translation alone.
        joints: the joint coordinates, tendons and servos of tendons that may change; default: all that something holds.
        bounds: smallest and largest stiffness, as factors of the present one; or for joints by name in N·m/rad or N/m,
            the others within a factor of 100.
        tolerance: of `error`, below which the target counts as reached.

    The error of an entry is measured against the size of its 3x3 block, turn per moment, turn per force or shift per
    force: for blocks on the diagonal their largest wanted entry, for the others the geometric mean of those two; so
    units do not matter. Of a body that only turns, or only shifts, the size of the other block is 1e-12 of this one's,
    by the `length_scale` of the mechanism: more than rounding.

    Returns:
        What was found, what is missed, and which joints stopped at their bounds: more may be asked than the joints can
        give, a softness along a direction in which none of them moves the body, say.

    Raises:
        UnknownNameError, UsageError; UnderdeterminedError where a joint that nothing holds lets a body of the target
        move. ModuleNotFoundError: scipy is missing (`pip install 'fork1s[sweep]'`).
    """
    try:
        from scipy.optimize import least_squares
    except ModuleNotFoundError as missing:
        raise ModuleNotFoundError(
            "fit_stiffness needs scipy: pip install 'fork1s[sweep]'", name=missing.name
        ) from None
    wanted = _wanted(model, target)
    now = model.stiffnesses
    names = [n for n, k in now.items() if k > 0] if joints is None else list(joints)
    for name in names:
        if name not in now:
            raise UnknownNameError(
                f"there is no joint coordinate, tendon or servo of a tendon '{name}'; there are: {', '.join(now)}"
            )
        if not now[name] > 0:
            raise UsageError(
                f"joint '{name}': nothing holds it, so there is no stiffness to begin with; give it one by "
                "with_stiffness"
            )
    parts = [_Part(model, body, target_C) for body, target_C in wanted.items()]
    coordinates = {n for m in model.mechanisms for n in m.coordinates}
    felt = [
        n
        for n in names
        if (
            any(part.feels(model, n) for part in parts)
            if n in coordinates
            else np.abs(_difference(model, n, parts)).max() > FELT
        )
    ]
    if not felt:
        raise UsageError("no body of the target feels any of these joints")
    limits = _limits(bounds, felt, now)
    lower, upper = np.log(np.array(limits)).T

    def at(x: Matrix) -> _core.Model:
        return model.with_stiffness(dict(zip(felt, np.exp(x))))

    def residual(x: Matrix) -> Matrix:
        changed = at(x)
        return np.concatenate([part.residual(changed) for part in parts])

    def slopes(x: Matrix) -> Matrix:
        changed = at(x)
        found = np.vstack([part.slopes(changed, felt, np.exp(x)) for part in parts])
        for j, name in enumerate(felt):
            if name not in coordinates:
                found[:, j] = _difference(changed, name, parts)
        return found

    start = np.clip(np.log([now[n] for n in felt]), lower, upper)
    found = least_squares(
        residual, start, jac=slopes, bounds=(lower, upper), xtol=1e-12, ftol=1e-14, gtol=1e-12, max_nfev=300
    )
    best = at(found.x)
    error = float(np.abs(residual(found.x)).max())
    near = 1e-4
    return StiffnessFit(
        model=best,
        stiffness={n: float(k) for n, k in zip(felt, np.exp(found.x))},
        compliance={part.body: best.compliance(part.body) for part in parts},
        missed={part.body: part.missed(best) for part in parts},
        error=error,
        reached=error <= tolerance,
        at_bound=[n for n, x, a, b in zip(felt, found.x, lower, upper) if x < a + near or x > b - near],
        unfelt=[n for n in names if n not in felt],
        iterations=int(found.nfev),
    )


class _Part:
    """One body: entries of its compliance that are asked for, each in units of its block."""

    def __init__(self, model: _core.Model, body: str, wanted: Matrix) -> None:
        self.body, self.wanted = body, wanted
        rows, columns = np.triu_indices(6)
        asked = ~np.isnan(wanted[rows, columns])
        self.rows, self.columns = rows[asked], columns[asked]
        present = model.compliance(body)
        self.mechanism = next(i for i, m in enumerate(model.mechanisms) if body in m.bodies)
        size = [0.0, 0.0]
        for i, block in enumerate((slice(0, 3), slice(3, 6))):
            for matrix in (wanted, present):
                size[i] = size[i] or float(np.nanmax(np.abs(matrix[block, block]), initial=0.0))
        turn, shift = size if any(size) else (1.0, 1.0)
        # Of a body that only translates, the turns are rounding, by which nothing is measured.
        L2 = model.mechanisms[self.mechanism].length_scale ** 2
        turn, shift = max(turn, ROUNDING * shift / L2), max(shift, ROUNDING * turn * L2)
        root = np.sqrt(np.repeat((turn, shift), 3))
        self.unit = root[self.rows] * root[self.columns]

    def _response(self, model: _core.Model) -> dict[str, Matrix]:
        mechanism = model.mechanisms[self.mechanism]
        return dict(zip(mechanism.coordinates, mechanism.response(self.body).T))

    def feels(self, model: _core.Model, joint: str) -> bool:
        response = self._response(model)
        largest = max((float(np.abs(y).max()) for y in response.values()), default=0.0)
        return joint in response and float(np.abs(response[joint]).max()) > FELT * largest

    def residual(self, model: _core.Model) -> Matrix:
        missed: Matrix = self.missed(model)[self.rows, self.columns] / self.unit
        return missed

    def slopes(self, model: _core.Model, joints: list[str], k: Matrix) -> Matrix:
        response = self._response(model)
        none = np.zeros(6)
        y = np.array([response.get(name, none) for name in joints])
        slopes: Matrix = (-k[:, None] * y[:, self.rows] * y[:, self.columns] / self.unit).T
        return slopes

    def missed(self, model: _core.Model) -> Matrix:
        return model.compliance(self.body) - self.wanted


def _difference(model: _core.Model, name: str, parts: list[_Part]) -> Matrix:
    """Slopes of residuals by the logarithm of one stiffness."""
    k = model.stiffnesses[name]
    ends = [model.with_stiffness({name: k * np.exp(sign * LOG_STEP)}) for sign in (1, -1)]
    more, less = (np.concatenate([part.residual(end) for part in parts]) for end in ends)
    slope: Matrix = (more - less) / (2 * LOG_STEP)
    return slope


def _wanted(model: _core.Model, target: npt.ArrayLike | Mapping[str, npt.ArrayLike]) -> dict[str, Matrix]:
    if not isinstance(target, Mapping):
        interfaces = model.interfaces
        if len(interfaces) != 1:
            raise UsageError(
                f"the model has {len(interfaces)} interface bodies: give the target as a mapping from body to "
                "compliance"
            )
        target = {interfaces[0]: target}
    wanted = {}
    for body, given in target.items():
        C = np.array(given, dtype=float)
        if C.shape == (3, 3):
            C = np.block([[np.full((3, 3), np.nan), np.full((3, 3), np.nan)], [np.full((3, 3), np.nan), C]])
        if C.shape != (6, 6):
            raise UsageError(
                f"target of '{body}': a compliance is (6, 6), or (3, 3) of the translation, not {C.shape}"
            )
        if np.isinf(C).any() or np.isnan(C).all():
            raise UsageError(
                f"target of '{body}': entries are finite, or NaN where they are open, and not all are open"
            )
        C = np.where(np.isnan(C), C.T, C)
        if not np.allclose(C, C.T, rtol=1e-6, atol=1e-9 * np.nanmax(np.abs(C)), equal_nan=True):
            raise UsageError(f"target of '{body}': a compliance is symmetric, and this is not")
        model.compliance(body)  # refuses names that are not there
        wanted[body] = C
    if not wanted:
        raise UsageError("the target names no body")
    return wanted


def _limits(
    bounds: tuple[float, float] | Mapping[str, tuple[float, float]],
    joints: list[str],
    now: Mapping[str, float],
) -> list[tuple[float, float]]:
    if isinstance(bounds, Mapping):
        unknown = set(bounds) - set(now)
        if unknown:
            raise UnknownNameError(
                f"there is no joint coordinate '{sorted(unknown)[0]}'; there are: {', '.join(now)}"
            )
        chosen = [bounds.get(n, (0.01 * now[n], 100 * now[n])) for n in joints]
        limits = [(float(low), float(high)) for low, high in chosen]
    else:
        limits = [(float(bounds[0]) * now[n], float(bounds[1]) * now[n]) for n in joints]
    for name, (low, high) in zip(joints, limits):
        if not (0 < low < high < np.inf):
            raise UsageError(f"bounds of '{name}': 0 < smallest < largest, not {low:g} and {high:g}")
    return limits
