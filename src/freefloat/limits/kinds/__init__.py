"""The limits, one module for each."""

from __future__ import annotations

from typing import Any

from freefloat.limits.kinds.base_rate import BaseRateLimit
from freefloat.limits.kinds.base_turn import BaseTurnLimit
from freefloat.limits.kinds.clearance import ClearanceLimit
from freefloat.limits.kinds.corridor import CorridorLimit
from freefloat.limits.kinds.joint_acceleration import JointAccelerationLimit
from freefloat.limits.kinds.joint_jerk import JointJerkLimit
from freefloat.limits.kinds.joint_range import JointRangeLimit
from freefloat.limits.kinds.joint_rate import JointRateLimit
from freefloat.limits.kinds.joint_torque import JointTorqueLimit
from freefloat.limits.kinds.pointing import PointingLimits
from freefloat.limits.limit import Limit

KINDS: tuple[type[Limit[Any]], ...] = (
    CorridorLimit,
    JointRangeLimit,
    JointRateLimit,
    BaseRateLimit,
    BaseTurnLimit,
    PointingLimits,
    ClearanceLimit,
    JointAccelerationLimit,
    JointTorqueLimit,
    JointJerkLimit,
)
"""All limits in the order in which they are checked: the cheapest first."""
