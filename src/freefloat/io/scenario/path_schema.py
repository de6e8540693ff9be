"""Keys of a path in scenario files."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Literal

from pydantic import Field

from freefloat.io.scenario.field_types import (
    Coefficients,
    Name,
    Number,
    Section,
    Vector,
    exactly_one_of,
)
from freefloat.io.scenario.orientation_section import Orientation


class LineSection(Section):
    """A straight line."""

    start: Vector = Field(alias="from")
    """First point [m]."""
    end: Vector = Field(alias="to")
    """Last point [m]."""


class PolynomialSection(Section):
    """Polynomials in s, coefficients [m] from the lowest power up."""

    x: Coefficients
    """x coordinate [m]."""
    y: Coefficients
    """y coordinate [m]."""
    z: Coefficients
    """z coordinate [m]."""


class ArcSection(Section):
    """A circular arc."""

    center: Vector
    """Centre [m]."""
    normal: Vector
    """Axis of rotation."""
    start: Vector = Field(alias="from")
    """First point [m]."""
    angle_deg: Number
    """Angle [degrees]."""


class SlerpSection(Section):
    """The shortest rotation between two orientations; a plain list is a quaternion x, y, z, w."""

    start: Orientation = Field(alias="from")
    """At the start of the path."""
    end: Orientation = Field(alias="to")
    """At the end of the path."""


class FollowSection(Section):
    """An axis along the direction of travel."""

    axis: Literal["x", "-x", "y", "-y"]
    """The end-effector's axis."""
    normal: Vector
    """Direction of its z axis, made orthogonal to the travel."""


class PointAtSection(Section):
    """An axis toward a point."""

    target: Vector
    """The point [m]."""
    axis: Literal["x", "-x", "y", "-y", "z", "-z"]
    """The end-effector's axis."""


class AttitudeSection(Section):
    """Orientation of the end-effector along the path; exactly one key."""

    fixed: Orientation | None = None
    slerp: SlerpSection | None = None
    follow: FollowSection | None = None
    point_at: PointAtSection | None = None

    _exactly_one = exactly_one_of("fixed", "slerp", "follow", "point_at")


class PathFrame(StrEnum):
    """Frames of a path."""

    INERTIAL = "inertial"
    SPACECRAFT = "spacecraft"
    BASE = "base"


class PathSection(Section):
    """Path of the end-effector: exactly one kind of curve, and its orientation."""

    frame: Annotated[PathFrame | Name, Field(union_mode="left_to_right")] = PathFrame.INERTIAL
    """Frame of all coordinates and orientations: ``inertial``, about the centre of mass;
    ``spacecraft``, the root link; or ``base``, the link that carries the first joint. The last two
    are those at ``search.joints`` and ``search.from_attitude`` (default: along the inertial
    axes). Or the name of a body of the scene: path and time law are relative to it while it
    tumbles."""
    line: LineSection | None = None
    polynomial: PolynomialSection | None = None
    arc: ArcSection | None = None
    waypoints: Annotated[list[Vector], Field(min_length=2, max_length=10_000)] | None = None
    """Points [m] of a twice continuously differentiable spline."""
    samples: str | None = None
    """A CSV file, relative to the scenario file: x, y, z [m], optionally s and qx, qy, qz, qw."""
    attitude: AttitudeSection | None = None
    """Orientation; not for position tasks or samples with quaternions."""

    _exactly_one = exactly_one_of("line", "polynomial", "arc", "waypoints", "samples")
