"""The limit of the scene's corridor."""

from __future__ import annotations

import numpy as np

from freefloat.limits.limit import Limit, place_of_maximum
from freefloat.limits.result import LimitResult
from freefloat.motion.law import corridor_pose
from freefloat.motion.motion import Motion
from freefloat.motion.setting import Setting
from freefloat.scene.scene import Corridor
from freefloat.so3 import Array, IntArray


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
