"""Limits of the end-effector: its directions and its corridor."""

from __future__ import annotations

import numpy as np

from freefloat.limits.limit import Axes, Limit, place_of_maximum
from freefloat.limits.result import LimitResult
from freefloat.motion.law import corridor_pose
from freefloat.motion.motion import Motion
from freefloat.motion.pointing import Keep, PointingLimit, angle_of
from freefloat.motion.setting import Setting
from freefloat.scene.scene import Corridor
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


class CorridorLimit(Limit[Corridor]):
    """Deviation of the end-effector from the axis of the corridor; an angle in a cone."""

    name = "corridor"
    unit = "m"

    @classmethod
    def bound_of(cls, setting: Setting, limits: object) -> Corridor | None:
        """See :class:`~freefloat.limits.limit.Limit`."""
        return setting.scene.corridor

    def places(self, setting: Setting) -> tuple[str, ...]:
        """See :class:`~freefloat.limits.limit.Limit`."""
        return (setting.model.end_effector,)

    def worst(self, motion: Motion) -> LimitResult:
        """The instant at which the end-effector deviates most from the corridor's axis."""
        setting, corridor = motion.setting, self.bound

        def deviation(t: Array, attitudes: Array, joints: Array) -> Array:
            pose = setting.model.end_effector_pose(attitudes, joints)
            frame = corridor_pose(motion.law, t, attitudes, joints)
            return np.asarray(corridor.deviation((frame.inverse() @ pose).position))

        def squared(panel: IntArray, x: Array) -> Array:
            """The square, smooth also where the deviation is zero."""
            return np.asarray(deviation(*motion.at(panel, x))[:, None] ** 2)

        place = place_of_maximum(motion, squared)
        worst, allowed = deviation(*motion.evaluate(place))[0], corridor.allowed
        return self.result(
            worst, allowed, worst / allowed, motion.time_at(place), setting.model.end_effector,
            unit=self.unit if corridor.half_angle is None else "rad",
        )  # fmt: skip
