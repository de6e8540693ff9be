"""Closed loops in joint space, the rotation of the spacecraft by them, and their motion.

Without momentum the attitude obeys R' = R [omega]x with omega = -D^-1 Dq q', whatever the timing: a
closed loop of the joints turns the spacecraft (E. G. Papadopoulos, "Path planning for space
manipulators exhibiting nonholonomic behavior", IROS 1992). The loops are Fourier series of their
phase, as in R. M. Murray and S. S. Sastry, "Nonholonomic motion planning: steering using
sinusoids", IEEE Transactions on Automatic Control 38 (5), 1993.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from freefloat.dynamics.base_rates import base_rates
from freefloat.errors import InputError
from freefloat.motion.joint_integration import integrate_joints
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.records import Joints
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, frozen

_INTERVALS = 16
"""Intervals of the quadrature per harmonic; a power of two, as products are formed pairwise."""
_GAUSS = np.sqrt(3.0) / 6.0
"""Distance of the two Gauss points of an interval from its middle, over its length."""
_PANELS = 24
"""Panels of a motion per loop and harmonic: their polynomials are exact to 1e-10."""


@dataclass(frozen=True, eq=False)
class JointLoops:
    """A loop of the joints that is closed and travelled several times.

    ``q(s) = q0 + sum over k of a_k (1 - cos k phi) + b_k sin k phi`` with ``phi = 2 pi count s``.

    Attributes:
        joints: q0, at which the loop begins and ends [rad or m], shape (n,).
        cosines: a_1, a_2, ..., shape (K, n).
        sines: b_1, b_2, ..., shape (K, n).
        count: How many times it is travelled.

    Example:
        >>> loop = JointLoops([0.9, 0.7], [[-0.6, 0.0]], [[0.0, 0.6]], 1)
        >>> loop.at(0.5).round(6)
        array([-0.3,  0.7])
    """

    joints: Joints
    cosines: Joints
    sines: Joints
    count: int

    def __post_init__(self) -> None:
        for name in ("joints", "cosines", "sines"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        shapes = self.joints.shape, self.cosines.shape, self.sines.shape
        if self.sines.ndim != 2 or shapes[1:] != 2 * ((len(self.sines), *shapes[0]),):
            raise InputError("loops", f"shapes {shapes} were given", "(n,), (K, n) and (K, n)")

    @property
    def harmonics(self) -> int:
        """Number of harmonics K."""
        return len(self.cosines)

    @cached_property
    def coefficients(self) -> Array:
        """``cosines`` above ``sines``, shape (2 K, n)."""
        return frozen(np.vstack([self.cosines, self.sines]))

    def at(self, s: Any, order: int = 0) -> Array:
        """Joint values, or their derivatives by s, at fractions (...) of the motion: (..., n)."""
        laps = self.count * np.asarray(s, dtype=float)
        phase = 2.0 * np.pi * (laps - np.floor(laps))  # which ends exactly where it begins
        values = phase_basis(phase, self.harmonics, order) @ self.coefficients
        return values * (2.0 * np.pi * self.count) ** order + (self.joints if not order else 0.0)

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        return {
            "count": self.count,
            "joints": self.joints.tolist(),
            "cosines": self.cosines.tolist(),
            "sines": self.sines.tolist(),
        }


def phase_basis(phase: Array, harmonics: int, order: int = 0) -> Array:
    """The functions 1 - cos k phi, then sin k phi, or derivatives by phi, shape (..., 2 K)."""
    k = np.arange(1, harmonics + 1)
    turned = k * phase[..., None] + order * np.pi / 2.0
    cosines = (1.0 if order == 0 else 0.0) - np.cos(turned)
    return np.concatenate([k**order * cosines, k**order * np.sin(turned)], axis=-1)


def loop_rotations(model: FreeFloatingModel, joints: Array, coefficients: Array) -> Array:
    """Rotations of the spacecraft by loops from the same joints, without momentum.

    Magnus expansion of fourth order, with two Gauss points in each interval (A. Iserles, H. Z.
    Munthe-Kaas, S. P. Nørsett and A. Zanna, "Lie-group methods", Acta Numerica, 2000, section 4).

    Args:
        model: Robot.
        joints: Where the loops begin and end, shape (n,).
        coefficients: ``cosines`` above ``sines`` of each, shape (..., 2 K, n).

    Returns:
        Unit quaternions x, y, z, w of the attitudes at the end in the initial spacecraft frame,
        shape (..., 4).
    """
    harmonics = coefficients.shape[-2] // 2
    count = _INTERVALS * (1 << int(np.ceil(np.log2(harmonics))))
    step = 2.0 * np.pi / count
    places = np.arange(count)[:, None] + 0.5 + np.array([-_GAUSS, _GAUSS])
    phase = step * places.ravel()
    values = joints + phase_basis(phase, harmonics) @ coefficients
    omega = base_rates(model, values, phase_basis(phase, harmonics, 1) @ coefficients)
    first, second = omega[..., 0::2, :], omega[..., 1::2, :]
    vectors = step / 2.0 * (first + second) + _GAUSS / 2.0 * step**2 * np.cross(first, second)
    half = np.linalg.norm(vectors, axis=-1, keepdims=True) / 2.0
    factors = np.concatenate([np.sinc(half / np.pi) / 2.0 * vectors, np.cos(half)], axis=-1)
    while factors.shape[-2] > 1:
        factors = _product(factors[..., 0::2, :], factors[..., 1::2, :])
    return np.asarray(factors[..., 0, :])


def _product(p: Array, q: Array) -> Array:
    """Products of quaternions (..., 4)."""
    vector = np.cross(p[..., :3], q[..., :3]) + p[..., 3:] * q[..., :3] + q[..., 3:] * p[..., :3]
    scalar = p[..., 3:] * q[..., 3:] - (p[..., :3] * q[..., :3]).sum(axis=-1, keepdims=True)
    return np.concatenate([vector, scalar], axis=-1)


def integrate_loops(problem: Problem, loops: JointLoops, attitude: Array) -> Motion:
    """The motion along loops, see :func:`~freefloat.motion.joint_integration.integrate_joints`."""
    panels = 4 * -(-_PANELS * loops.count * loops.harmonics // 4)
    return integrate_joints(problem, loops, attitude, panels)
