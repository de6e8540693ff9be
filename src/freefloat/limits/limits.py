"""Limits of a motion, and how far a motion uses them up."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np

from freefloat.errors import InputError, finite_number, number_array, require_type
from freefloat.motion.pointing import AttitudeLimits, PointingLimit
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, frozen


class LimitKind(StrEnum):
    """The limited quantity."""

    JOINT_RANGE = "joint_range"
    JOINT_RATE = "joint_rate"
    BASE_RATE = "base_rate"
    CLEARANCE = "clearance"
    JOINT_TORQUE = "joint_torque"
    POINTING = "pointing"
    BASE_TURN = "base_turn"
    CORRIDOR = "corridor"

    @property
    def timed(self) -> bool:
        """Whether it depends on the speed of a motion, not on its shape alone."""
        return self in _POWERS


@dataclass(frozen=True, eq=False)
class Limits:
    """Limits in addition to the joint ranges of the URDF; None for those that do not apply.

    Attributes:
        joint_rate: Magnitudes [rad/s or m/s], shape (n,); infinite for joints without a limit.
        joint_torque: Magnitudes [N m or N], shape (n,); infinite for joints without a limit.
        base_rate: Magnitude of the spacecraft's angular velocity [rad/s].
        clearance: Smallest distance [m] between bodies that no joint connects, and between the
            robot and bodies of the problem's scene; 0: no contact.
        pointing: Axes of links that stay inside or outside cones.
        base_turn: Largest angle between the attitudes of the spacecraft at the start and at any
            time [rad], up to pi.

    Raises:
        InputError: If a limit is not positive, the clearance is negative, or the turn is above pi.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> limits = ff.Limits(joint_rate=np.array([0.2, 0.2]), base_rate=0.01)
        >>> simulation = ff.simulate(problem, [0.0, 0.0, 0.0, 1.0], limits=limits)
        >>> for result in simulation.limit_results:
        ...     print(result.limit, result.kept)
        joint_rate True
        base_rate False
    """

    joint_rate: Array | None = None
    joint_torque: Array | None = None
    base_rate: float | None = None
    clearance: float | None = None
    pointing: tuple[PointingLimit, ...] = ()
    base_turn: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "pointing", tuple(self.pointing))
        for k, limit in enumerate(self.pointing):
            accepted = "PointingLimit(body, axis, angle, direction=...)"
            require_type(f"limits.pointing.{k}", limit, PointingLimit, accepted)
        if self.base_turn is not None:
            smallest = np.finfo(float).tiny
            accepted = "an angle above 0, up to pi"
            finite_number("limits.base_turn", self.base_turn, accepted, smallest, np.pi)
        for name in ("joint_rate", "joint_torque", "base_rate"):
            limit, key = getattr(self, name), f"limits.{name}"
            if limit is None:
                continue
            joints = name != "base_rate"
            accepted = "a number above zero for each joint" if joints else "a number above zero"
            values = number_array(key, limit, accepted)
            if values.ndim != joints or not (values > 0.0).all():
                raise InputError(key, f"{values.tolist()} was given", accepted)
            object.__setattr__(self, name, frozen(values) if joints else float(values))
        if self.clearance is not None:
            finite_number("limits.clearance", self.clearance, "a length, 0 or more", 0.0)

    @property
    def untimed(self) -> Limits:
        """Those that do not depend on the speed along the path."""
        return replace(self, joint_rate=None, joint_torque=None, base_rate=None)

    @property
    def without_turn(self) -> Limits:
        """Those of motions that are meant to turn the spacecraft: all but ``base_turn``."""
        return replace(self, base_turn=None)

    def seen_from(self, centre: Array) -> Limits:
        """The limits in a frame that begins at another place of the centre of mass.

        Args:
            centre: The place in the frame of these limits [m], shape (3,).
        """
        return replace(self, pointing=tuple(limit.moved(-centre) for limit in self.pointing))

    @property
    def timed(self) -> bool:
        """Whether there are limits of joint rates, joint torques or the spacecraft's rate."""
        entries = (self.joint_rate, self.joint_torque, self.base_rate)
        return any(entry is not None for entry in entries)

    @property
    def attitude(self) -> AttitudeLimits:
        """The limits that depend on the attitudes of bodies alone."""
        return AttitudeLimits(self.pointing, self.base_turn)


def require_applicable(model: FreeFloatingModel, limits: Limits) -> None:
    """Raise an InputError unless limits are those of a robot's joints and links."""
    accepted = "Limits, such as Limits(base_rate=0.02), or load_scenario(...).limits()"
    require_type("limits", limits, Limits, accepted)
    for key in ("joint_rate", "joint_torque"):
        values = getattr(limits, key)
        if values is not None and values.shape != (model.dof,):
            accepted = f"for {', '.join(model.joint_names)}"
            raise InputError(f"limits.{key}", f"shape {values.shape} was given", accepted)
    for k, pointing in enumerate(limits.pointing):
        pointing.require_body(model, f"limits.pointing.{k}.body")


@dataclass(frozen=True)
class LimitResult:
    """A limit along a motion, at the instant closest to, or farthest beyond, its bound.

    Attributes:
        limit: The kind of limit.
        worst: Value at that instant, signed [unit of the limit; rad or m for a joint range, rad for
            pointing, turn and a cone].
        allowed: Limit of that value; of a range the nearer end.
        time: The instant [s].
        where: The joint, the pair of links, or link and body of the scene, as ``"a - b"``, the link
            that points with the number of its limit, ``"spacecraft"``, or of a corridor the
            end-effector.
        kept: Whether the motion keeps the limit.
        ratio: 1 where the limit is just kept: worst over allowed; of a range the distance from its
            middle over half its width; of a clearance, and of an axis that is kept outside a cone,
            allowed over worst.
        base_wrench: Numerical error of joint torques: the largest component of the wrench [N, N m]
            that inverse dynamics finds on the free base, where none acts, over the largest torque.
            None for other limits, and where all torques are zero.
        notes: Pairs of links and links that were left out, and why.
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

    def to_dict(self) -> dict[str, Any]:
        """The JSON document; null for values without bound."""
        values = asdict(self) | {"limit": str(self.limit), "notes": list(self.notes)}
        return {
            key: None if isinstance(value, float) and not math.isfinite(value) else value
            for key, value in values.items()
        }


def violated(results: Iterable[LimitResult]) -> tuple[LimitResult, ...]:
    """The results of limits that are not kept."""
    return tuple(result for result in results if not result.kept)


_POWERS = {LimitKind.JOINT_RATE: 1.0, LimitKind.BASE_RATE: 1.0, LimitKind.JOINT_TORQUE: 2.0}
"""Exponents with which ratios fall with the duration, without momentum."""


def needed_stretch(results: Iterable[LimitResult]) -> float:
    """Factor on the duration, 1 or more, with which rates and torques just keep their limits.

    Exact without momentum: the path in joint space remains, rates are inversely proportional to the
    duration, torques to its square. Infinite where rates have no bound.
    """
    factors = [
        float(result.ratio ** (1.0 / _POWERS[result.limit]))
        for result in results
        if result.limit.timed
    ]
    return max([1.0, *factors])
