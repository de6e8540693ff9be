"""Elastic Gauss-Newton method: violations of limits are penalized, the end is reached exactly.

Every iteration solves the quadratic problem of the penalties, whose residuals are linearized,
subject to the linearized end, with a damping that grows where the step does not help; then the end
is corrected (J. Nocedal and S. J. Wright, Numerical Optimization, 2006, sections 10.3, 17.1, 18.3).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from freefloat.beyond.missions.goals.attitude_kernel import JointCourse
from freefloat.beyond.missions.goals.joint_paths import COARSE_INTERVALS, JointPaths
from freefloat.beyond.missions.goals.placements import PlacedArm
from freefloat.beyond.missions.goals.quadratic import WEIGHT_OF_END, Quadratic, SolverBudget
from freefloat.beyond.missions.goals.target import Target
from freefloat.beyond.missions.goals.violations import ShapeLimits
from freefloat.so3 import Array

_LONGEST = 0.5
"""Largest change of a joint in an iteration [rad, m]."""
_STRETCHED = 0.3
"""Largest change of the duration in an iteration, over the duration."""
_LEAST_DAMPING, _MOST_DAMPING = 1e-6, 1e4
_LESS, _MORE = 8.0, 4.0
"""Factors of the damping after a step that helps, and after one that does not."""
_HELPFUL = 0.25
"""Decrease of the merit over the promised one from which a step helps."""
_DAMPING = 0.05
"""Damping at the beginning, over the weight of violations."""
_CLOSED, _CORRECTIONS = 1e-13, 20
"""Residual of the end that is reached exactly, and most corrections of it."""
_RANGE_MARGIN, _RANGE_SCALE = 1e-3, 0.05
"""Margin of joint ranges, and violation that counts as one [rad, m]."""
_SHAPES = 0.1
"""Weight of violations of shapes over the weight of violations of rates."""
_GUARDED_FRACTION = 0.5
"""Fraction of a limit from which a value may violate it after a step."""


class TermWeights(NamedTuple):
    """Weights of what is minimized."""

    effort: float  # of the mean square of joint rates over their limits
    violations: float  # of the squared violations of limits


@dataclass(frozen=True, eq=False)
class Relaxation:
    """A family of paths, what they must reach, and what they must keep."""

    arm: PlacedArm
    paths: JointPaths
    target: Target
    attitude: Array  # of the spacecraft at the start, (3, 3)
    momenta: Array  # of the system and of wheels [N m s], (2, 3)
    joint_rate: Array  # limits, assumed ones of joints without limit [rad/s or m/s], (n,)
    joint_acceleration: Array  # that its limits and, roughly, torques permit [rad/s² or m/s²], (n,)
    base_rate: float  # limit of the spacecraft's rate [rad/s]; infinite without limit
    ranges: Array  # of the joints, (2, n)
    shapes: Sequence[ShapeLimits]  # limits that do not depend on rates
    free_duration: bool  # whether the duration is an unknown
    reference: float  # duration unless it is an unknown, else a guess [s]
    effort: SolverBudget  # work of the search; iterations end where it is spent

    @cached_property
    def coarse(self) -> Relaxation:
        """The relaxation with fewer instants that are looked at, to begin with."""
        return replace(self, paths=replace(self.paths, fineness=COARSE_INTERVALS))

    def course(self, unknowns: Array, order: int = 1) -> JointCourse:
        """The path of some unknowns, with derivatives if the order is 1."""
        return self.paths.course(self.arm, unknowns, self.attitude, self.momenta, order)

    def usage(self, course: JointCourse) -> float:
        """Largest ratio of joint rates and of the spacecraft's rate to their limits."""
        joints = np.abs(course.rates / self.joint_rate).max()
        base = np.linalg.norm(course.omega, axis=1).max() / self.base_rate
        return float(max(joints, base)) / course.duration

    def with_duration(self, unknowns: Array) -> Array:
        """The unknowns with the duration that rates need, unless it is given."""
        if not self.free_duration:
            return np.append(unknowns[:-1], self.reference)
        usage = self.usage(self.course(unknowns, 0))
        return np.append(unknowns[:-1], max(unknowns[-1] * usage, self.reference / 100.0))

    def relaxed(self, unknowns: Array, weights: TermWeights, iterations: int) -> Quadratic:
        """The problem at a path near the least value, from another one."""
        reference, of_end = float(unknowns[-1]), WEIGHT_OF_END
        damping = _DAMPING * weights.violations
        here = self.linearized(unknowns, weights, reference)
        scale = np.ones(self.paths.size)
        scale[-1] = unknowns[-1] ** -2
        eased = 1.0
        for _ in range(iterations):
            damping = max(damping / eased, _LEAST_DAMPING)
            step = here.step(damping, scale)
            of_end = max(of_end, 1.5 * step.multiplier)
            promised = step.gain + of_end * float(np.abs(here.error).sum())
            gain, tried = 0.0, here
            if promised > 0.0:
                start, T = here.course.unknowns, here.course.duration
                change = _shortened(step.change, T)
                error = self.target.error(self.paths, self.course(start + change, 0))
                change = _shortened(change - step.back @ error, T)
                tried = self.linearized(start + change, weights, reference)
                gain = here.merit(of_end) - tried.merit(of_end)
            if gain <= _HELPFUL * max(promised, 0.0):
                damping, eased = _MORE * damping, 1.0
            else:
                eased = _LESS
            here = tried if gain > 0.0 else here
            small = 0.0 < gain < 1e-4 * here.value and np.abs(here.error).max(initial=0.0) < 1e-6
            if small or damping > _MOST_DAMPING or self.effort.spent:
                break
        return here

    def closed(
        self, unknowns: Array, weights: TermWeights, offset: Array | float = 0.0,
        accuracy: float = _CLOSED,
    ) -> Array | None:  # fmt: skip
        """Unknowns nearby whose residuals at the end are the offset; the duration is held."""
        for _ in range(_CORRECTIONS):
            here = self.linearized(unknowns, weights)
            error = here.error - offset
            if np.abs(error).max(initial=0.0) < accuracy:
                return unknowns
            unknowns = unknowns + _shortened(-here.back(_LEAST_DAMPING) @ error, np.inf)
        return unknowns if np.abs(error).max(initial=0.0) < 1e3 * _CLOSED else None

    def linearized(
        self, unknowns: Array, weights: TermWeights, reference: float | None = None
    ) -> Quadratic:
        """The problem at a path; its duration is held unless it is minimized, over a reference."""
        course, paths = self.course(unknowns), self.paths
        self.effort.take(paths.intervals)
        rates = JointValues.along(paths, unknowns, self.joint_rate, 1)
        weight = weights.effort / len(course.omega)
        smooth, gradient, matrix = rates.mean_square(weight, paths)
        beyond = [(np.zeros(0), np.zeros((0, paths.size)))]
        if weights.violations > 0.0:
            beyond += self._beyond_limits(course, rates)
        hinges, slopes = (
            np.sqrt(weights.violations) * np.concatenate(arrays)
            for arrays in zip(*beyond, strict=True)
        )
        error, of_end = self.target.linearized(paths, course)
        if self.free_duration and reference is not None:
            smooth += course.duration / reference
            gradient[-1] += 1.0 / reference
        else:
            gradient[-1], of_end[:, -1], slopes[:, -1] = 0.0, 0.0, 0.0
            matrix[-1], matrix[:, -1] = 0.0, 0.0
            matrix[-1, -1] = 1.0
        return Quadratic(course, smooth, gradient, matrix, hinges, slopes, error, of_end)

    def _beyond_limits(
        self, course: JointCourse, rates: JointValues
    ) -> Iterator[tuple[Array, Array]]:
        """How far a path is beyond limits to which it is near, with derivatives."""
        yield rates.beyond_limits()
        yield from self._beyond_ranges(course)
        if np.isfinite(self.joint_acceleration).any():
            limits = self.joint_acceleration
            yield JointValues.along(self.paths, course.unknowns, limits, 2).beyond_limits()
        if np.isfinite(self.base_rate):
            yield self._beyond_base_rate(course)
        for shape in self.shapes:
            violations = shape.violations(self.paths, course)
            yield _SHAPES * violations.amounts, _SHAPES * violations.jacobian(self.paths, course)

    def _beyond_base_rate(self, course: JointCourse) -> tuple[Array, Array]:
        """How far rates of the spacecraft are beyond their limit or near it, with derivatives."""
        T = course.duration
        base, slopes = course.omega / self.base_rate / T, course.slopes / self.base_rate / T
        slopes[:, :, -1] -= base / T
        size = np.linalg.norm(base, axis=1)
        (near,) = np.nonzero(size > _GUARDED_FRACTION)
        directions = base[near] / size[near, None]
        return size[near] - 1.0, np.einsum("gi,gix->gx", directions, slopes[near])

    def _beyond_ranges(self, course: JointCourse) -> Iterator[tuple[Array, Array]]:
        """How far control points are beyond the joint ranges or near them, with derivatives."""
        paths, (lower, upper) = self.paths, self.ranges
        points, n = paths.control_points(course.unknowns), paths.joint_count
        for sign, over in ((1.0, points - upper), (-1.0, lower - points)):
            i, j = np.nonzero(over > -_LONGEST)
            rows = np.zeros((len(i), paths.rows, n))
            rows[np.arange(len(i)), :, j] = paths.spread[i]
            jacobian = np.column_stack([rows.reshape(len(i), paths.size - 1), paths.fixed[1][i, j]])
            yield (over[i, j] + _RANGE_MARGIN) / _RANGE_SCALE, sign * jacobian / _RANGE_SCALE


