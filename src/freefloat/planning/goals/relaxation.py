"""Elastic Gauss-Newton method: violations of limits are penalized, the end is reached exactly.

Every iteration solves the quadratic problem of the penalties, whose residuals are linearized,
subject to the linearized end, with a damping that grows where the step does not help (J. Nocedal
and S. J. Wright, Numerical Optimization, 2006, sections 10.3 and 17.1, 18.4).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from freefloat.planning.goals.effort import Effort
from freefloat.planning.goals.joint_paths import COARSE_INTERVALS, Course, JointPaths
from freefloat.planning.goals.placements import Arm
from freefloat.planning.goals.target import Target
from freefloat.planning.goals.violations import ShapeLimits
from freefloat.so3 import Array

_LONGEST = 0.5
"""Largest change of a joint in an iteration [rad, m]."""
_LEAST_DAMPING, _MOST_DAMPING = 1e-6, 1e4
_DAMPING = 0.05
"""Damping at the beginning, over the weight of violations."""
_WEIGHT_OF_END = 10.0
"""Weight of the residuals of the end in the merit [1/rad, 1/m]."""
_CLOSED = 1e-13
_RANGE_MARGIN = 1e-3
"""Margin of joint ranges, and violation that counts as one [rad, m]."""
_RANGE_SCALE = 0.05
_SHAPES = 0.1
"""Weight of violations of shapes over that of rates."""


class Weights(NamedTuple):
    """Weights of what is minimized.

    Attributes:
        effort: Of the mean square of joint rates over their limits.
        violations: Of the squared violations of limits.
    """

    effort: float
    violations: float


@dataclass(frozen=True, eq=False)
class Quadratic:
    """The problem at a path, linearized: value, gradient and matrix, and the end's residuals."""

    course: Course
    value: float
    gradient: Array
    matrix: Array
    error: Array
    jacobian: Array
    penalty: float

    @property
    def promise(self) -> float:
        """The duration, increased by what is violated [s]."""
        error = float(np.abs(self.error).sum())
        return self.course.duration * (1.0 + self.penalty + _WEIGHT_OF_END * error)

    def merit(self, weight: float) -> float:
        """What steps decrease, with a weight of the end's residuals [1/rad, 1/m]."""
        return self.value + weight * float(np.abs(self.error).sum())

    def step(self, damping: float, scale: Array, *, reduce: bool = True) -> tuple[Array, float]:
        """The step to the minimum subject to the linearized end, or merely to that end."""
        H = self.matrix + np.diag(damping * scale)
        gradient = self.gradient if reduce else np.zeros_like(self.gradient)
        solved = np.linalg.solve(H, np.column_stack([gradient, self.jacobian.T]))
        step, largest = -solved[:, 0], 0.0
        if len(self.error):
            multipliers = np.linalg.lstsq(
                self.jacobian @ solved[:, 1:], self.error + self.jacobian @ step, rcond=1e-10
            )[0]
            step, largest = step - solved[:, 1:] @ multipliers, float(np.abs(multipliers).max())
        return np.asarray(step, dtype=float), largest


