"""Limits of attitude along a motion: where axes of the robot may point, how far the base may turn.

The value of each is an angle: between an axis that is fixed to a link and the direction of a target
or, for the spacecraft, between its attitude and that at the start of the motion.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Self

import numpy as np

from freefloat.errors import (
    InputError,
    did_you_mean,
    finite_number,
    finite_vector,
    member,
    require_type,
)
from freefloat.robot.model import FreeFloatingModel
from freefloat.rotations import rotation_matrix
from freefloat.so3 import Array, frozen, unit_vector

TOO_NEAR = 1e-3
"""Distance of a point from the start of the line of sight below which it has no direction [m]."""


class Keep(StrEnum):
    """The side of a cone on which an axis is kept."""

    INSIDE = "inside"
    OUTSIDE = "outside"


@dataclass(frozen=True, eq=False)
class PointingLimit:
    """An axis of a link that stays inside, or outside, a cone about the direction of a target.

    Attributes:
        body: Name of a link, which may be the spacecraft's root link.
        axis: Axis in the link's frame, normalized, shape (3,).
        angle: Half the opening angle of the cone [rad], above 0 and below pi.
        keep: The side of the cone.
        direction: Direction of a target far away, inertial axes, normalized, shape (3,).
        point: Point [m] in the path's frame in place of a direction, shape (3,); the line of sight
            begins at the origin of the link's frame. The limit is kept where that is less than 1 mm
            from the point.
        name: Name by which results, figures and pages call it; None for the link and its number.

    Raises:
        InputError: If an attribute is not of this kind, or not exactly one of direction and point
            is given.

    Example:
        >>> sun = ff.PointingLimit("base", [0, 1, 0], 0.5, keep="outside", direction=[1, 0, 0])
        >>> sun.keep
        <Keep.OUTSIDE: 'outside'>
    """

    body: str
    axis: Array
    angle: float
    keep: Keep = Keep.INSIDE
    direction: Array | None = None
    point: Array | None = None
    name: str | None = None

    def __post_init__(self) -> None:
        require_type("body", self.body, str, "the name of a link")
        require_type("name", self.name, str | None, "a name")
        object.__setattr__(self, "keep", member("keep", Keep, self.keep))
        finite_number("angle", self.angle, "an angle above 0 and below pi", 0.0, np.pi)
        if not 0.0 < self.angle < np.pi:
            raise InputError("angle", f"{self.angle:g} was given", "an angle above 0 and below pi")
        if (self.direction is None) == (self.point is None):
            count = "neither" if self.point is None else "both"
            raise InputError("target", f"{count} of them was given", "a direction or a point")
        object.__setattr__(self, "axis", frozen(unit_vector("axis", self.axis)))
        if self.direction is not None:
            direction = frozen(unit_vector("target.direction", self.direction))
            object.__setattr__(self, "direction", direction)
        if self.point is not None:
            point = frozen(finite_vector("target.point", self.point, 3))
            object.__setattr__(self, "point", point)

    def title(self, number: int) -> str:
        """Name of the limit, or its link and its number among the limits of pointing."""
        return self.name or f"{self.body} (pointing.{number})"

    def narrower(self, fraction: float) -> PointingLimit:
        """The limit that leaves less room, by a fraction of the angle or of the room if smaller."""
        if self.keep is Keep.INSIDE:
            return replace(self, angle=self.angle * (1.0 - fraction))
        return replace(self, angle=self.angle + fraction * min(self.angle, np.pi - self.angle))

    def moved(self, offset: Array) -> PointingLimit:
        """The limit with its point, if it has one, moved by an offset [m], shape (3,)."""
        return self if self.point is None else replace(self, point=self.point + offset)

    def require_body(self, model: FreeFloatingModel, key: str) -> None:
        """Raise an InputError that names a key unless the robot has the link."""
        if self.body not in model.link_places:
            links = list(model.link_places)
            problem = f"there is no link {self.body!r}{did_you_mean(self.body, links)}"
            raise InputError(key, problem, ", ".join(links))

    def vectors(
        self, model: FreeFloatingModel, attitude: Array, joints: Array, origin: Array | float = 0.0
    ) -> tuple[Array, Array]:
        """The axis and the direction of the target in a configuration, inertial unit vectors.

        The origin (..., 3) of the path's frame is relative to the centre of mass [m]; for K
        attitudes and joints there are K vectors, (K, 3).
        """
        number, placement = model.link_places[self.body]
        local = placement.rotation @ self.axis
        if number == 0 and self.direction is not None:
            axis = rotation_matrix(attitude) @ local
            return axis, np.broadcast_to(self.direction, axis.shape)
        pose = model.body_poses(attitude, joints)[number]
        axis = pose.rotation @ local
        if self.point is None:
            return axis, np.broadcast_to(np.asarray(self.direction), axis.shape)
        sight = self.point + origin - pose.position - pose.rotation @ placement.position
        distance = np.linalg.norm(sight, axis=-1, keepdims=True)
        there = axis if self.keep is Keep.INSIDE else -axis
        near = distance < TOO_NEAR
        return axis, np.where(near, there, sight / np.where(near, 1.0, distance))

    def to_dict(self) -> dict[str, Any]:
        """The keys of a scenario's limit, angles in degrees."""
        kind = "direction" if self.point is None else "point"
        return {
            **({} if self.name is None else {"name": self.name}),
            "body": self.body,
            "axis": self.axis.tolist(),
            "target": {kind: getattr(self, kind).tolist()},
            "keep": str(self.keep),
            "angle_deg": float(np.degrees(self.angle)),
        }


