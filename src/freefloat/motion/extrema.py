"""Extrema along a motion: closest approach to a singularity, extents of the joints.

Inside a panel a smooth function is close to the polynomial through its values at the panel's nodes.
The stationary points of that polynomial are candidates, which are refined on the function itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.polynomial import chebyshev

from freefloat.dynamics.measures import SingularityMeasure
from freefloat.errors import require_type
from freefloat.motion.motion import Motion
from freefloat.motion.panels import DEGREE, NODES, TO_COEFFICIENTS
from freefloat.robot.model import shifts_into_ranges
from freefloat.so3 import Array, IntArray

_GRID = chebyshev.chebvander(np.linspace(-1.0, 1.0, 33), DEGREE)
_LAST = 3
"""Number of last Chebyshev coefficients from which the interpolation error is estimated."""
_EQUAL = 1e-13
"""Relative difference of values that is rounding: the one at a node counts."""
_MOST_REFINED = 8
_FINE_GRID = np.linspace(-1.0, 1.0, 65)
_FINE = chebyshev.chebvander(_FINE_GRID, DEGREE)
_ROUNDS = 5
"""Refinements, each by the factor of 32, of an interval in which a minimum lies: more than enough,
as a minimum is flat."""

Function = Callable[[IntArray, Array], Array]
"""Values of c functions, shape (K, c), in panels at their parameters x in [-1, 1], both (K,).
Functions are smooth inside panels and may jump from one to the next, as accelerations do."""


@dataclass(frozen=True)
class Extremum:
    """An extremum of one of several functions along a motion."""

    value: float  # the extreme value; infinite where a function is not finite
    index: int  # index of the function
    panel: int  # panel in which it lies
    x: float  # parameter inside the panel, -1 to 1

    @property
    def u(self) -> float:
        """Panel coordinate, see :meth:`freefloat.motion.motion.Motion.evaluate`."""
        return self.panel + (self.x + 1.0) / 2.0


def at_nodes(motion: Motion, f: Function) -> Array:
    """Values of functions at the nodes of every panel, shape (panels, 9, c)."""
    panels, x = np.repeat(np.arange(motion.panels), DEGREE + 1), np.tile(NODES, motion.panels)
    return f(panels, x).reshape(motion.panels, DEGREE + 1, -1)


def minimum(values: Array, f: Function | None = None) -> Extremum:
    """The smallest value that any of several functions takes along a motion.

    Args:
        values: Values of the functions at the nodes of every panel, see :func:`at_nodes`.
        f: The functions; left out where they are the polynomials through ``values``.
    """
    if not np.isfinite(values).all():
        k, i, c = np.argwhere(~np.isfinite(values))[0]
        return Extremum(-np.inf, int(c), int(k), float(NODES[i]))
    k, i, c = np.unravel_index(int(values.argmin()), values.shape)
    best = Extremum(float(values[k, i, c]), int(c), int(k), float(NODES[i]))
    minima = sorted(_stationary(values, best.value), key=lambda candidate: candidate.value)
    candidates = minima[:_MOST_REFINED]
    refined = candidates if f is None else _refined(f, candidates)
    lowest = min([best, *refined], key=lambda extremum: extremum.value)
    return lowest if lowest.value < best.value - _EQUAL * abs(best.value) else best


def maximum(values: Array, f: Function | None = None) -> Extremum:
    """The largest value that any of several functions takes along a motion; see :func:`minimum`."""
    lowest = minimum(-values, None if f is None else lambda panel, x: -f(panel, x))
    return replace(lowest, value=-lowest.value)


def _first_below(values: Array, f: Function, level: float) -> float | None:
    """Panel coordinate at which a continuous function first falls below a level, or None.

    ``values`` are the values at the nodes of every panel, shape (panels, 9, 1).
    """
    if values[0, 0, 0] < level:
        return 0.0
    low = (len(values), -1.0)  # panel and parameter of the first known point below the level
    below = np.argwhere(values[:, :, 0] < level)
    if len(below):
        low = int(below[0, 0]), float(NODES[below[0, 1]])
    earlier = [entry for entry in _stationary(values, level) if (entry.panel, entry.x) < low]
    refined = [entry for entry in _refined(f, earlier) if entry.value < level]
    panel, x = min([low, *((entry.panel, entry.x) for entry in refined)])
    if panel == len(values):
        return None
    before = float(NODES[(x > NODES) & (values[panel, :, 0] >= level)][-1])

    def excess(x: float) -> float:
        return float(f(np.array([panel]), np.array([x]))[0, 0]) - level

    if excess(x) < 0.0 <= excess(before):  # else the two differ by rounding alone
        x = float(scipy.optimize.brentq(excess, before, x, xtol=1e-13))
    return panel + (x + 1.0) / 2.0


def _stationary(values: Array, level: float) -> list[Extremum]:
    """Minima inside panels that may lie below a level.

    They are minima of the polynomials through the values at the nodes (panels, 9, c); their error
    is estimated from the last coefficients of the polynomials.
    """
    coefficients = np.einsum("in,knc->kic", TO_COEFFICIENTS, values)
    lowest = np.einsum("gi,kic->kgc", _GRID, coefficients).min(axis=1)
    errors = 4.0 * np.abs(coefficients[:, -_LAST:]).sum(axis=1)
    slack = errors + 0.01 * np.ptp(values, axis=1)  # the second: of the grid
    minima = []
    for panel, index in np.argwhere(lowest - slack <= level):
        c = coefficients[panel, :, index]
        error = float(errors[panel, index])
        slope = chebyshev.chebder(c)
        if not slope[1:].any():
            continue
        roots = chebyshev.chebroots(slope)
        x = roots.real[(np.abs(roots.imag) < 1e-6) & (np.abs(roots.real) < 1.0)]
        x = x[chebyshev.chebval(x, chebyshev.chebder(c, 2)) >= 0.0]
        for position, value in zip(x.tolist(), chebyshev.chebval(x, c).tolist(), strict=True):
            if value - error <= level:
                minima.append(Extremum(value, int(index), int(panel), position))
    return minima


def _refined(f: Function, candidates: Sequence[Extremum]) -> list[Extremum]:
    """The minima of the functions themselves between the nodes around each of C candidates.

    They are found with polynomials through values at nodes in intervals, which become smaller.
    """
    if not candidates:
        return []
    rows = np.arange(len(candidates))
    panel, index = np.array([(entry.panel, entry.index) for entry in candidates]).T
    x = np.array([entry.x for entry in candidates])
    nearest = np.abs(NODES - x[:, None]).argmin(axis=1)
    low, high = NODES[np.maximum(nearest - 1, 0)], NODES[np.minimum(nearest + 1, DEGREE)]
    value, (first, last) = np.full(len(rows), np.inf), (low, high)
    for _ in range(_ROUNDS):
        places = (low + high)[:, None] / 2.0 + (high - low)[:, None] / 2.0 * NODES
        values = f(np.repeat(panel, len(NODES)), places.ravel()).reshape(*places.shape, -1)
        samples = values[rows, :, index]
        least = samples.argmin(axis=1)
        lower = samples[rows, least] < value
        value = np.where(lower, samples[rows, least], value)
        x = np.where(lower, places[rows, least], x)
        along = np.einsum("gi,ci->cg", _FINE @ TO_COEFFICIENTS, samples).argmin(axis=1)
        middle = (low + high) / 2.0 + (high - low) / 2.0 * _FINE_GRID[along]
        width = (high - low) / len(_FINE_GRID)
        low, high = np.maximum(middle - width, first), np.minimum(middle + width, last)
    entries = zip(value.tolist(), index.tolist(), panel.tolist(), x.tolist(), strict=True)
    return [Extremum(*entry) for entry in entries]


@dataclass(frozen=True)
class ClosestApproach:
    """The smallest magnitude of a singularity measure along a motion.

    Attributes:
        measure: Name of the measure.
        value: The magnitude; zero where the measure changes sign.
        sign: Sign of the measure at the start, 1 or -1.
        time: Time of the smallest magnitude [s].
    """

    measure: str
    value: float
    sign: int
    time: float

    def to_dict(self) -> dict[str, Any]:
        """The record as a JSON document."""
        return asdict(self)


def closest_approach(motion: Motion, measure: SingularityMeasure) -> ClosestApproach:
    """The smallest magnitude of a singularity measure of a robot along its motion.

    Raises:
        InputError: If an argument is of another type.

    Example:
        >>> problem = ff.load_scenario("planar_3dof/parabola").problem()
        >>> motion = ff.simulate(problem, [0.0, 0.0, 1.0, 0.0]).chosen.motion
        >>> closest = ff.closest_approach(motion, problem.margin.measure)
        >>> print(f"{closest.value:.3f} at {closest.time:.2f} s")
        39.050 at 49.25 s
    """
    require_type("motion", motion, Motion, "a Motion, such as simulate(...).chosen.motion")
    accepted = "singularity_measure(model, task, name), or margin.measure"
    require_type("measure", measure, SingularityMeasure, accepted)
    profile, values, sign = _profile(motion, measure)
    if not motion.panels:
        u, value = 0.0, sign * float(measure(motion.joints[0]))
    elif (crossing := _first_below(values, profile, 0.0)) is not None:
        u, value = crossing, 0.0
    else:
        lowest = minimum(values, profile)
        u, value = lowest.u, lowest.value
    return ClosestApproach(measure.name, abs(value), sign, motion.time_at(u))  # not -0.0


def first_crossing(motion: Motion, f: Callable[[Array], Array], level: float) -> float | None:
    """Panel coordinate at which a function of the joints first changes sign or falls below a level.

    The function of joint values (K, n) has the shape (K,); None where it keeps its sign and that
    magnitude.
    """
    if not motion.panels:
        return 0.0 if abs(f(motion.joints)[0]) < level else None
    profile, values, _ = _profile(motion, f)
    return _first_below(values, profile, level)


def _profile(motion: Motion, f: Callable[[Array], Array]) -> tuple[Function, Array, int]:
    """A function of the joints made positive at the start, its values at the nodes, its sign."""
    values = f(motion.joints)
    sign = -1 if values[0] < 0.0 else 1

    def profile(panel: IntArray, x: Array) -> Array:
        return sign * f(motion.at(panel, x)[2])[:, None]

    return profile, sign * values[motion.panel_nodes][:, :, None], sign


class JointExtents(NamedTuple):
    """Minima and maxima of every joint along a motion [rad or m], and their places, (n,) each.

    Places are panel coordinates, see :meth:`freefloat.motion.motion.Motion.evaluate`.
    """

    low: Array
    high: Array
    low_places: Array
    high_places: Array


def joint_extents(motion: Motion) -> JointExtents:
    """Minimum and maximum of every joint along a motion."""
    n = motion.joints.shape[1]
    if not motion.panels:
        return JointExtents(motion.joints[0], motion.joints[0], np.zeros(n), np.zeros(n))
    joints = np.split(motion.joints[motion.panel_nodes], n, axis=2)
    extrema = [[search(values) for values in joints] for search in (minimum, maximum)]
    values = [np.array([extremum.value for extremum in row]) for row in extrema]
    places = [np.array([extremum.u for extremum in row]) for row in extrema]
    return JointExtents(*values, *places)


def unwrapped(motion: Motion) -> Motion:
    """The same motion with its revolute joints shifted by multiples of 2 pi into their ranges.

    A joint is shifted by as few revolutions as put all of the motion inside its range; where none
    do, by those that leave the smallest excess. Nothing else of the motion changes, nor do joint
    curves of further arms.
    """
    model, extents = motion.model, joint_extents(motion)
    shifts = shifts_into_ranges(model, extents.low, extents.high)
    shifts[motion.setting.dof :] = 0.0  # joint curves are kept
    return replace(motion, joints=motion.joints + shifts) if shifts.any() else motion
