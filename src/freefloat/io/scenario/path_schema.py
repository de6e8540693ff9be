"""Keys of a path and of its time law in scenario files."""

from __future__ import annotations

from dataclasses import asdict
from enum import StrEnum
from itertools import zip_longest
from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import Field, model_validator

from freefloat.errors import InputError
from freefloat.io.scenario.field_types import (
    Coefficients,
    Name,
    Number,
    Orientation,
    Section,
    Vector,
    exactly_one_of,
)
from freefloat.io.scenario.yaml import file_keys
from freefloat.paths.curves import ArcCurve, Curve, PolynomialCurve, SplineCurve
from freefloat.paths.timing import Stop, TimeLaw, Timing

MOST_WAYPOINTS = 10_000
"""Points that a scenario file may list; files of samples may have more."""


class CurveSection(Section):
    """One kind of curve: its keys, the curve that they describe, and back.

    Errors of a curve name its arguments; those that are called as a field get the key of that.
    """

    def to_curve(self) -> Curve:
        """The curve, in the frame of the section."""
        raise NotImplementedError

    @classmethod
    def content(cls, curve: Curve) -> dict[str, Any] | None:
        """The section that describes a curve; None for a curve that another section describes."""
        return None


class LineSection(CurveSection):
    """A straight line."""

    start: Vector = Field(alias="from")
    """First point [m]."""
    end: Vector = Field(alias="to")
    """Last point [m]."""

    def to_curve(self) -> Curve:
        """See :class:`CurveSection`."""
        return PolynomialCurve.line(self.start, self.end)


class PolynomialSection(CurveSection):
    """Polynomials in s, coefficients [m] from the lowest power up."""

    x: Coefficients
    """x coordinate [m]."""
    y: Coefficients
    """y coordinate [m]."""
    z: Coefficients
    """z coordinate [m]."""

    def to_curve(self) -> Curve:
        """See :class:`CurveSection`."""
        return PolynomialCurve(np.array([*zip_longest(self.x, self.y, self.z, fillvalue=0.0)]))

    @classmethod
    def content(cls, curve: Curve) -> dict[str, Any] | None:
        """See :class:`CurveSection`."""
        if not isinstance(curve, PolynomialCurve):
            return None
        return dict(zip("xyz", curve.coefficients.T.tolist(), strict=True))


class ArcSection(CurveSection):
    """A circular arc."""

    center: Vector
    """Centre [m]."""
    normal: Vector
    """Axis of rotation."""
    start: Vector = Field(alias="from")
    """First point [m]."""
    angle_deg: Number
    """Angle [degrees]."""

    def to_curve(self) -> Curve:
        """See :class:`CurveSection`."""
        center, start, normal = map(np.array, (self.center, self.start, self.normal))
        return ArcCurve(center, start, normal, float(np.deg2rad(self.angle_deg)))

    @classmethod
    def content(cls, curve: Curve) -> dict[str, Any] | None:
        """See :class:`CurveSection`."""
        if not isinstance(curve, ArcCurve):
            return None
        vectors = {"center": curve.centre, "normal": curve.normal, "from": curve.start}
        points = {name: vector.tolist() for name, vector in vectors.items()}
        return {**points, "angle_deg": float(np.degrees(curve.angle))}


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
    """An axis toward a point.

    The next axis (y after x, z after y, x after z) is as near as possible to the inertial axis (in
    the frame of a tumbling body: to the axis of that) that is farthest from all lines of sight.
    """

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


class FrameName(StrEnum):
    """Frames of a path."""

    INERTIAL = "inertial"
    SPACECRAFT = "spacecraft"
    BASE = "base"


class PathSection(Section):
    """Path of the end-effector: exactly one kind of curve, and its orientation."""

    frame: Annotated[FrameName | Name, Field(union_mode="left_to_right")] = FrameName.INERTIAL
    """Frame of all coordinates and orientations: ``inertial``, about the centre of mass;
    ``spacecraft``, the root link; ``base``, the link that carries the first joint; or the name of a
    link of the spacecraft. The last three are those at ``search.joints`` and
    ``search.from_attitude`` (default: along the inertial axes). Or the name of a body of the scene:
    path and time law are relative to it while it tumbles."""
    line: LineSection | None = None
    polynomial: PolynomialSection | None = None
    arc: ArcSection | None = None
    waypoints: Annotated[list[Vector], Field(min_length=2, max_length=MOST_WAYPOINTS)] | None = None
    """Points [m] of a twice continuously differentiable spline."""
    samples: str | None = None
    """A CSV file, relative to the scenario file: x, y, z [m], optionally s and qx, qy, qz, qw."""
    attitude: AttitudeSection | None = None
    """Orientation; not for position tasks or samples with quaternions."""

    @classmethod
    def kinds(cls) -> list[str]:
        """The keys of which exactly one is given."""
        return [name for name in cls.model_fields if name not in ("frame", "attitude")]

    @property
    def kind(self) -> str:
        """The key that is given."""
        return next(name for name in self.kinds() if getattr(self, name) is not None)

    @model_validator(mode="after")
    def _has_one_curve(self) -> PathSection:
        if sum(getattr(self, name) is not None for name in self.kinds()) != 1:
            raise ValueError(f"exactly one of {', '.join(self.kinds())}")
        return self

    def to_curve(self) -> Curve:
        """The curve of any kind but samples, in the frame of the section."""
        section = getattr(self, self.kind)
        if not isinstance(section, CurveSection):
            with file_keys(points="waypoints"):
                return SplineCurve(section)
        fields = type(section).model_fields.items()
        with file_keys(**{name: f"{self.kind}.{field.alias or name}" for name, field in fields}):
            return section.to_curve()


def curve_content(curve: Curve) -> dict[str, Any]:
    """Content of a ``path`` section: the key of a curve.

    Raises:
        InputError: If none describes it.
    """
    if isinstance(curve, SplineCurve):
        return {"waypoints": curve.points.tolist()}
    for name, field in PathSection.model_fields.items():
        for kind in get_args(field.annotation):
            if isinstance(kind, type) and issubclass(kind, CurveSection):
                content = kind.content(curve)
                if content is not None:
                    return {name: content}
    raise inexpressible("path.curve", curve)


def inexpressible(
    key: str, value: object, accepted: str = "a curve and an orientation law of freefloat.paths"
) -> InputError:
    """The error of a value that scenario files cannot describe."""
    problem = f"scenario files cannot describe the class {type(value).__name__}"
    return InputError(key, problem, accepted)


class StopSection(Section):
    """An instant at which the end-effector rests."""

    s: Number
    """Path parameter, in (0, 1)."""
    t: Number
    """Time [s]."""


class TimingSection(Section):
    """Time law of the path."""

    duration: Number
    """Duration of the whole motion [s]."""
    law: TimeLaw = TimeLaw.QUINTIC
    """Time law between rests."""
    stops: list[StopSection] = Field(default=[])
    """Rests between start and end."""
    speeds: list[tuple[Number, ...]] = Field(default=[])
    """Times [s] and speeds ds/dt [1/s] of the law ``optimal``, linear in between, or with d²s/dt²
    [1/s²] in a third column cubic, from rest to rest. Without them ``plan`` finds the fastest
    timing; until then the law is quintic."""

    def to_timing(self) -> Timing:
        """The time law; raises an InputError if it is invalid."""
        stops = tuple(Stop(stop.s, stop.t) for stop in self.stops)
        return Timing(self.duration, self.law, stops, tuple(self.speeds))


def timing_content(timing: Timing) -> dict[str, Any]:
    """Content of the ``timing`` section that describes a time law."""
    return asdict(timing) | {"law": str(timing.law)}