@dataclass(frozen=True, eq=False)
class Relaxation:
    """A family of paths, what they must reach, and what they must keep.

    Attributes:
        arm: The robot.
        paths: The family.
        target: What the paths reach.
        attitude: Of the spacecraft at the start, shape (3, 3).
        momenta: Of the system and of wheels [N m s], shape (2, 3).
        joint_rate: Limits of joint rates [rad/s or m/s], shape (n,); infinite without limit.
        joint_acceleration: Accelerations that limits of torques permit, roughly [rad/s² or m/s²],
            shape (n,).
        base_rate: Limit of the spacecraft's rate [rad/s]; infinite without limit.
        ranges: Of the joints, shape (2, n).
        shapes: Limits that do not depend on rates.
        timed: Whether the duration is an unknown.
        reference: Duration unless it is an unknown, else a guess [s].
        effort: Work of the search; iterations end where it is spent.
    """

    arm: Arm
    paths: JointPaths
    target: Target
    attitude: Array
    momenta: Array
    joint_rate: Array
    joint_acceleration: Array
    base_rate: float
    ranges: Array
    shapes: Sequence[ShapeLimits] = ()
    timed: bool = True
    reference: float = 1.0
    effort: Effort = field(default_factory=Effort)

    @cached_property
    def coarse(self) -> Relaxation:
        """The same with fewer instants that are looked at, to begin with."""
        return replace(self, paths=replace(self.paths, fineness=COARSE_INTERVALS))

    def course(self, unknowns: Array, order: int = 1) -> Course:
        """The path of some unknowns, with derivatives if the order is 1."""
        return self.paths.course(self.arm, unknowns, self.attitude, self.momenta, order)

    def usage(self, course: Course) -> float:
        """Largest ratio of joint rates and of the spacecraft's rate to their limits."""
        joints = np.abs(course.rates / self.joint_rate).max()
        base = np.linalg.norm(course.omega, axis=1).max() / self.base_rate
        return float(max(joints, base)) / course.duration

    def relaxed(self, unknowns: Array, weights: Weights, iterations: int) -> Quadratic:
        """The problem at a path near the least value, from another one."""
        reference, of_end = float(unknowns[-1]), _WEIGHT_OF_END
        damping = _DAMPING * weights.violations
        here = self.linearized(unknowns, weights, reference)
        scale = np.ones(self.paths.size)
        scale[-1] = unknowns[-1] ** -2
        for _ in range(iterations):
            step, multiplier = here.step(damping, scale)
            of_end = max(of_end, 1.5 * multiplier)
            step = _shortened(step, here.course.duration)
            there = self.linearized(here.course.unknowns + step, weights, reference)
            gain = here.merit(of_end) - there.merit(of_end)
            if gain > 0.0:
                here, damping = there, max(damping / 4.0, _LEAST_DAMPING)
                if gain < 1e-4 * here.value and np.abs(here.error).max(initial=0.0) < 1e-6:
                    break
            else:
                damping *= 8.0
                if damping > _MOST_DAMPING:
                    break
            if self.effort.spent:
                break
        return here

    def closed(
        self, unknowns: Array, weights: Weights, offset: Array | float = 0.0, iterations: int = 20
    ) -> Array | None:
        """Unknowns nearby with which the end's residuals have some values; the duration is held."""
        scale = np.ones(self.paths.size)
        for _ in range(iterations):
            here = self.linearized(unknowns, weights)
            error = here.error - offset
            if np.abs(error).max(initial=0.0) < _CLOSED:
                return unknowns
            step, _ = replace(here, error=error).step(1e-6, scale, reduce=False)
            unknowns = unknowns + _shortened(step, np.inf)
        return unknowns if np.abs(error).max(initial=0.0) < 1e3 * _CLOSED else None

    def linearized(
        self, unknowns: Array, weights: Weights, reference: float | None = None
    ) -> Quadratic:
        """The problem at a path, with a duration that counts as one; without it is held."""
        course, paths = self.course(unknowns), self.paths
        self.effort.take(paths.intervals)
        sums = _Sums(paths.size)
        rates = _JointValues.along(paths, unknowns, self.joint_rate, 1)
        bends = _JointValues.along(paths, unknowns, self.joint_acceleration, 2)
        sums.add_rates(weights.effort / len(course.omega), rates, paths)
        effort, strong = sums.value, np.sqrt(weights.violations)
        beyond = [rates.beyond_limits(), bends.beyond_limits(), *self._beyond_ranges(course)]
        if np.isfinite(self.base_rate):
            beyond.append(_beyond_one(*self._base_rates(course)))
        for residuals, jacobian in beyond:
            sums.add(strong * residuals, strong * jacobian)
        for shape in self.shapes if strong > 0.0 else ():
            found = shape.violations(paths, course)
            weight = _SHAPES * strong
            sums.add(weight * found.amounts, weight * found.jacobian(paths, course))
        penalty = sums.value - effort
        error, of_end = self.target.linearized(paths, course)
        if self.timed and reference is not None:
            sums.value += course.duration / reference
            sums.gradient[-1] += 1.0 / reference
        else:
            sums.gradient[-1], of_end[:, -1] = 0.0, 0.0
            sums.matrix[-1], sums.matrix[:, -1] = 0.0, 0.0
            sums.matrix[-1, -1] = 1.0
        return Quadratic(course, sums.value, sums.gradient, sums.matrix, error, of_end, penalty)

    def _base_rates(self, course: Course) -> tuple[Array, Array]:
        """Rates of the spacecraft over the limit at the G Gauss points, (G, 3), and derivatives."""
        T = course.duration
        base, slopes = course.omega / self.base_rate / T, course.slopes / self.base_rate / T
        slopes[:, :, -1] -= base / T
        return base, slopes

    def _beyond_ranges(self, course: Course) -> Iterator[tuple[Array, Array]]:
        """How far control points are beyond the joint ranges, with derivatives."""
        paths, (lower, upper) = self.paths, self.ranges
        points, n = paths.control_points(course.unknowns), paths.joint_count
        for sign, over in ((1.0, points - upper), (-1.0, lower - points)):
            i, j = np.nonzero(over > -_RANGE_MARGIN)
            rows = np.zeros((len(i), paths.spread.shape[1], n))
            rows[np.arange(len(i)), :, j] = paths.spread[i]
            jacobian = np.column_stack([rows.reshape(len(i), paths.size - 1), paths.fixed[1][i, j]])
            yield (over[i, j] + _RANGE_MARGIN) / _RANGE_SCALE, sign * jacobian / _RANGE_SCALE


