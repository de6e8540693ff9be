"""Loops of the joints that turn the spacecraft by a rotation, with the least joint rates.

Unknowns are the Fourier coefficients of a loop. The mean square of the joint rates over their
limits is minimized, subject to the rotation, joint ranges and clearances, by sequential quadratic
programming (D. Kraft's SLSQP in SciPy), whose derivatives of the rotation are differences of many
loops at once.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from freefloat.limits.pairs import CollisionPairs
from freefloat.motion.joint_loops import JointLoops, loop_rotations, phase_basis
from freefloat.planning.joints.loop_bounds import LoopBounds, Places
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array

_SAMPLES = 24
"""Half the phases per harmonic at which rates are looked at."""
_ROUNDS = 12
"""Most times that bounds are added."""
_STEP = 1e-6
"""Step of the differences, of the coefficients [rad, m]."""
_MOST_ITERATIONS, _ITERATIONS, _PRECISION = 100, 20, 1e-5
"""Of SLSQP without bounds, and until bounds are added."""
_UNFINISHED = 9
"""SLSQP's status after the last iteration."""
_SOLVED, _EXACT = 1e-3, 1e-12
"""Errors of the rotation from which Newton's method converges, and at which it ends [rad]."""
_NEWTON = 12
_NO_TURN = 1e-9
"""Singular value below which loops do not turn the spacecraft about an axis, over the largest."""


