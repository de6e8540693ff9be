"""The keys of scenario files: what they mean, what they accept."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    model_validator,
)

from freefloat.dynamics import Task
from freefloat.redundancy import Metric, Toward
from freefloat.search import Objective
from freefloat.timing import TimeLaw

_LARGEST = 1e9
"""No length, time or momentum of a spacecraft comes near; beyond it squares leave the numbers."""

Name = Annotated[str, Field(min_length=1)]
Number = Annotated[float, Field(strict=True, ge=-_LARGEST, le=_LARGEST)]
Factor = Annotated[float, Field(strict=True, ge=1e-6, le=1e6)]
Positive = Annotated[float, Field(strict=True, gt=0.0, le=_LARGEST)]
Vector = tuple[Number, Number, Number]
Inertia = Vector | tuple[Vector, Vector, Vector]
Quaternion = tuple[Number, Number, Number, Number]
Coefficients = Annotated[list[Number], Field(min_length=1, max_length=32)]


class _Section(BaseModel):
    """A mapping of a scenario file: unknown keys refused, numbers finite."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True
    )


def _one_of(section: BaseModel, *names: str) -> None:
    given = [name for name in names if getattr(section, name) is not None]
    if len(given) != 1:
        raise ValueError(f"exactly one of {', '.join(names)}")


class MountSection(_Section):
    """Where the arm's root link stands on the spacecraft."""

    xyz: Vector = (0.0, 0.0, 0.0)
    """Its origin in the spacecraft's frame [m]."""
    rpy: Vector = (0.0, 0.0, 0.0)
    """Roll, pitch, yaw about the spacecraft's x, y, z axes in this order [rad]."""


class SpacecraftSection(_Section):
    """A spacecraft to put under a bare arm; its origin is its own centre of mass."""

    mass: Positive
    """Without the arm [kg]."""
    inertia: Inertia
    """About its centre of mass [kg m²]: three principal moments, or the rows of a matrix."""
    mount: MountSection = MountSection()
    size: tuple[Positive, Positive, Positive] | None = None
    """Edges of the box that stands for it [m]."""


class PayloadSection(_Section):
    """Something that the end-effector holds rigidly."""

    mass: Positive
    """[kg]"""
    inertia: Inertia
    """About its centre of mass, axes of the end-effector [kg m²]; written as the spacecraft's."""
    com: Vector = (0.0, 0.0, 0.0)
    """Its centre of mass in the end-effector's frame [m]."""


class RobotSection(_Section):
    """Which robot."""

    urdf: Name
    """A URDF file, relative to the scenario file, the name of a bundled robot, or
    ``example-robot-data:NAME`` for one of that package's."""
    end_effector: Name
    """The link that follows the path."""
    scale_mass: Factor | dict[str, Factor] = 1.0
    """Factor on mass and inertia of every link, or a map from link to factor."""
    spacecraft: SpacecraftSection | None = None
    """Carries the arm, where the URDF is a bare arm's."""
    payload: PayloadSection | None = None
    """Held by the end-effector."""


class LineSection(_Section):
    """A straight line."""

    start: Vector = Field(alias="from")
    """Where it begins [m]."""
    end: Vector = Field(alias="to")
    """Where it ends [m]."""


class PolynomialSection(_Section):
    """Polynomials in s, coefficients [m] from the lowest power up."""

    x: Coefficients
    """Of the x coordinate."""
    y: Coefficients
    """Of the y coordinate."""
    z: Coefficients
    """Of the z coordinate."""


class ArcSection(_Section):
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


class OrientationSection(_Section):
    """An attitude, written in one of three ways."""

    quaternion: Quaternion | None = None
    """x, y, z, w."""
    rpy: Vector | None = None
    """Roll, pitch, yaw about the inertial x, y, z axes in this order [rad]."""
    axes: Axes | None = None
    """Inertial directions of two of its axes x, y, z; the first one named is kept."""

    @model_validator(mode="after")
    def _one(self) -> OrientationSection:
        _one_of(self, "quaternion", "rpy", "axes")
        return self


Orientation = Annotated[
    OrientationSection,
    BeforeValidator(
        lambda given: {"quaternion": given} if isinstance(given, list) else given,
        json_schema_input_type=OrientationSection | Quaternion,
    ),
]


class SlerpSection(_Section):
    """The shortest turn between two attitudes; a plain list is a quaternion x, y, z, w."""

    start: Orientation = Field(alias="from")
    """At the start of the path."""
    end: Orientation = Field(alias="to")
    """At its end."""


class FollowSection(_Section):
    """An axis along the direction of travel."""

    axis: Literal["x", "-x", "y", "-y"]
    """The end-effector's axis."""
    normal: Vector
    """Direction that its z axis keeps to."""


class PointAtSection(_Section):
    """An axis toward a point."""

    target: Vector
    """The point [m]."""
    axis: Literal["x", "-x", "y", "-y", "z", "-z"]
    """The end-effector's axis."""


class AttitudeSection(_Section):
    """How the end-effector stands, in one of four ways."""

    fixed: Orientation | None = None
    slerp: SlerpSection | None = None
    follow: FollowSection | None = None
    point_at: PointAtSection | None = None

    @model_validator(mode="after")
    def _one(self) -> AttitudeSection:
        _one_of(self, "fixed", "slerp", "follow", "point_at")
        return self


class PathSection(_Section):
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
        _one_of(self, "line", "polynomial", "arc", "waypoints", "samples")
        return self


class StopSection(_Section):
    """A rest on the way."""

    s: Number
    """Where, in (0, 1)."""
    t: Number
    """When [s]."""


class TimingSection(_Section):
    """When the end-effector is where."""

    duration: Number
    """Of the whole motion [s]."""
    law: TimeLaw = TimeLaw.QUINTIC
    """How each segment between rests is travelled."""
    stops: list[StopSection] = []
    """Rests on the way."""


class MarginSection(_Section):
    """How far from dynamic singularities to stay."""

    measure: Literal["gjm", "system", "arm", "sigma"] = "gjm"
    """det S*, det A, the arm's in-plane factor, or the smallest singular value of S*."""
    value: Annotated[float, Field(strict=True, ge=0.0)] | None = None
    """Magnitude the measure must keep."""
    fraction: Annotated[float, Field(strict=True, ge=0.0, lt=1.0)] | None = None
    """The same as a share of the measure's largest magnitude over the joint space."""

    @model_validator(mode="after")
    def _one(self) -> MarginSection:
        _one_of(self, "value", "fraction")
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


class RedundancySection(_Section):
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


class SearchSection(_Section):
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


class ScenarioFile(_Section):
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
