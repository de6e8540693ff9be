"""Joint paths of a search: splines whose control points depend linearly on few unknowns.

The unknowns are K rows of n joint values and, last, the duration. Between fixed ends they are the
control points, as deviations from the straight way; repeated loops deviate equally. Where the end
is free, a row is the end itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from freefloat.beyond.missions.goals.attitude_kernel import GAUSS, JointCourse, JointSamples, march
from freefloat.beyond.missions.goals.placements import PlacedArm
from freefloat.motion.joint_curves import DEGREE, JointSpline, spline_basis
from freefloat.so3 import Array

INTERVALS, COARSE_INTERVALS = 8, 4
"""Intervals of the quadrature in a span, and where a search begins."""


class Ends(NamedTuple):
    """The joints of a path where it begins and ends."""

    start: Array  # (n,)
    start_rates: Array  # [rad/s or m/s], (n,)
    end: Array | None  # (n,); None where they are free
    end_rates: Array | None  # (n,); None where they are free


@dataclass(frozen=True, eq=False)
class JointPaths:
    """A family of joint paths."""

    ends: Ends
    spans: int = 8  # of a loop, or of the whole path
    loops: int = 1  # number of equal deviations from the straight way
    fineness: int = INTERVALS  # intervals of the quadrature in a span

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.rows * self.joint_count + 1

    @property
    def joint_count(self) -> int:
        """Number of joints n."""
        return len(self.ends.start)

    @property
    def closed(self) -> bool:
        """Whether paths end where they begin."""
        end = self.ends.end
        return end is not None and np.array_equal(self.ends.start, end)

    @property
    def all_spans(self) -> int:
        """Spans of the whole path."""
        return self.spans * self.loops

    @property
    def intervals(self) -> int:
        """Number of intervals of the quadrature."""
        return self.fineness * self.all_spans

    @property
    def rows(self) -> int:
        """Number K of rows of unknowns."""
        return int(self.spread.shape[1])

    @property
    def inner(self) -> int:
        """Number of rows of unknowns that are deviations; the free end is the row after them."""
        return self.spans - (self.loops == 1)

    @cached_property
    def straight(self) -> Array:
        """How far along the straight way the control points are, from 0 to 1, (all_spans + 3,)."""
        inner = np.linspace(0.0, 1.0, self.all_spans + DEGREE - 2)
        return np.concatenate([[0.0], inner, [1.0]])

    @cached_property
    def spread(self) -> Array:
        """Derivatives of the control points by the rows of unknowns, shape (all_spans + 3, K)."""
        inner = np.arange(self.all_spans - 1)
        columns = [np.zeros((self.all_spans + DEGREE, self.inner))]
        columns[0][2 + inner, inner % self.inner] = 1.0
        if self.ends.end is None:
            columns.append(self.straight[:, None])
        if self.ends.end_rates is None:
            last = np.zeros((self.all_spans + DEGREE, 1))
            last[-2] = -1.0
            columns.append(last)
        return np.hstack(columns)

    @cached_property
    def fixed(self) -> Array:
        """Control points without the unknowns, and their derivatives by the duration, (2, ...)."""
        end = np.zeros(self.joint_count) if self.ends.end is None else self.ends.end
        along = self.straight[:, None]
        by_duration = np.zeros((len(along), self.joint_count))
        by_duration[1] = self.ends.start_rates / (DEGREE * self.all_spans)
        if self.ends.end_rates is not None:
            by_duration[-2] = -self.ends.end_rates / (DEGREE * self.all_spans)
        return np.array([(1.0 - along) * self.ends.start + along * end, by_duration])

    @cached_property
    def gauss(self) -> Array:
        """Derivatives of joints and their slopes at the Gauss points by control points."""
        N = self.intervals
        places = (np.arange(N)[:, None] + 0.5 + np.array([-GAUSS, GAUSS])) / N
        return np.array([spline_basis(self.all_spans, places.ravel(), order) for order in (0, 1)])

    @cached_property
    def basis(self) -> Array:
        """Derivatives of joints and slopes at the Gauss points by rows of unknowns, (2, 2 N, K)."""
        return np.ascontiguousarray(self.gauss @ self.spread)

    @cached_property
    def bends(self) -> Array:
        """Derivatives of the joints' second derivatives at the ends of spans by control points.

        Between them these are linear.
        """
        return spline_basis(self.all_spans, np.linspace(0.0, 1.0, self.all_spans + 1), 2)

    @cached_property
    def gram(self) -> Array:
        """Products of the derivatives of slopes by two rows of unknowns, summed, shape (K, K)."""
        return np.asarray(self.basis[1].T @ self.basis[1])

    @cached_property
    def times(self) -> Array:
        """Values of s at the ends of the intervals, shape (N + 1,)."""
        return np.linspace(0.0, 1.0, self.intervals + 1)

    @cached_property
    def edges(self) -> Array:
        """Derivatives of the joints at the ends of the intervals by control points."""
        return spline_basis(self.all_spans, self.times, 0)

    @cached_property
    def edge_basis(self) -> Array:
        """Derivatives of the joints at the ends of intervals by rows of unknowns, (N + 1, K)."""
        return np.asarray(self.edges @ self.spread)

    def control_points(self, unknowns: Array) -> Array:
        """Control points of a path, shape (all_spans + 3, n)."""
        rows = unknowns[:-1].reshape(-1, self.joint_count)
        return np.asarray(self.fixed[0] + unknowns[-1] * self.fixed[1] + self.spread @ rows)

    def repeated(self, unknowns: Array) -> Array:
        """Unknowns of as many loops, each nearly the loop of the given unknowns."""
        between = np.zeros(self.joint_count)
        return np.concatenate([unknowns[:-1], between, unknowns[-1:] * self.loops])

    def spline(self, unknowns: Array) -> JointSpline:
        """The joints along a path."""
        return JointSpline(self.control_points(unknowns))

    def course(
        self, arm: PlacedArm, unknowns: Array, attitude: Array, momenta: Array, order: int = 1
    ) -> JointCourse:
        """Attitudes along a path.

        Args:
            arm: The robot.
            unknowns: Unknowns of the path.
            attitude: Attitude of the spacecraft at the start, shape (3, 3).
            momenta: Momenta of the system, inertial axes, and of wheels [N m s], shape (2, 3).
            order: 1 for derivatives, whose arrays are empty otherwise.
        """
        points = self.control_points(unknowns)
        values = self.gauss @ points
        N, width = values.shape[1] // 2, self.size if order else 0
        attitudes = np.empty((N + 1, 3, 3))
        attitudes[0] = attitude
        turns, slopes = np.zeros((N + 1, 3, width)), np.empty((2 * N, 3, width))
        course = JointCourse(
            unknowns, self.edges @ points, values[1], attitudes, turns, np.empty((2 * N, 3)), slopes
        )
        by_duration = self.gauss @ self.fixed[1]
        samples = JointSamples.of(arm, values, by_duration, self.basis, order)
        march(samples, momenta, course.duration, course, order)
        return course