@dataclass(frozen=True, eq=False)
class LoopSearch:
    """Loops from the same joints.

    Attributes:
        model: Robot.
        joints: Where loops begin and end, shape (n,).
        weights: Joint rates [rad/s or m/s] that take the same effort, shape (n,).
        harmonics: Number of harmonics of a loop.
        widened: Factor on the widths of the joint ranges.
        pairs: Pairs of links that keep a clearance; None without one.
        clearance: [m].
    """

    model: FreeFloatingModel = field(repr=False)
    joints: Array
    weights: Array
    harmonics: int
    widened: float = 1.0
    pairs: CollisionPairs | None = field(default=None, repr=False)
    clearance: float = 0.0

    @cached_property
    def ranges(self) -> Array:
        """Lower and upper ends for loops, shape (2, n).

        A joint without range moves half a revolution to either side at most, so that a loop passes
        no configuration twice.
        """
        half = np.where(self.model.prismatic, np.inf, np.pi)
        lower, upper = self.model.joint_ranges
        with np.errstate(invalid="ignore"):
            wider = (self.widened - 1.0) * (upper - lower) / 2.0
        lower, upper = lower - wider, upper + wider
        return np.array([
            np.where(np.isfinite(lower), lower, self.joints - half),
            np.where(np.isfinite(upper), upper, self.joints + half),
        ])  # fmt: skip

    @cached_property
    def bounds(self) -> LoopBounds:
        """Joint ranges and clearances."""
        return LoopBounds(
            self.model, self.joints, self.harmonics, self.ranges, self.pairs, self.clearance
        )

    @cached_property
    def axes(self) -> Array:
        """Orthonormal axes about which loops turn the spacecraft, rows of shape (r, 3)."""
        random = np.random.default_rng(0).normal(size=(4, self._size))
        changes = [self._derivative(row, Rotation.identity(), np.eye(3)) for row in random]
        _, values, axes = np.linalg.svd(np.vstack([change.T for change in changes]))
        return np.asarray(axes[values > _NO_TURN * max(values[0], _NO_TURN)])

    @property
    def rest(self) -> Array:
        """Coefficients of the loop that does not move, (2 K n,)."""
        return np.zeros(self._size)

    def random(self, rng: np.random.Generator) -> Array:
        """Coefficients of a random loop, about as large as the joint ranges permit, (2 K n,)."""
        half = np.minimum(np.diff(self.ranges, axis=0)[0] / 6.0, 1.0)
        shape = (2 * self.harmonics, len(half))
        return np.asarray((half * rng.normal(size=shape) / np.sqrt(self.harmonics)).ravel())

    def mean_square(self, coefficients: Array) -> float:
        """Of the ratios of the joint rates to their weights."""
        return float(self._weights @ coefficients**2)

    def unbounded(self, rotation: Rotation, start: Array) -> Array | None:
        """Coefficients of a loop of the smallest mean square that may leave all bounds; or None."""
        c, _ = self._improved(rotation, start, Places(), _MOST_ITERATIONS)
        return c if np.isfinite(c).all() and self._solved(rotation, c) else None

    def shortest(self, rotation: Rotation, start: Array) -> Array | None:
        """The loop of the smallest mean square of the rates with a rotation, found from another.

        Args:
            rotation: Of the spacecraft, in its initial frame.
            start: Coefficients from which to search, shape (2 K n,).

        Returns:
            Its coefficients; None where none was found.
        """
        places, c = self.bounds.violated(start), start
        for _ in range(_ROUNDS if len(places) else 0):
            c, unfinished = self._improved(rotation, c, places, _ITERATIONS)
            if not np.isfinite(c).all():
                return None
            more = self.bounds.violated(c).without(places)
            if not len(more) and not unfinished:
                break
            places = places + more
        if not self._solved(rotation, c) or len(self.bounds.violated(c)):
            return None
        return self.corrected(rotation, c)

    def _solved(self, rotation: Rotation, coefficients: Array) -> bool:
        return bool(np.linalg.norm(self.axes @ self._error(coefficients, rotation)) < _SOLVED)

    def _improved(
        self, rotation: Rotation, start: Array, places: Places, iterations: int
    ) -> tuple[Array, bool]:
        """Some iterations toward the loop of the smallest mean square that keeps some bounds.

        The unknowns are scaled such that the Hessian of the objective is the identity, with which
        the quasi-Newton method begins.

        Returns:
            Coefficients, and whether more iterations would go on.
        """
        scale = 1.0 / np.sqrt(self._weights)
        constraints = [
            {"type": "eq", "fun": lambda x: self.axes @ self._error(scale * x, rotation),
             "jac": lambda x: self._derivative(scale * x, rotation, self.axes) * scale},
            {"type": "ineq", "fun": lambda x: self.bounds.values(scale * x, places),
             "jac": lambda x: self.bounds.gradients(scale * x, places) * scale},
        ]  # fmt: skip
        found = minimize(
            lambda x: x @ x / 2.0, start / scale, jac=lambda x: x, method="SLSQP",
            constraints=constraints[: 1 + (len(places) > 0)],
            options={"maxiter": iterations, "ftol": _PRECISION * self.mean_square(start)},
        )  # fmt: skip
        return scale * found.x, found.status == _UNFINISHED

    def effort(self, coefficients: Array) -> float:
        """The largest of |dq / dphi| over the weights."""
        series = coefficients.reshape(2 * self.harmonics, -1)
        slopes = phase_basis(self._phases, self.harmonics, 1) @ series
        return float((np.abs(slopes) / self.weights).max())

    def corrected(self, rotation: Rotation, coefficients: Array) -> Array | None:
        """Coefficients nearby that end exactly with a rotation, by Newton's method; or None."""
        for _ in range(_NEWTON):
            error = self.axes @ self._error(coefficients, rotation)
            if np.linalg.norm(error) < _EXACT:
                return coefficients
            J = self._derivative(coefficients, rotation, self.axes)
            coefficients = coefficients - np.linalg.lstsq(J, error)[0]
        return coefficients if np.linalg.norm(error) < 1e3 * _EXACT else None

    def loops(self, coefficients: Array, count: int) -> JointLoops:
        """The record of loops with some coefficients."""
        cosines, sines = np.split(coefficients.reshape(2 * self.harmonics, -1), 2)
        return JointLoops(self.joints, cosines, sines, count)

    @property
    def _size(self) -> int:
        return 2 * self.harmonics * len(self.joints)

    def _error(self, coefficients: Array, rotation: Rotation) -> Array:
        """Rotation vectors (..., 3) from a rotation to those of loops (..., 2 K n)."""
        shape = coefficients.shape[:-1]
        series = coefficients.reshape(*shape, 2 * self.harmonics, -1)
        ends = loop_rotations(self.model, self.joints, series)
        difference = rotation.inv() * Rotation.from_quat(ends.reshape(-1, 4))
        return np.asarray(difference.as_rotvec().reshape(*shape, 3))

    def _derivative(self, coefficients: Array, rotation: Rotation, axes: Array) -> Array:
        """Derivatives of the components of the error along axes (r, 3), shape (r, 2 K n)."""
        steps = np.vstack([np.zeros(self._size), _STEP * np.eye(self._size)])
        errors = self._error(coefficients + steps, rotation) @ axes.T
        return np.asarray((errors[1:] - errors[0]).T / _STEP)

    @cached_property
    def _phases(self) -> Array:
        count = 2 * _SAMPLES * self.harmonics
        return np.asarray(2.0 * np.pi * np.arange(count) / count)

    @cached_property
    def _weights(self) -> Array:
        """Weights of the squared coefficients in the mean square of the ratios, (2 K n,)."""
        squares = np.tile(np.arange(1, self.harmonics + 1) ** 2, 2) / 2.0
        return np.asarray(np.outer(squares, self.weights**-2.0).ravel())
