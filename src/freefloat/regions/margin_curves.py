"""Singularity and margin curves of planar arms in closed form: (21), (22), (48) to (50).

S of (21a) is a trigonometric polynomial, of the first degree in q2:
S(q1, q2) = k0(q1) + k1(q1) sin q2 + k2(q1) cos q2. So S = S0 has two solutions q2 for each q1 at
which (S0 - k0)² is at most k1² + k2²: (22a) and (22b). They meet at the ends of these intervals.
Here q1 and q2 are the angles of links relative to the ones before, about +z: joint angles where the
joints turn about +z.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import scipy

from freefloat.dynamics.tasks import Task
from freefloat.errors import InputError, finite_number
from freefloat.motion.problem import Problem, require_problem
from freefloat.motion.setting import Setting
from freefloat.regions.planar_regions import (
    Complex,
    Interval,
    PlanarArm,
    elbow_arm,
    has_two_angle_form,
    point_3,
)
from freefloat.so3 import Array, frozen

_STEP = np.radians(0.5)
"""Largest distance of successive points of a curve [rad]."""
_FINE = 2049
"""Points by which the length of a curve is measured."""
_EXACT = 1e-9
"""Accuracy of the parameter of the smallest and the largest distance, on which their errors depend
by the square."""


@dataclass(frozen=True, eq=False)
class TwoAngleDeterminant:
    """The S of a planar arm (21a) whose joints turn about +z, from barycentric vectors and inertia.

    Attributes:
        coefficients: S is the imaginary part of the sum over x and y of
            ``coefficients[x, y] exp(i (x q1 + y q2))`` with x and y from -2 to 2, shape (5, 5);
            coefficients of y = 2 and -2 cancel.
    """

    coefficients: Complex

    @classmethod
    def of(cls, arm: PlanarArm) -> TwoAngleDeterminant:
        """The products of inertia and barycentric vectors, sorted by their angles."""
        turns = np.array([[0, 0], [1, 0], [1, 1]])
        sums = np.zeros((5, 5), dtype=complex)
        for j, first, second in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            area = np.conj(arm.links[first]) * arm.links[second] / 2.0
            for m in range(3):
                moment, turn = arm.inertia[m, j], turns[j] - turns[m]
                for factor, side in ((moment, turn), (np.conj(moment), -turn)):
                    x, y = turns[second] - turns[first] + side
                    sums[x, y] += factor * area
        return cls(sums)

    def k(self, q1: Array) -> tuple[Array, Array, Array]:
        """The paper's k0, k1 and k2 (48) to (50) at first joint angles [rad], each of that shape.

        The letters a, b, c and a_ij of Appendix B stand for an arm whose centres of mass lie on the
        lines between its joints; here they may lie anywhere.
        """
        waves = np.exp(1j * np.multiply.outer(q1, np.fft.fftfreq(5, 0.2)))
        none, up, down = (waves @ self.coefficients[:, y] for y in (0, 1, -1))
        return np.imag(none), np.real(up - down), np.imag(up + down)

    def __call__(self, q1: Array, q2: Array) -> Array:
        """S at joint angles [rad] that are broadcast against one another."""
        k0, k1, k2 = self.k(q1)
        return np.asarray(k0 + k1 * np.sin(q2) + k2 * np.cos(q2))

    def room(self, q1: Array, level: float) -> Array:
        """k1² + k2² - (S0 - k0)²: S reaches the level S0 at an angle q1 unless this is negative."""
        k0, k1, k2 = self.k(q1)
        return np.asarray(k1**2 + k2**2 - (level - k0) ** 2)

    def q2(self, q1: Array, level: float, *, first: bool) -> Array:
        """The solution q2 of (22a), the first one, or of (22b), at angles q1 (K,), continuous."""
        k0, k1, k2 = self.k(q1)
        sine = np.arcsin(np.clip((level - k0) / np.hypot(k1, k2), -1.0, 1.0))
        angle = (np.pi - sine if first else sine) - np.arctan2(k2, k1)
        return np.asarray(np.unwrap(angle))

    def intervals(self, level: float) -> list[Interval]:
        """Intervals of q1 in which S reaches a level [rad], begun in [-pi, pi).

        :meth:`room` is a trigonometric polynomial of degree four; between the angles of the roots
        of its derivative it is monotonic.
        """
        k = np.fft.fftfreq(16, 1.0 / 16).astype(int)
        samples = self.room(np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False), level)
        waves = np.fft.fft(samples, norm="forward")
        slope = np.fft.fftshift(1j * k * waves)[4:13]  # of exp(-4iq1) to exp(4iq1)
        edges = np.sort(np.angle(np.roots(slope[::-1])))
        edges = np.append(edges, edges[:1] + 2.0 * np.pi)
        values = self.room(edges, level)
        roots = [
            float(scipy.optimize.brentq(self.room, a, b, args=(level,), xtol=1e-15))
            for (a, b), (u, v) in zip(pairwise(edges), pairwise(values), strict=True)
            if (u > 0.0) != (v > 0.0)
        ]
        if not roots:
            return [(-np.pi, np.pi)] if values.max() > 0.0 else []
        ends = [*roots, roots[0] + 2.0 * np.pi]
        middles = (np.array(ends[:-1]) + ends[1:]) / 2.0
        parts = zip(pairwise(ends), self.room(middles, level), strict=True)
        return [part for part, room in parts if room > 0.0]


@dataclass(frozen=True, eq=False)
class MarginCurve:
    """One of the two solutions (22) of S(q1, q2) = S0 over an interval of q1.

    Attributes:
        level: S0; zero for singularity curves.
        first: Whether it is (22a), whose singularities lie in the path-dependent area A, not (22b),
            whose singularities lie in B.
        joints: q1 and q2 along the curve [rad], continuous, shape (K, 2).
        radii: Distance of point 3 from the centre of mass [m], shape (K,).
        covered: Smallest and largest distance along the curve, between its points, too [m].
    """

    level: float
    first: bool
    joints: Array = field(repr=False)
    radii: Array = field(repr=False)
    covered: Interval

    @property
    def name(self) -> str:
        """The name of Fig. 2a: I and II for singularity curves, III and IV for margin curves."""
        return {(True, True): "I", (False, True): "II", (True, False): "III"}.get(
            (self.first, self.level == 0.0), "IV"
        )


def margin_curves(problem: Problem, *levels: float) -> tuple[MarginCurve, ...]:
    """The curves S(q1, q2) = S0 of (22a, b): singularity curves I and II, margin curves III and IV.

    Of an elbow arm with a spherical wrist they are the curves of S(q2, q3) (40).

    Args:
        problem: A planar problem whose S depends on two joint angles, or a pose task of an elbow
            arm with a spherical wrist.
        levels: Values S0 of S, the measure ``system``, of elbow arms ``arm``. When left out, zero
            and both signs of the problem's margin.

    Raises:
        InputError: For other arms, or if the margin is one of another measure and no levels are
            given.

    Example:
        >>> problem = ff.load_scenario("planar_3dof/parabola").problem()
        >>> [(curve.name, curve.level) for curve in ff.margin_curves(problem, 0.0, 5.0)]
        [('I', 0.0), ('II', 0.0), ('III', 5.0), ('IV', 5.0)]
    """
    require_problem(problem)
    arm, name = reduced_arm(problem)
    margin = problem.margin
    if not levels:
        if margin.measure.name != name:
            raise InputError("levels", f"the margin is one of {margin.measure.name}", "values of S")
        levels = tuple(dict.fromkeys((0.0, margin.threshold, -margin.threshold)))
    levels = tuple(finite_number("levels", level, "values of S") for level in levels)
    return level_curves(arm, *levels)


def has_regions(setting: Setting) -> bool:
    """Whether a robot has regions: where further arms move, its reach depends on these."""
    return setting.model.has_one_arm


def reduced_arm(setting: Setting) -> tuple[PlanarArm, str]:
    """The planar arm on whose two joint angles S depends, and the name of the measure S.

    Raises:
        InputError: For other arms.
    """
    if has_two_angle_form(setting.model, setting.task):
        return PlanarArm.of(setting.model), "system"
    if setting.task is Task.POSE and has_regions(setting):
        return elbow_arm(setting.model), "arm"
    raise InputError(
        "robot", "S depends on more than two joint angles",
        "a planar arm with as many revolute joints as the task has rows, or for pose tasks an "
        "elbow arm with a spherical wrist",
    )  # fmt: skip


def level_curves(arm: PlanarArm, *levels: float) -> tuple[MarginCurve, ...]:
    """All curves in joint space on which S has one of several values, in closed form.

    Args:
        arm: Planar arm of two joints, or of three with a prescribed orientation.
        levels: Values S0 of S.
    """
    S, sign = TwoAngleDeterminant.of(arm), float(np.prod(arm.signs))
    parts = [(level, interval) for level in levels for interval in S.intervals(sign * level)]
    return tuple(_curve(arm, S, *part, first=first) for part in parts for first in (True, False))


def _curve(
    arm: PlanarArm, S: TwoAngleDeterminant, level: float, interval: Interval, *, first: bool
) -> MarginCurve:
    """The curve over an interval, at points of equal distance."""
    (low, high), sign = interval, float(np.prod(arm.signs))
    whole = high - low == 2.0 * np.pi

    def joints(u: Array) -> Array:
        """At a parameter from 0 to pi; q2 has a vertical tangent at ends that are not the whole."""
        share = u / np.pi if whole else (1.0 - np.cos(u)) / 2.0
        q1 = low + (high - low) * share
        angles = np.stack([q1, S.q2(q1, sign * level, first=first)], axis=-1)
        return np.asarray(arm.signs[:2] * angles)

    u = np.linspace(0.0, np.pi, _FINE)
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(joints(u), axis=0), axis=1)))
    count = max(9, int(np.ceil(length[-1] / _STEP)) + 1)
    places = np.interp(np.linspace(0.0, length[-1], count), length, u)
    q = joints(places)
    radii = np.abs(point_3(arm, q))

    def extreme(sign: float) -> float:
        k = int(np.argmin(sign * radii))
        around = places[max(k - 1, 0)], places[min(k + 1, count - 1)]
        result = scipy.optimize.minimize_scalar(
            lambda u: sign * abs(point_3(arm, joints(np.array([u])))[0]), bounds=around,
            method="bounded", options={"xatol": _EXACT},
        )  # fmt: skip
        return sign * min(float(result.fun), sign * float(radii[k]))

    covered = extreme(1.0), extreme(-1.0)
    return MarginCurve(level, first, frozen(q), frozen(radii), covered)
