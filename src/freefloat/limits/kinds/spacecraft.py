"""Limits of the spacecraft: its rate and its turn."""

from __future__ import annotations

import numpy as np

from freefloat.limits.limit import Limit, Number, largest_magnitude, place_of_maximum, rates_along
from freefloat.limits.result import LimitResult
from freefloat.motion.motion import Motion
from freefloat.so3 import Array, IntArray, angle_between


class BaseRateLimit(Limit[float]):
    """Magnitude of the spacecraft's angular velocity."""

    name = "base_rate"
    unit = "rad/s"
    exponent = 1
    value = Number()
    description = "Magnitude of the spacecraft's angular velocity [rad/s]."

    def worst(self, motion: Motion) -> LimitResult:
        """The largest angular velocity of the spacecraft."""
        rates = rates_along(motion)
        nodes = motion.node_rates[..., :3] / self.bound if motion.panels else None
        ratio, time = largest_magnitude(
            motion, lambda panel, x: rates(panel, x).base / self.bound, nodes
        )
        return self.result(ratio * self.bound, self.bound, ratio, time, "spacecraft")


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
