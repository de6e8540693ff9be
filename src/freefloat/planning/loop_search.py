"""Loops of the joints that turn the spacecraft by a rotation, with the least joint rates.

Unknowns are the Fourier coefficients of a loop. The mean square of the joint rates over their
limits is minimized, subject to the rotation and the joint ranges, by sequential quadratic
programming (D. Kraft's SLSQP in SciPy), whose derivatives of the rotation are differences of many
loops at once.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from freefloat.motion.joint_loops import JointLoops, loop_rotations, phase_basis
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array

_SAMPLES = 24
"""Half the phases per harmonic at which joints keep their ranges."""
_INSIDE = 0.98
"""Fraction of the ranges' half widths that loops may use, for the phases between samples."""
_STEP = 1e-6
"""Step of the differences, of the coefficients [rad, m]."""
_ITERATIONS, _PRECISION = 100, 1e-5
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
    """

    model: FreeFloatingModel = field(repr=False)
    joints: Array
    weights: Array
    harmonics: int
    widened: float = 1.0

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

    def shortest(self, rotation: Rotation, start: Array) -> tuple[float, Array] | None:
        """The loop of the smallest mean square of the rates with a rotation, found from another.

        Args:
            rotation: Of the spacecraft, in its initial frame.
            start: Coefficients from which to search, shape (2 K n,).

        Returns:
            Its effort and coefficients; None where none was found.
        """
        matrix, offsets = self._inequalities
        constraints = [
            {"type": "eq", "fun": lambda c: self.axes @ self._error(c, rotation),
             "jac": lambda c: self._derivative(c, rotation, self.axes)},
            {"type": "ineq", "fun": lambda c: matrix @ c + offsets, "jac": lambda _: matrix},
        ]  # fmt: skip
        weights = self._weights
        found = minimize(
            lambda c: weights @ c**2, start, jac=lambda c: 2.0 * weights * c, method="SLSQP",
            constraints=constraints[: 1 + (len(offsets) > 0)],
            options={"maxiter": _ITERATIONS, "ftol": _PRECISION * (weights @ start**2)},
        )  # fmt: skip
        c = found.x
        if not np.isfinite(c).all() or (matrix @ c + offsets).min(initial=0.0) < -_SOLVED:
            return None
        if np.linalg.norm(self._error(c, rotation)) > _SOLVED:
            return None
        exact = self.corrected(rotation, c)
        return None if exact is None else (self.effort(exact), exact)

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

    @cached_property
    def _inequalities(self) -> tuple[Array, Array]:
        """Matrix and offsets that map coefficients to distances from the ends of ranges."""
        lower, upper = self.ranges
        spare = (1.0 - _INSIDE) * np.minimum((upper - lower) / 2.0, np.pi)
        down = np.minimum(lower + spare - self.joints, 0.0)
        up = np.maximum(upper - spare - self.joints, 0.0)
        values = np.kron(phase_basis(self._phases, self.harmonics), np.eye(len(lower)))
        below, above = (np.tile(side, len(self._phases)) for side in (down, up))
        offsets = np.concatenate([-below, above])
        finite = np.isfinite(offsets)
        return np.vstack([values, -values])[finite], offsets[finite]
