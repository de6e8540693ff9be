"""The limit of the joints' ranges."""

from __future__ import annotations

import numpy as np

from freefloat.limits.limit import JointLimit
from freefloat.limits.result import LimitResult
from freefloat.motion.extrema import joint_extents
from freefloat.motion.motion import Motion
from freefloat.motion.setting import Setting
from freefloat.robot.model import range_ratios
from freefloat.so3 import Array

Ranges = tuple[Array, Array]
"""Lower and upper ends [rad or m], shape (n,) each."""


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
