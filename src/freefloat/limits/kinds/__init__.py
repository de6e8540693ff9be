"""All limits, in the order in which they are checked."""

from __future__ import annotations

from typing import Any

from freefloat.limits.kinds.clearance import ClearanceLimit
from freefloat.limits.kinds.end_effector import CorridorLimit, PointingLimits
from freefloat.limits.kinds.joints import (
    JointAccelerationLimit,
    JointJerkLimit,
    JointRangeLimit,
    JointRateLimit,
    JointTorqueLimit,
)
from freefloat.limits.kinds.spacecraft import BaseRateLimit, BaseTurnLimit
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
