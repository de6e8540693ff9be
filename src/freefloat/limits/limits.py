"""What a motion may ask of joints, spacecraft and space; what it does ask."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from freefloat.brief import brief
from freefloat.errors import InputError
from freefloat.so3 import Array, frozen


class LimitKind(StrEnum):
    """What is limited."""

    JOINT_RANGE = "joint_range"
    JOINT_RATE = "joint_rate"
    BASE_RATE = "base_rate"
    CLEARANCE = "clearance"
    JOINT_TORQUE = "joint_torque"


@dataclass(frozen=True, eq=False)
class Limits:
    """What is allowed beside the joint ranges of the URDF, which always count.

    None stands for what is not asked.

    Attributes:
        joint_rate: Magnitudes [rad/s or m/s], shape (n,); infinite for joints without a limit.
        joint_torque: Magnitudes [N m or N], shape (n,); infinite likewise.
        base_rate: Magnitude of the spacecraft's angular velocity [rad/s].
        clearance: Smallest distance [m] between bodies that may not touch; 0: no contact.
    """

    __repr__ = brief

    joint_rate: Array | None = None
    joint_torque: Array | None = None
    base_rate: float | None = None
    clearance: float | None = None

    def __post_init__(self) -> None:
        for name in ("joint_rate", "joint_torque", "base_rate"):
            given = getattr(self, name)
            if given is None:
                continue
            values = np.asarray(given, dtype=float)
            if not (values > 0.0).all():
                raise InputError(f"limits.{name}", f"{values.tolist()} was given", "above zero")
            if name != "base_rate":
                object.__setattr__(self, name, frozen(values))
        clearance = self.clearance
        if clearance is not None and not (clearance >= 0.0 and math.isfinite(clearance)):
            raise InputError("limits.clearance", f"{clearance} was given", "a length, 0 or more")


@dataclass(frozen=True)
class LimitResult:
    """One limit along one motion, at the place where it is nearest to being broken or worst so.

    Attributes:
        limit: Which one.
        worst: The value there, signed [unit of the limit; rad or m for a joint's range].
        allowed: What the limit allows there; of a range the bound that is nearer.
        time: When [s].
        where: The joint, the pair of links as ``"a - b"``, or ``"spacecraft"``.
        kept: Whether the motion keeps the limit, but for rounding.
        ratio: How much of it is used up, 1 where it is just kept: worst over allowed; of a range
            the distance from its middle over half of it; of a clearance allowed over worst.
        base_wrench: With joint torques: the largest component of force [N] and moment [N m] that
            inverse dynamics asks of the base, over the largest torque. Nothing pushes a drifting
            spacecraft: it must vanish.
        notes: What was left out, a sentence each.
    """

    limit: LimitKind
    worst: float
    allowed: float
    time: float
    where: str
    kept: bool
    ratio: float
    base_wrench: float | None = None
    notes: tuple[str, ...] = ()


_POWERS = {LimitKind.JOINT_RATE: 1.0, LimitKind.BASE_RATE: 1.0, LimitKind.JOINT_TORQUE: 2.0}
"""How the ratios fall with the duration when the system has no momentum."""


def needed_stretch(findings: Iterable[LimitResult]) -> float:
    """Factor on the duration with which rates and torques just keep their limits.

    Exact without momentum: then the motion in joint space stays as it is, rates fall with the
    duration and torques with its square. Stops must be stretched with the duration.

    Returns:
        1 where nothing is too fast; infinite where rates have no bound.
    """
    factors = [
        float(one.ratio ** (1.0 / _POWERS[one.limit])) for one in findings if one.limit in _POWERS
    ]
    return max([1.0, *factors])