class _JointValues(NamedTuple):
    """Joint rates or accelerations over their limits at G places of a course.

    Each depends on the unknowns of its joint alone, and on the duration.

    Attributes:
        values: Shape (G, n).
        basis: Derivatives of those by s by the rows of unknowns, shape (G, K).
        scales: Derivatives of the values by those by s, shape (n,).
        by_duration: Derivatives by the duration, shape (G, n).
    """

    values: Array
    basis: Array
    scales: Array
    by_duration: Array

    @classmethod
    def along(cls, paths: JointPaths, unknowns: Array, limits: Array, order: int) -> _JointValues:
        """Rates (order 1) at the Gauss points, or accelerations (order 2) at the ends of spans."""
        basis, T = paths.gauss[1] if order == 1 else paths.bends, unknowns[-1]
        scales = 1.0 / limits / T**order
        values = basis @ paths.control_points(unknowns) * scales
        by_duration = basis @ paths.fixed[1] * scales - order * values / T
        return cls(values, basis @ paths.spread, scales, by_duration)

    def beyond_limits(self) -> tuple[Array, Array]:
        """How far those beyond one are, with derivatives by the unknowns."""
        place, joint = np.nonzero(np.abs(self.values) > 1.0)
        signs, n = np.sign(self.values[place, joint]), len(self.scales)
        rows = np.zeros((len(place), self.basis.shape[1], n))
        slopes = (signs * self.scales[joint])[:, None] * self.basis[place]
        rows[np.arange(len(place)), :, joint] = slopes
        last = signs * self.by_duration[place, joint]
        jacobian = np.column_stack([rows.reshape(len(place), self.basis.shape[1] * n), last])
        return np.abs(self.values[place, joint]) - 1.0, jacobian


def _beyond_one(values: Array, jacobian: Array) -> tuple[Array, Array]:
    """How far magnitudes of vectors (G, 3) are beyond one, with derivatives."""
    size = np.linalg.norm(values, axis=1)
    (over,) = np.nonzero(size > 1.0)
    directions = values[over] / size[over, None]
    return size[over] - 1.0, np.einsum("gi,gix->gx", directions, jacobian[over])


def _shortened(step: Array, duration: float) -> Array:
    """The step, shortened where joints or the duration would change too much."""
    joints, time = np.abs(step[:-1]).max() / _LONGEST, abs(step[-1]) / duration / 0.3
    return np.asarray(step / max(joints, time, 1.0))


class _Sums:
    """Half the sum of squared residuals, its gradient and its matrix."""

    def __init__(self, size: int) -> None:
        self.value, self.gradient, self.matrix = 0.0, np.zeros(size), np.zeros((size, size))

    def add(self, residuals: Array, jacobian: Array) -> None:
        """Add residuals (M,) with their derivatives (M, size)."""
        self.value += float(residuals @ residuals) / 2.0
        self.gradient += jacobian.T @ residuals
        self.matrix += jacobian.T @ jacobian

    def add_rates(self, weight: float, rates: _JointValues, paths: JointPaths) -> None:
        """Add joint rates with a weight: the blocks of joints are those of one, scaled."""
        values, basis, scales, by_duration = rates
        K, n = basis.shape[1], len(scales)
        self.value += weight * float((values**2).sum()) / 2.0
        along = np.column_stack([values, by_duration])
        mixed = (basis.T @ along).reshape(K, 2, n) * scales
        self.gradient[:-1] += weight * mixed[:, 0].ravel()
        self.gradient[-1] += weight * float((by_duration * values).sum())
        blocks = np.einsum("kjlj->jkl", self.matrix[:-1, :-1].reshape(K, n, K, n))
        blocks += weight * (scales**2)[:, None, None] * paths.gram
        self.matrix[:-1, -1] += weight * mixed[:, 1].ravel()
        self.matrix[-1, :-1] += weight * mixed[:, 1].ravel()
        self.matrix[-1, -1] += weight * float((by_duration**2).sum())