def _shortened(step: Array, duration: float) -> Array:
    """The step, shortened where joints or the duration would change too much."""
    joints, time = np.abs(step[:-1]).max() / _LONGEST, abs(step[-1]) / duration / _STRETCHED
    return np.asarray(step / max(joints, time, 1.0))


class JointValues(NamedTuple):
    """Joint rates or accelerations over their limits at G places of a course.

    Each depends on the unknowns of its joint alone, and on the duration.
    """

    values: Array  # (G, n)
    basis: Array  # derivatives of the joints' derivatives by s by the rows of unknowns, (G, K)
    scales: Array  # derivatives of the values by the joints' derivatives by s, (n,)
    by_duration: Array  # derivatives by the duration, (G, n)

    @classmethod
    def along(cls, paths: JointPaths, unknowns: Array, limits: Array, order: int) -> JointValues:
        """Rates (order 1) at the Gauss points, or accelerations (order 2) at the ends of spans."""
        basis, T = paths.gauss[1] if order == 1 else paths.bends, unknowns[-1]
        scales = 1.0 / limits / T**order
        values = basis @ paths.control_points(unknowns) * scales
        by_duration = basis @ paths.fixed[1] * scales - order * values / T
        return cls(values, basis @ paths.spread, scales, by_duration)

    def beyond_limits(self) -> tuple[Array, Array]:
        """How far values near or beyond one are beyond it, with derivatives by the unknowns."""
        place, joint = np.nonzero(np.abs(self.values) > _GUARDED_FRACTION)
        signs, n = np.sign(self.values[place, joint]), len(self.scales)
        rows = np.zeros((len(place), self.basis.shape[1], n))
        slopes = (signs * self.scales[joint])[:, None] * self.basis[place]
        rows[np.arange(len(place)), :, joint] = slopes
        last = signs * self.by_duration[place, joint]
        jacobian = np.column_stack([rows.reshape(len(place), self.basis.shape[1] * n), last])
        return np.abs(self.values[place, joint]) - 1.0, jacobian

    def mean_square(self, weight: float, paths: JointPaths) -> tuple[float, Array, Array]:
        """Half the weighted sum of squares, its gradient and its matrix.

        The blocks of joints are the block of one joint, scaled.
        """
        values, basis, scales, by_duration = self
        K, n = basis.shape[1], len(scales)
        along = np.column_stack([values, by_duration])
        mixed = weight * (basis.T @ along).reshape(K, 2, n) * scales
        gradient = np.append(mixed[:, 0], weight * (by_duration * values).sum())
        matrix = np.zeros((K * n + 1, K * n + 1))
        blocks = np.einsum("kjlj->jkl", matrix[:-1, :-1].reshape(K, n, K, n))
        blocks += weight * (scales**2)[:, None, None] * paths.gram
        matrix[:-1, -1] = matrix[-1, :-1] = mixed[:, 1].ravel()
        matrix[-1, -1] = weight * (by_duration**2).sum()
        return weight * float((values**2).sum()) / 2.0, gradient, matrix
