"""The limit of joint accelerations."""

from __future__ import annotations

from freefloat.limits.limit import MagnitudeLimit, PerJoint, efforts_along
from freefloat.limits.result import LimitResult
from freefloat.motion.motion import Motion


class JointAccelerationLimit(MagnitudeLimit):
    """Magnitudes of joint accelerations."""

    name = "joint_acceleration"
    unit = "rad/s²"
    prismatic_unit = "m/s²"
    exponent = 2
    value = PerJoint("rated_acceleration")
    description = (
        "Magnitudes of joint accelerations [rad/s², m/s²]: a positive number for all joints, a map "
        "from joint to number, or ``urdf``, of version 1.2."
    )

    def worst(self, motion: Motion) -> LimitResult:
        """The joint whose acceleration is largest over its limit."""
        efforts = efforts_along(motion)
        nodes = motion.node_effort.accelerations[..., 6:]
        return self.largest(motion, lambda panel, x: efforts(panel, x).accelerations[:, 6:], nodes)
