"""The limit of joint rates."""

from __future__ import annotations

from freefloat.limits.limit import MagnitudeLimit, PerJoint, rates_along
from freefloat.limits.result import LimitResult
from freefloat.motion.motion import Motion


class JointRateLimit(MagnitudeLimit):
    """Magnitudes of joint rates."""

    name = "joint_rate"
    unit = "rad/s"
    prismatic_unit = "m/s"
    exponent = 1
    value = PerJoint("rated_speed")
    description = (
        "Magnitudes of joint rates [rad/s, m/s]: a positive number for all joints, a map from "
        "joint to number, or ``urdf``."
    )

    def worst(self, motion: Motion) -> LimitResult:
        """The joint whose rate is largest over its limit."""
        rates = rates_along(motion)
        nodes = motion.node_rates[..., 3:] if motion.panels else None
        return self.largest(motion, lambda panel, x: rates(panel, x).joints, nodes)
