"""The keys of scenario files: what they mean, what they accept."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    Tag,
    model_validator,
)

from freefloat.dynamics.momentum import Task
from freefloat.dynamics.redundancy import Metric, Toward
from freefloat.io.robot_schema import RobotSection
from freefloat.io.schema_types import (
    Coefficients,
    Factor,
    NotNegative,
    Number,
    Positive,
    Quaternion,
    Section,
    Turns,
    Vector,
    one_of,
)
from freefloat.paths.timing import TimeLaw
from freefloat.planning.options import Objective


class LineSection(Section):
    """A straight line."""

    start: Vector = Field(alias="from")
    """Where it begins [m]."""
    end: Vector = Field(alias="to")
    """Where it ends [m]."""


class PolynomialSection(Section):
    """Polynomials in s, coefficients [m] from the lowest power up."""

    x: Coefficients
    """Of the x coordinate."""
    y: Coefficients
    """Of the y coordinate."""
    z: Coefficients
    """Of the z coordinate."""


class ArcSection(Section):
    """A circular arc."""

    center: Vector
    """[m]"""
    normal: Vector
    """Axis of the turn."""
    start: Vector = Field(alias="from")
    """Where it begins [m]."""
    angle_deg: Number
    """How far it turns [degrees]."""


def _two(axes: dict[str, Vector]) -> dict[str, Vector]:
    if len(axes) != 2:
        raise ValueError("exactly two of x, y, z")
    return axes


Axes = Annotated[
    dict[Literal["x", "y", "z"], Vector],
    AfterValidator(_two),
    Field(json_schema_extra={"minProperties": 2, "maxProperties": 2}),
]


class OrientationSection(Section):
    """An attitude, written in one of three ways."""

    quaternion: Quaternion | None = None
    """x, y, z, w."""
    rpy: Turns | None = None
    """Roll, pitch, yaw about the inertial x, y, z axes in this order [rad]."""
    axes: Axes | None = None
    """Inertial directions of two of its axes x, y, z; the first one named is kept."""

    @model_validator(mode="after")
    def _one(self) -> OrientationSection:
        one_of(self, "quaternion", "rpy", "axes")
        return self


Orientation = Annotated[
    OrientationSection,
    BeforeValidator(
        lambda given: {"quaternion": given} if isinstance(given, list) else given,
        json_schema_input_type=OrientationSection | Quaternion,
    ),
]


class SlerpSection(Section):
    """The shortest turn between two attitudes; a plain list is a quaternion x, y, z, w."""

    start: Orientation = Field(alias="from")
    """At the start of the path."""
    end: Orientation = Field(alias="to")
    """At its end."""


class FollowSection(Section):
    """An axis along the direction of travel."""

    axis: Literal["x", "-x", "y", "-y"]
    """The end-effector's axis."""
    normal: Vector
    """Direction that its z axis keeps to."""


class PointAtSection(Section):
    """An axis toward a point."""

    target: Vector
    """The point [m]."""
    axis: Literal["x", "-x", "y", "-y", "z", "-z"]
    """The end-effector's axis."""


class AttitudeSection(Section):
    """How the end-effector stands, in one of four ways."""

    fixed: Orientation | None = None
    slerp: SlerpSection | None = None
    follow: FollowSection | None = None
    point_at: PointAtSection | None = None

    @model_validator(mode="after")
    def _one(self) -> AttitudeSection:
        one_of(self, "fixed", "slerp", "follow", "point_at")
        return self


class PathSection(Section):
    """Where the end-effector goes, in one of five ways, and how it stands."""

    line: LineSection | None = None
    polynomial: PolynomialSection | None = None
    arc: ArcSection | None = None
    waypoints: Annotated[list[Vector], Field(min_length=2, max_length=10_000)] | None = None
    """Points [m] of a twice continuously differentiable spline."""
    samples: str | None = None
    """A CSV file, relative to the scenario file: x, y, z [m], optionally s and qx, qy, qz, qw."""
    attitude: AttitudeSection | None = None
    """Left out for position tasks, and where the samples have quaternions."""

    @model_validator(mode="after")
    def _one(self) -> PathSection:
        one_of(self, "line", "polynomial", "arc", "waypoints", "samples")
        return self


class StopSection(Section):
    """A rest on the way."""

    s: Number
    """Where, in (0, 1)."""
    t: Number
    """When [s]."""


