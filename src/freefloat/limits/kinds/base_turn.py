"""The limit of the spacecraft's turn away from its attitude at the start."""

from __future__ import annotations

import numpy as np

from freefloat.limits.limit import Limit, Number, place_of_maximum
from freefloat.limits.result import LimitResult
from freefloat.motion.motion import Motion
from freefloat.so3 import Array, IntArray, angle_between


class BaseTurnLimit(Limit[float]):
    """Angle between the attitudes of the spacecraft at the start and at any time."""

    name = "base_turn"
    unit = "rad"
    of_attitude = True
    value = Number(most=np.pi, angle=True)
    description = (
        "Largest angle between the attitudes of the spacecraft at the start and at any time "
        "[degrees]."
    )

    def worst(self, motion: Motion) -> LimitResult:
        """The largest angle of the spacecraft from its attitude at the start."""
        initial = motion.initial.attitude

        def nearness(panel: IntArray, x: Array) -> Array:
            """The negative square of the cosine of half the turn, smooth also where it is 0."""
            return np.asarray(-((motion.at(panel, x)[1] @ initial[:, None]) ** 2))

        place = place_of_maximum(motion, nearness)
        turn = float(angle_between(motion.evaluate(place)[1][0], initial))
        time = motion.time_at(place)
        return self.result(turn, self.bound, turn / self.bound, time, "spacecraft")
