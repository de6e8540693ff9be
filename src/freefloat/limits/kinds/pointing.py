"""The limits of where axes of the robot point."""

from __future__ import annotations

import numpy as np

from freefloat.limits.limit import Axes, Limit, place_of_maximum
from freefloat.limits.result import LimitResult
from freefloat.motion.motion import Motion
from freefloat.motion.pointing import Keep, PointingLimit, angle_of
from freefloat.motion.setting import Setting
from freefloat.so3 import Array, IntArray


class PointingLimits(Limit[tuple[PointingLimit, ...]]):
    """Axes that stay inside or outside cones."""

    name = "pointing"
    unit = "rad"
    of_attitude = True
    value = Axes()
    description = "Axes of links that stay inside or outside cones."

    @classmethod
    def bound_of(cls, setting: Setting, limits: object) -> tuple[PointingLimit, ...] | None:
        """See :class:`~freefloat.limits.limit.Limit`."""
        return super().bound_of(setting, limits) or None

    def worst(self, motion: Motion) -> LimitResult:
        """The result of the axis whose angle is largest relative to its limit."""
        results = (self._of_axis(axis, number, motion) for number, axis in enumerate(self.bound))
        return max(results, key=lambda result: result.ratio)

    def _of_axis(self, limit: PointingLimit, number: int, motion: Motion) -> LimitResult:
        model, inside = motion.model, limit.keep is Keep.INSIDE

        def vectors(t: Array, attitudes: Array, joints: Array) -> tuple[Array, Array]:
            return limit.vectors(model, attitudes, joints, motion.setting.origin(t))

        def cosine(panel: IntArray, x: Array) -> Array:
            """The cosine of the angle; negative where that should be small."""
            axis, target = vectors(*motion.at(panel, x))
            cosines = (axis * target).sum(axis=1, keepdims=True)
            return np.asarray(-cosines if inside else cosines)

        place = place_of_maximum(motion, cosine)
        angle = float(angle_of(*vectors(*motion.evaluate(place)))[0])
        with np.errstate(divide="ignore"):
            ratio = float(angle / limit.angle if inside else np.divide(limit.angle, angle))
        time, where = motion.time_at(place), limit.title(number)
        return self.result(angle, limit.angle, ratio, time, where, at_least=not inside)
