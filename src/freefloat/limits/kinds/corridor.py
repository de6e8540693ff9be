"""The limit of the scene's corridor."""

from __future__ import annotations

import numpy as np

from freefloat.limits.extremes import place_of_maximum
from freefloat.limits.limit import Limit
from freefloat.limits.result import LimitResult
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.motion.scene_poses import corridor_pose
from freefloat.scene.scene import Corridor
from freefloat.so3 import Array


class CorridorLimit(Limit[Corridor]):
    """Deviation of the end-effector from the axis of the corridor; an angle in a cone."""

    name = "corridor"
    unit = "m"

    @classmethod
    def bound_of(cls, problem: Problem, limits: object) -> Corridor | None:
        """See :class:`~freefloat.limits.limit.Limit`."""
        return problem.scene.corridor

    def worst(self, motion: Motion) -> LimitResult:
        """The instant at which the end-effector deviates most from the corridor's axis."""
        problem, corridor = motion.problem, self.bound

        def deviation(t: float, attitude: Array, joints: Array) -> float:
            position = problem.model.end_effector_pose(attitude, joints).position
            frame = corridor_pose(motion, t, attitude, joints)
            return corridor.deviation(frame.rotation.T @ (position - frame.position))

        def squared(panel: int, x: float) -> Array:
            """The square, smooth also where the deviation is zero."""
            return np.array([deviation(*motion.at(panel, x)) ** 2])

        place = place_of_maximum(motion, squared)
        times, attitudes, joints = motion.evaluate(place)
        worst, allowed = deviation(times[0], attitudes[0], joints[0]), corridor.allowed
        return self.result(
            worst, allowed, worst / allowed, motion.time_at(place), problem.model.end_effector,
            unit=self.unit if corridor.half_angle is None else "rad",
        )  # fmt: skip
