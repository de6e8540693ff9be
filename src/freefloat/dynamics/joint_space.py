"""The joint space, and the extremes of functions of the joints over it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from freefloat.attitude_grids import low_discrepancy
from freefloat.dynamics.measures import SingularityMeasure
from freefloat.dynamics.tasks import Task, required_plane
from freefloat.errors import InputError
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import UPRIGHT, Array, frozen

_JOINT_SAMPLES, _REFINED = 4096, 8
"""Samples of the joint space, and samples from which each extremum is refined."""
_MOST_STEPS, _DIFFERENCE, _FLATTEST = 60, 5e-6, 1e-5
"""Newton's method: largest number of steps, differences [rad or m] of derivatives, and smallest
second derivative, relative to the largest."""
_LONGEST, _SHORTEST, _LEAST_GAIN = 0.5, 1e-7, 1e-12
"""Longest and shortest step [rad or m], and the smallest gain of a step, relative to the scale."""
_FRACTIONS = 4.0 ** np.arange(1.0, -4.0, -1.0)
"""Fractions of Newton's step that are tried."""
Function = Callable[[Array], Any]
"""Function of joint values of shape (n,), or (K, n)."""


@dataclass(frozen=True, eq=False)
class Extremes:
    """Maximum and minimum of a measure over the joint space."""

    largest: float  # maximum S_max
    largest_at: Array = field(repr=False)  # joint values of the maximum, (n,)
    smallest: float  # minimum; negative for determinants
    smallest_at: Array = field(repr=False)  # joint values of the minimum, (n,)

    @property
    def magnitude(self) -> float:
        """Largest magnitude, to which a margin's ``fraction`` refers."""
        return max(abs(self.largest), abs(self.smallest))


def joint_space_extremes(model: FreeFloatingModel, function: Function) -> Extremes:
    """The extremes of a function of the joints over the joint space, see :func:`joint_box`.

    The best points of a low-discrepancy sequence are refined by Newton's method.

    Args:
        model: Robot.
        function: Function of joint values (n,) or (K, n), such as a singularity measure.

    Raises:
        InputError: If a prismatic joint has no finite range.
    """
    points, _ = _sorted_samples(model, function)
    smooth = getattr(function, "smooth", ())  # what approaches a measure with kinks from below
    smallest, smallest_at = _extremum(model, function, points[:_REFINED])
    largest, largest_at = _extremum(model, function, points[-_REFINED:], -1.0, smooth)
    return Extremes(largest, frozen(largest_at), smallest, frozen(smallest_at))


def largest_measure(model: FreeFloatingModel, measure: SingularityMeasure) -> float:
    """:attr:`Extremes.magnitude`, without the slow search for the minimum if none is negative."""
    points, values = _sorted_samples(model, measure)
    largest = abs(_extremum(model, measure, points[-_REFINED:], -1.0, measure.smooth)[0])
    if values[0] >= 0.0:
        return largest
    return max(largest, abs(_extremum(model, measure, points[:_REFINED])[0]))


def sampled_reach(model: FreeFloatingModel, task: Task) -> tuple[float, float]:
    """Smallest and largest distance of the end-effector from the centre of mass that is found [m].

    In the plane for planar tasks; revolute joints may make full revolutions.

    Raises:
        InputError: If a prismatic joint has no finite range.
    """

    def square(joints: Array) -> Array:
        return np.asarray(end_effector_distance(model, task, joints) ** 2)

    extremes = joint_space_extremes(model, square)
    return float(np.sqrt(max(extremes.smallest, 0.0))), float(np.sqrt(extremes.largest))


def end_effector_distance(model: FreeFloatingModel, task: Task, joints: Array) -> Any:
    """Distance of the end-effector from the centre of mass, in the plane for planar tasks [m].

    At joint values (n,) it is a number, at joint values (K, n) its shape is (K,).
    """
    attitudes = np.broadcast_to(UPRIGHT, (*joints.shape[:-1], 4))
    position = model.end_effector_pose(attitudes, joints).position
    if task.planar:
        position = required_plane(model, task).seen(position)[..., :2]
    return np.linalg.norm(position, axis=-1)


