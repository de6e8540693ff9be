"""The limit of joint torques."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from freefloat.limits.extremes import efforts_along
from freefloat.limits.joint_limit import MagnitudeLimit
from freefloat.limits.result import LimitResult
from freefloat.limits.values import PerJoint
from freefloat.motion.extrema import Function, at_nodes
from freefloat.motion.motion import Motion
from freefloat.motion.panels import NODES
from freefloat.so3 import Array, IntArray


class JointTorqueLimit(MagnitudeLimit):
    """Magnitudes of joint torques and forces."""

    name = "joint_torque"
    unit = "N m"
    prismatic_unit = "N"
    exponent = 2
    value = PerJoint("rated_effort")
    description = (
        "Magnitudes of joint torques and forces [N m, N]: a number for all joints, a map from "
        "joint to number, or ``urdf``."
    )

    def worst(self, motion: Motion) -> LimitResult:
        """The joint whose torque or force is largest over its limit."""
        forces, count = _forces(motion), len(self.bound)
        nodes = np.empty((0, len(NODES), count + 6))
        if motion.panels:
            nodes = at_nodes(motion, forces)
        torques, wrenches = np.split(nodes, [count], axis=2)
        result = self.largest(motion, lambda panel, x: forces(panel, x)[:, :-6], torques)
        wrench = float(np.nanmax(np.abs(wrenches), initial=0.0))
        torque = float(np.nanmax(np.abs(torques), initial=0.0))
        return replace(result, base_wrench=wrench / torque if torque else None)


def _forces(motion: Motion) -> Function:
    """Joint torques, then the wrench on the base, along a motion, shape (K, n + 6)."""
    efforts = efforts_along(motion)

    def forces(panel: IntArray, x: Array) -> Array:
        effort = efforts(panel, x)
        return np.concatenate([effort.joint_torques, effort.base_wrench], axis=1)

    return forces
