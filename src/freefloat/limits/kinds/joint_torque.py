"""The limit of joint torques."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from freefloat.limits.limit import MagnitudeLimit, PerJoint, efforts_along
from freefloat.limits.result import LimitResult
from freefloat.motion.motion import Motion


class JointTorqueLimit(MagnitudeLimit):
    """Magnitudes of joint torques and forces."""

    name = "joint_torque"
    unit = "N m"
    prismatic_unit = "N"
    exponent = 2
    value = PerJoint("rated_effort")
    description = (
        "Magnitudes of joint torques and forces [N m, N]: a positive number for all joints, a map "
        "from joint to number, or ``urdf``."
    )

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