def joint_box(
    model: FreeFloatingModel, fixed: Mapping[int, float] | None = None
) -> tuple[Array, Array]:
    """Lower and upper bounds of the joint space: a full revolution or a prismatic joint's range.

    Args:
        model: Robot.
        fixed: Joints with a fixed value, by index; their bounds are one unit to either side.

    Raises:
        InputError: If another prismatic joint has no finite range.
    """
    lower, upper = map(np.copy, model.joint_ranges)
    revolute = ~model.prismatic
    lower[revolute], upper[revolute] = -np.pi, np.pi
    for joint, value in (fixed or {}).items():
        lower[joint], upper[joint] = value - 1.0, value + 1.0
    unbounded = np.flatnonzero(~np.isfinite(upper - lower))
    if len(unbounded):
        joint, source = model.moving_joints[unbounded[0]], model.description.source
        problem = f"it is prismatic, its range is {joint.lower:g} to {joint.upper:g}"
        key, line = f"joint {joint.name}", joint.lines.get("limit")
        raise InputError(key, problem, "a finite range from low to high", source, line)
    return lower, upper


def _sorted_samples(model: FreeFloatingModel, function: Function) -> tuple[Array, Array]:
    """Points of the joint space (K, n) and the function there (K,), in ascending order."""
    lower, upper = joint_box(model)
    points = lower + (upper - lower) * low_discrepancy(_JOINT_SAMPLES, model.dof)
    values = function(points)
    order = np.argsort(values)
    return points[order], values[order]


def _extremum(
    model: FreeFloatingModel, function: Function, starts: Array, sign: float = 1.0,
    smooth: Sequence[Function] = (),
) -> tuple[float, Array]:  # fmt: skip
    """The smallest local minimum of a function from several starts, and its joint values.

    With the sign -1 the largest maximum. On a kink rounding decides where the search ends, so that
    smooth functions lead there.
    """
    scale, ends = sign * (float(np.abs(function(starts)).max()) or 1.0), starts
    for stage in smooth or (function,):
        ends = _minima(model, stage, scale, ends)
    values = function(ends)
    best = (sign * values).argmin()
    return float(values[best]), ends[best]


def _minima(model: FreeFloatingModel, measure: Function, scale: float, points: Array) -> Array:
    """Local minima (K, n) of a function over its scale from points (K, n), by Newton's method.

    Prismatic joints stay in their ranges. All points take a step at a time, the best of several
    along Newton's direction, until none gets lower.
    """
    bounds = zip(model.joint_ranges, (-np.inf, np.inf), strict=True)
    lower, upper = (np.where(model.prismatic, bound, free) for bound, free in bounds)

    def function(joints: Array) -> Array:
        return np.asarray(measure(joints) / scale)

    points, values = points.copy(), function(points)
    left = np.arange(len(points))
    for _ in range(_MOST_STEPS):
        at = points[left]
        gradients, curvatures = _derivatives(function, at, values[left])
        stay = np.where(gradients > 0.0, at <= lower, at >= upper)
        gradients[stay] = 0.0
        curvatures[stay[:, :, None] | stay[:, None, :]] = 0.0
        rates, axes = np.linalg.eigh(curvatures)
        rates = np.maximum(np.abs(rates), _FLATTEST * np.abs(rates).max(axis=1, keepdims=True))
        along = np.einsum("kji,kj->ki", axes, gradients) / np.maximum(rates, _FLATTEST)
        steps = -np.einsum("kij,kj->ki", axes, along)
        steps /= np.maximum(1.0, np.linalg.norm(steps, axis=1, keepdims=True) / _LONGEST)
        trials = np.clip(at + _FRACTIONS[:, None, None] * steps, lower, upper)
        found = function(trials.reshape(-1, at.shape[1])).reshape(len(_FRACTIONS), -1)
        best, every = found.argmin(axis=0), np.arange(len(left))
        lowered = found[best, every] < values[left] - _LEAST_GAIN
        points[left[lowered]] = trials[best, every][lowered]
        values[left[lowered]] = found[best, every][lowered]
        left = left[lowered & (np.abs(steps).max(axis=1) > _SHORTEST)]
        if not len(left):
            break
    return points


def _derivatives(function: Function, points: Array, values: Array) -> tuple[Array, Array]:
    """Gradients (K, n) and second derivatives (K, n, n) of a function by differences."""
    n = points.shape[1]
    first, second = np.triu_indices(n)
    single = _DIFFERENCE * np.eye(n)
    offsets = np.concatenate([single, -single, single[first] + single[second]])
    around = function((points[:, None] + offsets).reshape(-1, n)).reshape(len(points), -1)
    ahead, behind, pairs = np.split(around, (n, 2 * n), axis=1)
    curvatures = np.empty((len(points), n, n))
    mixed = pairs - ahead[:, first] - ahead[:, second] + values[:, None]
    curvatures[:, first, second] = curvatures[:, second, first] = mixed / _DIFFERENCE**2
    return (ahead - behind) / (2.0 * _DIFFERENCE), curvatures
