"""The limit of the spacecraft's angular velocity."""

from __future__ import annotations

import numpy as np

from freefloat.limits.extremes import peak, rates_along
from freefloat.limits.limit import Limit
from freefloat.limits.result import LimitResult
from freefloat.limits.values import Number
from freefloat.motion.motion import Motion
from freefloat.so3 import Array


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

        def squared(panel: int, x: float) -> Array:
            """The squared ratio, smooth also where the rate passes through zero."""
            omega = rates(panel, x).base / self.bound
            return np.array([omega @ omega])

        place = peak(motion, squared)
        ratio, time = float(np.sqrt(place.value)), motion.time_at(place.u)
        return self.result(ratio * self.bound, self.bound, ratio, time, "spacecraft")
