"""The limit of the spacecraft's angular velocity."""

from __future__ import annotations

from freefloat.limits.limit import Limit, Number, largest_magnitude, rates_along
from freefloat.limits.result import LimitResult
from freefloat.motion.motion import Motion


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
