"""How close a motion comes to a singularity: found between its nodes, not on them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from freefloat.dynamics.measures import SingularityMeasure
from freefloat.errors import require_type
from freefloat.motion.motion import Motion
from freefloat.so3 import Array


@dataclass(frozen=True)
class ClosestApproach:
    """The smallest magnitude of a measure along a motion.

    Attributes:
        measure: Name of the measure.
        value: The magnitude; zero where the measure changes sign on the way.
        sign: 1 or -1: of the measure at the start.
        time: When [s].
    """

    measure: str
    value: float
    sign: int
    time: float


def closest_approach(motion: Motion, of: SingularityMeasure) -> ClosestApproach:
    """Where a measure is smallest along a motion.

    Args:
        motion: The motion.
        of: A measure of the same robot.

    Raises:
        InputError: If they are something else.
    """
    require_type("motion", motion, Motion, "a Motion, such as simulate(...).chosen.motion")
    require_type(
        "of",
        of,
        SingularityMeasure,
        "a SingularityMeasure: singularity_measure(model, task, name), or margin.measure",
    )
    profile = _Profile(motion, of)
    place, value = profile.first_place_below(0.0), 0.0
    if place is None:
        lowest = int(np.argmin(profile.values))
        value = float(profile.values[lowest])
        candidates = [(value, float(motion.node_parameters[lowest])), *profile.dips(value)]
        value, place = min(candidates)
    time = np.clip(motion.evaluate(place)[0][0], motion.times.min(), motion.times.max())
    return ClosestApproach(of.name, abs(value), profile.sign, float(time))  # not -0.0


def first_place_below(motion: Motion, of: Callable[[Array], float], value: float) -> float | None:
    """Panel coordinate at which a function of the joints first changes sign or gets too small.

    Args:
        motion: The motion.
        of: Function of joint values, shape (n,).
        value: The magnitude it must keep.

    Returns:
        None where it keeps its sign and that magnitude.
    """
    return _Profile(motion, of).first_place_below(value)


class _Profile:
    """A function of the joints along a motion, made positive at the start."""

    def __init__(self, motion: Motion, of: Callable[[Array], float]) -> None:
        self._motion, self._of = motion, of
        values = np.array([of(joints) for joints in motion.joints])
        self.sign = -1 if values[0] < 0.0 else 1
        self.values: Array = self.sign * values

    def _at(self, place: float) -> float:
        return self.sign * self._of(self._motion.evaluate(place)[2][0])

    def dips(self, bound: float) -> Iterator[tuple[float, float]]:
        """Minima between nodes that may lie below a bound: value and place.

        One may hide beside either end. Elsewhere a parabola through a lowest node and its
        neighbours tells how deep the dip may be; where three times that could pass the bound, the
        motion itself is searched.
        """
        u, v = self._motion.node_parameters, self.values
        for end, inner in ((0, 1), (-1, -2)):
            if len(v) > 1 and v[end] <= v[inner] and v[end] - 3.0 * (v[inner] - v[end]) <= bound:
                yield self._searched(*sorted((u[end], u[inner])))
        for i in np.flatnonzero((v[1:-1] <= v[:-2]) & (v[1:-1] <= v[2:])) + 1:
            left, right = u[i] - u[i - 1], u[i + 1] - u[i]
            rise, fall = (v[i + 1] - v[i]) / right, (v[i - 1] - v[i]) / left
            bend = (rise + fall) / (left + right)
            slope = (rise * left - fall * right) / (left + right)
            if bend > 0.0 and v[i] - 3.0 * slope**2 / (4.0 * bend) <= bound:
                yield self._searched(u[i - 1], u[i + 1])

    def _searched(self, low: float, high: float) -> tuple[float, float]:
        found = minimize_scalar(
            self._at, bounds=(low, high), method="bounded", options={"xatol": 1e-9}
        )
        return float(found.fun), float(found.x)

    def first_place_below(self, value: float) -> float | None:
        u, v = self._motion.node_parameters, self.values
        if v[0] < value:
            return 0.0
        below = [float(place) for place in u[v < value][:1]]
        below += sorted(place for depth, place in self.dips(value) if depth < value)[:1]
        if not below:
            return None
        low = min(below)
        above = float(u[(u < low) & (v >= value)][-1])
        if self._at(low) >= value or self._at(above) < value:
            return low  # the two differ by rounding alone
        return float(brentq(lambda place: self._at(place) - value, above, low, xtol=1e-13))
