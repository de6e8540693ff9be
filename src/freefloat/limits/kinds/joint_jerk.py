"""The limit of joint jerks, the derivatives of accelerations."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import chebyshev

from freefloat.limits.limit import MagnitudeLimit, PerJoint
from freefloat.limits.result import LimitResult
from freefloat.motion.extrema import Function
from freefloat.motion.motion import Motion
from freefloat.motion.panels import DEGREE, TO_COEFFICIENTS
from freefloat.so3 import Array, IntArray


class JointJerkLimit(MagnitudeLimit):
    """Magnitudes of joint jerks between the jumps of accelerations."""

    name = "joint_jerk"
    unit = "rad/s³"
    prismatic_unit = "m/s³"
    exponent = 3
    value = PerJoint("rated_jerk")
    description = (
        "Magnitudes of joint jerks [rad/s³, m/s³]: a positive number for all joints, a map from "
        "joint to number, or ``urdf``, of version 1.2. Jumps of accelerations, of time laws that "
        "have them, do not count."
    )

    def worst(self, motion: Motion) -> LimitResult:
        """The joint whose jerk is largest over its limit."""
        return self.largest(motion, _jerks(motion))


def _jerks(motion: Motion) -> Function:
    """Joint jerks along a motion, shape (K, n): slopes of polynomials through accelerations."""
    accelerations = TO_COEFFICIENTS @ motion.node_effort.accelerations[..., 6:]
    slopes = chebyshev.chebder(accelerations, axis=1)
    pace = chebyshev.chebder(motion.coefficients[:, :, :1], axis=1)

    def jerks(panel: IntArray, x: Array) -> Array:
        basis = chebyshev.chebvander(x, DEGREE - 1)
        rise, passed = (np.einsum("kd,kdc->kc", basis, c[panel]) for c in (slopes, pace))
        return np.asarray(rise / passed)

    return jerks
