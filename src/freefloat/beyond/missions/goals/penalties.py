"""Joint rates, accelerations and rates of the spacecraft over their limits, with derivatives."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from freefloat.beyond.missions.goals.joint_paths import JointPaths
from freefloat.so3 import Array

_GUARDED_FRACTION = 0.5
"""Fraction of a limit from which a value may violate it after a step."""


class JointValues(NamedTuple):
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
    def along(cls, paths: JointPaths, unknowns: Array, limits: Array, order: int) -> JointValues:
        """Rates (order 1) at the Gauss points, or accelerations (order 2) at the ends of spans."""
        basis, T = paths.gauss[1] if order == 1 else paths.bends, unknowns[-1]
        scales = 1.0 / limits / T**order
        values = basis @ paths.control_points(unknowns) * scales
        by_duration = basis @ paths.fixed[1] * scales - order * values / T
        return cls(values, basis @ paths.spread, scales, by_duration)

    def beyond_limits(self) -> tuple[Array, Array]:
        """How far those near or beyond one are beyond it, with derivatives by the unknowns."""
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

        The blocks of joints are those of one, scaled.
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


def beyond_one(values: Array, jacobian: Array) -> tuple[Array, Array]:
    """How far magnitudes of vectors (G, 3) near or beyond one are beyond it, with derivatives."""
    size = np.linalg.norm(values, axis=1)
    (near,) = np.nonzero(size > _GUARDED_FRACTION)
    directions = values[near] / size[near, None]
    return size[near] - 1.0, np.einsum("gi,gix->gx", directions, jacobian[near])
