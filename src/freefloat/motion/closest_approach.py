"""The closest approach of a motion to a dynamic singularity."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from freefloat.dynamics.measures import SingularityMeasure
from freefloat.errors import require_type
from freefloat.motion.extrema import Function, first_below, minimum
from freefloat.motion.motion import Motion
from freefloat.so3 import Array


@dataclass(frozen=True)
class ClosestApproach:
    """The smallest magnitude of a singularity measure along a motion.

    Attributes:
        measure: Name of the measure.
        value: The magnitude; zero where the measure changes sign.
        sign: Sign of the measure at the start, 1 or -1.
        time: Its time [s].
    """

    measure: str
    value: float
    sign: int
    time: float

    def to_dict(self) -> dict[str, Any]:
        """The record as a JSON document."""
        return asdict(self)


def closest_approach(motion: Motion, measure: SingularityMeasure) -> ClosestApproach:
    """The smallest magnitude of a singularity measure along a motion.

    Args:
        motion: The motion.
        measure: A measure of the same robot.

    Raises:
        InputError: If an argument is of another type.
    """
    require_type("motion", motion, Motion, "a Motion, such as simulate(...).chosen.motion")
    accepted = "singularity_measure(model, task, name), or margin.measure"
    require_type("measure", measure, SingularityMeasure, accepted)
    profile, values, sign = _profile(motion, measure)
    if not motion.panels:
        u, value = 0.0, sign * measure(motion.joints[0])
    else:
        crossing, value = first_below(values, profile, 0.0), 0.0
        if crossing is None:
            lowest = minimum(values, profile)
            crossing, value = lowest.u, lowest.value
        u = crossing
    time = np.clip(motion.evaluate(u)[0][0], motion.times.min(), motion.times.max())
    return ClosestApproach(measure.name, abs(value), sign, float(time))  # not -0.0


def first_crossing(motion: Motion, f: Callable[[Array], float], level: float) -> float | None:
    """Panel coordinate at which a function of the joints first changes sign or falls below a level.

    Args:
        motion: The motion.
        f: Function of joint values, shape (n,).
        level: Required magnitude.

    Returns:
        None where it keeps its sign and that magnitude.
    """
    if not motion.panels:
        return 0.0 if abs(f(motion.joints[0])) < level else None
    profile, values, _ = _profile(motion, f)
    return first_below(values, profile, level)


def _profile(motion: Motion, f: Callable[[Array], float]) -> tuple[Function, Array, int]:
    """A function of the joints made positive at the start, its values at the nodes, its sign."""
    values = np.array([f(joints) for joints in motion.joints])
    sign = -1 if values[0] < 0.0 else 1

    def profile(panel: int, x: float) -> Array:
        return np.array([sign * f(motion.at(panel, x)[2])])

    return profile, sign * values[motion.panel_nodes][:, :, None], sign
