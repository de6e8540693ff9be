"""Limits of joints: their ranges, rates, accelerations, jerks and torques."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.polynomial import chebyshev

from freefloat.limits.limit import JointLimit, MagnitudeLimit, PerJoint, efforts_along, rates_along
from freefloat.limits.result import LimitResult
from freefloat.motion.extrema import Function, joint_extents
from freefloat.motion.motion import Motion
from freefloat.motion.panels import DEGREE, TO_COEFFICIENTS
from freefloat.motion.setting import Setting
from freefloat.robot.model import range_ratios
from freefloat.so3 import Array, IntArray

Ranges = tuple[Array, Array]
"""Lower and upper ends [rad or m], shape (n,) each."""
_BY_JOINT = "a positive number for all joints, a map from joint to number, or ``urdf``"


class JointRangeLimit(JointLimit[Ranges]):
    """The ranges of the URDF; values are joints, and their ends are allowed [rad or m]."""

    name = "joint_range"
    unit = "rad"
    prismatic_unit = "m"

    @classmethod
    def bound_of(cls, setting: Setting, limits: object) -> Ranges | None:
        """See :class:`~freefloat.limits.limit.Limit`."""
        ranges = setting.model.joint_ranges
        return ranges if np.isfinite(ranges).any() else None

    def worst(self, motion: Motion) -> LimitResult:
        """The joint that is farthest out of its range, or nearest to an end of it."""
        extents, (lower, upper) = joint_extents(motion), self.bound
        below, above = range_ratios(self.bound, extents.low, extents.high)
        joint = int(np.maximum(below, above).argmax())
        if at_least := bool(below[joint] > above[joint]):
            ratio, worst, allowed, places = below, extents.low, lower, extents.low_places
        else:
            ratio, worst, allowed, places = above, extents.high, upper, extents.high_places
        return self.of_joint(
            motion, joint, worst=worst[joint], allowed=allowed[joint], ratio=ratio[joint],
            time=motion.time_at(float(places[joint])), at_least=at_least,
        )  # fmt: skip


class JointRateLimit(MagnitudeLimit):
    """Magnitudes of joint rates."""

    name = "joint_rate"
    unit = "rad/s"
    prismatic_unit = "m/s"
    exponent = 1
    value = PerJoint("rated_speed")
    description = f"Magnitudes of joint rates [rad/s, m/s]: {_BY_JOINT}."

    def worst(self, motion: Motion) -> LimitResult:
        """The joint whose rate is largest over its limit."""
        rates = rates_along(motion)
        nodes = motion.node_rates[..., 3:] if motion.panels else None
        return self.largest(motion, lambda panel, x: rates(panel, x).joints, nodes)


class JointAccelerationLimit(MagnitudeLimit):
    """Magnitudes of joint accelerations."""

    name = "joint_acceleration"
    unit = "rad/s²"
    prismatic_unit = "m/s²"
    exponent = 2
    value = PerJoint("rated_acceleration")
    description = f"Magnitudes of joint accelerations [rad/s², m/s²]: {_BY_JOINT}, of version 1.2."

    def worst(self, motion: Motion) -> LimitResult:
        """The joint whose acceleration is largest over its limit."""
        efforts = efforts_along(motion)
        nodes = motion.node_effort.accelerations[..., 6:]
        return self.largest(motion, lambda panel, x: efforts(panel, x).accelerations[:, 6:], nodes)


class JointJerkLimit(MagnitudeLimit):
    """Magnitudes of joint jerks between the jumps of accelerations."""

    name = "joint_jerk"
    unit = "rad/s³"
    prismatic_unit = "m/s³"
    exponent = 3
    value = PerJoint("rated_jerk")
    description = (
        f"Magnitudes of joint jerks [rad/s³, m/s³]: {_BY_JOINT}, of version 1.2. Jumps of "
        "accelerations, of time laws that have them, do not count."
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


class JointTorqueLimit(MagnitudeLimit):
    """Magnitudes of joint torques and forces."""

    name = "joint_torque"
    unit = "N m"
    prismatic_unit = "N"
    exponent = 2
    value = PerJoint("rated_effort")
    description = f"Magnitudes of joint torques and forces [N m, N]: {_BY_JOINT}."

    def worst(self, motion: Motion) -> LimitResult:
        """The joint whose torque or force is largest over its limit."""
        efforts, nodes = efforts_along(motion), motion.node_effort
        result = self.largest(
            motion, lambda panel, x: efforts(panel, x).joint_torques, nodes.joint_torques
        )
        wrench, torque = (
            float(np.nanmax(np.abs(forces), initial=0.0))
            for forces in (nodes.base_wrench, nodes.joint_torques)
        )
        return replace(result, base_wrench=wrench / torque if torque else None)