def angle_of(first: Array, second: Array) -> Any:
    """The angles between unit vectors (..., 3) [rad], exact also where they are small."""
    apart, along = (np.linalg.norm(x, axis=-1) for x in (first - second, first + second))
    return 2.0 * np.arctan2(apart, along)


@dataclass(frozen=True, eq=False, kw_only=True)
class AttitudeLimits:
    """Limits that depend on the attitudes of a motion's bodies alone.

    Attributes:
        pointing: The limits of axes.
        base_turn: Largest angle between the attitudes of the spacecraft at the start and at any
            time [rad]; None without limit.
    """

    pointing: tuple[PointingLimit, ...] = ()
    base_turn: float | None = None

    def of_joints(self, count: int) -> Self:
        """The limits of a robot of whose joints only the first ones move."""
        return self

    def seen_from(self, centre: Array) -> Self:
        """The limits in a frame that begins at another centre of mass, (3,) in this frame [m]."""
        return replace(self, pointing=tuple(limit.moved(-centre) for limit in self.pointing))

    @property
    def number(self) -> int:
        """Number of these limits, limits of axes first."""
        return len(self.pointing) + (self.base_turn is not None)

    @property
    def turn_cosine(self) -> float:
        """Cosine of half the largest turn; -1, which no motion reaches, for half a revolution."""
        turn = np.pi if self.base_turn is None else self.base_turn
        return float(np.cos(turn / 2.0)) if turn < np.pi else -1.0

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each limit in results, in the same order."""
        turn = () if self.base_turn is None else ("base_turn",)
        return ("pointing",) * len(self.pointing) + turn

    def ratios(self, slacks: Array) -> Array:
        """Angles over the limits' angles, for axes outside of cones the inverse, shape (..., L).

        Args:
            slacks: Differences of cosines to the bounds, of the turn cosines of half the angles,
                negative where they are violated, shape (..., L).
        """
        bounds = np.array([limit.angle for limit in self.pointing])
        outside = np.array([limit.keep is Keep.OUTSIDE for limit in self.pointing], bool)
        cosines = np.cos(bounds)
        if self.base_turn is not None:
            bounds, outside = np.append(bounds, self.base_turn / 2.0), np.append(outside, False)
            cosines = np.append(cosines, self.turn_cosine)
        cosines = cosines + np.where(outside, -slacks, slacks)
        angles = np.arccos(np.clip(cosines, -1.0, 1.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.where(outside, bounds / angles, angles / bounds))