class TimingSection(Section):
    """When the end-effector is where."""

    duration: Number
    """Of the whole motion [s]."""
    law: TimeLaw = TimeLaw.QUINTIC
    """How each segment between rests is travelled."""
    stops: list[StopSection] = Field(default=[])
    """Rests on the way."""


class MarginSection(Section):
    """How far from dynamic singularities to stay."""

    measure: Literal["gjm", "system", "arm", "sigma"] = "gjm"
    """det S*, det A, the arm's in-plane factor, or the smallest singular value of S*."""
    value: Annotated[float, Field(strict=True, ge=0.0)] | None = None
    """Magnitude the measure must keep."""
    fraction: Annotated[float, Field(strict=True, ge=0.0, lt=1.0)] | None = None
    """The same as a share of the measure's largest magnitude over the joint space."""

    @model_validator(mode="after")
    def _one(self) -> MarginSection:
        one_of(self, "value", "fraction")
        return self


def _word(given: object) -> object:
    if given not in tuple(Metric):
        raise ValueError("joints, energy, or a map from joint to weight")
    return given


Weighing = Annotated[
    Annotated[Metric, BeforeValidator(_word), Tag("[word]")]
    | Annotated[dict[str, Factor], Tag("[map]")],
    Discriminator(lambda given: "[map]" if isinstance(given, dict) else "[word]"),
]


class RedundancySection(Section):
    """What an arm with more joints than the task needs does with its freedom."""

    metric: Weighing = Metric.JOINTS
    """What of the joint rates is least: their norm, the kinetic energy that they make, or, with
    a map from joint to weight, the norm of weighted rates; joints not named weigh 1."""
    toward: Toward = Toward.NONE
    """Null-space motion toward a larger manipulability, or toward the middle of joint ranges."""
    gain: Annotated[float, Field(strict=True, ge=0.0, le=1e6)] | None = None
    """How strongly, per path; 1 when left out."""
    bound: Annotated[float, Field(strict=True, gt=0.0, le=1e6)] | None = None
    """Largest null-space motion toward it, per path [rad, m]; 3 when left out."""

    @model_validator(mode="after")
    def _drawn(self) -> RedundancySection:
        if self.toward is Toward.NONE and (self.gain, self.bound) != (None, None):
            raise ValueError("toward: sigma or middle, where gain or bound is given")
        return self


class SearchSection(Section):
    """Which of the feasible attitudes a plan should choose."""

    objective: Objective = Objective.MARGIN
    """The largest margin, the nearest to from_attitude, or the one deepest inside."""
    from_attitude: Quaternion | None = None
    """Attitude the spacecraft has now: x, y, z, w."""
    samples: Annotated[int, Field(strict=True, ge=8, le=100_000_000)] | None = None
    """How many attitudes are tried where there is no closed form. Left out: in the plane 360
    headings; in space 4,096 attitudes for a plan and 36,864 for a map."""
    seed: Annotated[int, Field(strict=True, ge=0)] = 0
    """Turns the grid of attitudes in space; in the plane nothing is drawn."""


JointLimits = Positive | dict[str, Positive] | Literal["urdf"]


class LimitsSection(Section):
    """What a motion may ask for, beside the joint ranges of the URDF."""

    joint_rate: JointLimits | None = None
    """Magnitudes of joint rates [rad/s, m/s]: one for all, a map from joint to number, or
    ``urdf``."""
    joint_torque: JointLimits | None = None
    """Magnitudes of joint torques and forces [N m, N], written likewise."""
    base_rate: Positive | None = None
    """Magnitude of the spacecraft's angular velocity [rad/s]."""
    clearance: NotNegative | None = None
    """Smallest distance [m] between bodies that no joint joins; 0: they may not touch."""


class ScenarioFile(Section):
    """A scenario: a robot, a path for its end-effector, and what it drifts with."""

    robot: RobotSection
    task: Task
    """What of the path is prescribed."""
    momentum: Vector = (0.0, 0.0, 0.0)
    """About the centre of mass, inertial axes [N m s]."""
    path: PathSection
    timing: TimingSection
    margin: MarginSection = MarginSection(measure="gjm", value=0.0)
    redundancy: RedundancySection | None = None
    """For arms with more joints than the task needs alone; left out, the norm of the joint rates is
    least."""
    search: SearchSection = SearchSection()
    limits: LimitsSection = LimitsSection()
