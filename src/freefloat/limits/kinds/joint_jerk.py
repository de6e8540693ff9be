"""The limit of joint jerks, the derivatives of accelerations."""

from __future__ import annotations

import numpy as np

from freefloat.limits.extremes import accelerations_along
from freefloat.limits.joint_limit import MagnitudeLimit
from freefloat.limits.result import LimitResult
from freefloat.limits.values import PerJoint
from freefloat.motion.extrema import Function, at_nodes
from freefloat.motion.motion import Motion
from freefloat.so3 import Array, IntArray

_STEP = 0.02
"""Step of differences in the parameter of a panel, which goes from -1 to 1."""


class JointJerkLimit(MagnitudeLimit):
    """Magnitudes of joint jerks between the jumps of accelerations."""

    name = "joint_jerk"
    unit = "rad/s³"
    prismatic_unit = "m/s³"
    exponent = 3
    value = PerJoint("rated_jerk")
    description = (
        "Magnitudes of joint jerks [rad/s³, m/s³]: a number for all joints, a map from joint to "
        "number, or ``urdf``, of version 1.2. Jumps of accelerations, of time laws that have them, "
        "do not count."
    )

    def worst(self, motion: Motion) -> LimitResult:
        """The joint whose jerk is largest over its limit."""
        jerks = _jerks(motion)
        return self.largest(motion, jerks, at_nodes(motion, jerks) if motion.panels else None)


def _jerks(motion: Motion) -> Function:
    """Joint jerks along a motion, shape (K, n), by differences of fourth order."""
    accelerations = accelerations_along(motion)

    def jerks(panel: IntArray, x: Array) -> Array:
        middle = np.clip(x, -1.0 + 2.0 * _STEP, 1.0 - 2.0 * _STEP)
        offset = ((x - middle) / _STEP)[:, None]
        places = [middle + k * _STEP for k in range(-2, 3)]
        values = np.array([accelerations(panel, place) for place in places])
        times = np.array([motion.at(panel, place)[0] for place in places])[..., None]
        return np.asarray(_slope(values, offset) / _slope(times, offset))

    return jerks


def _slope(values: Array, offset: Array) -> Array:
    """Derivative of the quartic through values (5, K, c) at -2 to 2, at places (K, 1)."""
    before, previous, here, following, after = values
    first = (before - 8.0 * previous + 8.0 * following - after) / 12.0
    second = (-before + 16.0 * (previous + following) - 30.0 * here - after) / 12.0
    third = (after - before - 2.0 * (following - previous)) / 2.0
    fourth = before + after - 4.0 * (previous + following) + 6.0 * here
    s = offset
    return np.asarray(first + s * (second + s * (third / 2.0 + s * fourth / 6.0)))
