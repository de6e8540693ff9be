"""Distances from the centre of mass that singularity curves of planar arms cover.

On a curve S(q1, q2) = 0 the distance R of point 3 is extreme where the gradients of S and R² are
parallel. Newton's method finds these points from the extreme ones of the curve's polygon.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freefloat.singularities.planar_regions import (
    Complex,
    Interval,
    MarginCurve,
    PlanarArm,
    harmonics,
    point_3,
    two_angles,
)
from freefloat.so3 import Array, BoolArray

_STEPS, _FARTHEST = 12, 0.05
"""Steps of Newton's method, and the distance from its start within which a point counts [rad]."""
_ROUNDING = 1e-11
"""Magnitude of a zero of S relative to its largest harmonic."""


def covered_radii(arm: PlanarArm, curves: Sequence[MarginCurve]) -> list[Interval]:
    """Smallest and largest distance of point 3 on each curve of the level zero [m]."""
    S = harmonics(lambda q: arm.determinant(two_angles(arm, q)))
    squares = harmonics(lambda q: np.abs(point_3(arm, q)) ** 2)
    intervals = []
    for curve in curves:
        ends = _refined(S, squares, curve.joints[_extreme(curve.radii)])
        radii = np.concatenate([curve.radii, np.abs(point_3(arm, ends))])
        intervals.append((float(radii.min()), float(radii.max())))
    return intervals


def _extreme(radii: Array) -> BoolArray:
    """Which of successive radii (K,) are at least as large, or small, as both neighbours."""
    steps = np.diff(radii)
    return np.asarray(np.append(0.0, steps) * np.append(steps, 0.0) <= 0.0)


def _refined(S: Complex, squares: Complex, starts: Array) -> Array:
    """Points of a curve S = 0 at which R² is extreme, near starts (K, 2), shape (L, 2)."""
    q = starts
    for _ in range(_STEPS):
        s, s1, s2, s11, s12, s22 = _derivatives(S, q)
        _, r1, r2, r11, r12, r22 = _derivatives(squares, q)
        residuals = np.stack([s, r1 * s2 - r2 * s1], axis=-1)
        rows = (
            (s1, s2),
            (
                r11 * s2 + r1 * s12 - r12 * s1 - r2 * s11,
                r12 * s2 + r1 * s22 - r22 * s1 - r2 * s12,
            ),
        )
        jacobian = np.moveaxis(np.array(rows), -1, 0)
        q = q - (np.linalg.pinv(jacobian) @ residuals[..., None])[..., 0]
    on_curve = np.abs(_derivatives(S, q)[0]) < _ROUNDING * np.abs(S).max()
    return np.asarray(q[on_curve & (np.abs(q - starts).max(axis=1) < _FARTHEST)])


def _derivatives(coefficients: Complex, q: Array) -> list[Array]:
    """A function of q1 and q2 with some harmonics: f, f1, f2, f11, f12, f22 at points (K, 2)."""
    k = np.fft.fftfreq(5, 0.2)
    first, second = np.exp(1j * np.moveaxis(q, -1, 0)[..., None] * k)
    orders = (0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)
    return [
        np.einsum("ka,ab,kb->k", second * (1j * k) ** b, coefficients, first * (1j * k) ** a).real
        for a, b in orders
    ]
