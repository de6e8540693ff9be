"""Scenario files: a problem written down, checked against a schema, built with located errors."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    model_validator,
)
from scipy.spatial.transform import Rotation

from freefloat.attitude_law import (
    AttitudeLaw,
    FixedAttitude,
    SlerpAttitude,
    follow_attitude,
    point_at_attitude,
)
from freefloat.bundled import find_robot, find_scenario
from freefloat.curve import ArcCurve, Curve, PolynomialCurve, SplineCurve
from freefloat.dynamics import Task
from freefloat.errors import InputError
from freefloat.model import FreeFloatingModel
from freefloat.path import EndEffectorPath, read_samples
from freefloat.problem import Margin, Problem
from freefloat.singularity import joint_space_extremes, measure
from freefloat.spatial import Array, axes_rotation, rotation_matrix, unit_quaternion
from freefloat.timing import Stop, TimedPath, TimeLaw, Timing
from freefloat.yaml_file import read_yaml

Number = Annotated[float, Field(strict=True)]
Positive = Annotated[float, Field(strict=True, gt=0.0)]
Vector = tuple[Number, Number, Number]
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


class RobotSection(_Section):
    """Which robot."""

    urdf: str
    """A URDF file, relative to the scenario file, or the name of a bundled robot."""
    end_effector: str
    """The link that follows the path."""
    scale_mass: Positive | dict[str, Positive] = 1.0
    """Factor on mass and inertia of every link, or a map from link to factor."""


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


class AxesSection(_Section):
    """Two axes of the end-effector by their inertial directions; the first named is kept."""

    x: Vector | None = None
    y: Vector | None = None
    z: Vector | None = None

    @model_validator(mode="after")
    def _two(self) -> AxesSection:
        if len(self.model_fields_set) != 2 or None in (
            getattr(self, a) for a in self.model_fields_set
        ):
            raise ValueError("exactly two of x, y, z")
        return self


class OrientationSection(_Section):
    """An attitude, written in one of three ways."""

    quaternion: Quaternion | None = None
    """x, y, z, w."""
    rpy: Vector | None = None
    """Roll, pitch, yaw about the inertial x, y, z axes in this order [rad]."""
    axes: AxesSection | None = None
    """Directions of two axes."""

    @model_validator(mode="after")
    def _one(self) -> OrientationSection:
        _one_of(self, "quaternion", "rpy", "axes")
        return self

    def rotation(self, key: str) -> Array:
        """Its axes in the inertial frame, shape (3, 3)."""
        if self.quaternion is not None:
            return rotation_matrix(unit_quaternion(f"{key}.quaternion", self.quaternion))
        if self.rpy is not None:
            return np.asarray(Rotation.from_euler("xyz", self.rpy).as_matrix())
        named = [] if self.axes is None else self.axes.model_dump(exclude_none=True).items()
        kept, bent = named
        return axes_rotation(f"{key}.axes", kept, bent)


Orientation = Annotated[
    OrientationSection,
    BeforeValidator(lambda given: {"quaternion": given} if isinstance(given, list) else given),
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

    def law(self, curve: Curve) -> AttitudeLaw:
        """The attitude law along a curve."""
        if self.fixed is not None:
            return FixedAttitude(self.fixed.rotation("attitude.fixed"))
        if self.slerp is not None:
            return SlerpAttitude(self.slerp.start.rotation("attitude.slerp.from"),
                                 self.slerp.end.rotation("attitude.slerp.to"))  # fmt: skip
        if self.point_at is not None:
            return point_at_attitude(curve, self.point_at.axis, self.point_at.target)
        follow = self.follow or FollowSection(axis="x", normal=(0.0, 0.0, 1.0))
        return follow_attitude(curve, follow.axis, follow.normal)


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


@dataclass(frozen=True, eq=False)
class Scenario:
    """A scenario file that passed the schema.

    Attributes:
        source: The file.
        text: Its text.
        content: Its data.
    """

    source: Path
    text: str
    content: ScenarioFile

    def model(self) -> FreeFloatingModel:
        """Load the robot."""
        robot = self.content.robot
        with self._told("robot."):
            urdf = find_robot(robot.urdf, self.source.parent)
            return FreeFloatingModel.from_urdf(
                urdf, robot.end_effector, scale_mass=robot.scale_mass
            )

    def problem(self) -> Problem:
        """Build everything.

        Raises:
            InputError: Naming this file and the key, or the file that it leads to.
        """
        content, model = self.content, self.model()
        with self._told("path."):
            curve, attitude = self._curve_and_attitude()
        timing = content.timing
        with self._told():
            path = EndEffectorPath(curve, attitude)
            stops = tuple(Stop(stop.s, stop.t) for stop in timing.stops)
            timed = TimedPath(path, Timing(timing.duration, timing.law, stops))
            margin = content.margin
            of = measure(model, content.task, margin.measure)
            value = margin.value
            if margin.fraction is not None:
                value = margin.fraction * joint_space_extremes(model, of).magnitude
            return Problem(
                model, timed, content.task, np.array(content.momentum), Margin(of, value or 0.0)
            )

    def _curve_and_attitude(self) -> tuple[Curve, AttitudeLaw]:
        path, sampled = self.content.path, None
        curve: Curve
        if path.line is not None:
            curve = PolynomialCurve.line(path.line.start, path.line.end)
        elif path.polynomial is not None:
            curve = _polynomial(path.polynomial)
        elif path.arc is not None:
            arc = path.arc
            curve = ArcCurve(np.array(arc.center), np.array(arc.start), np.array(arc.normal),
                             float(np.deg2rad(arc.angle_deg)))  # fmt: skip
        elif path.waypoints is not None:
            curve = SplineCurve(path.waypoints)
        else:
            curve, sampled = read_samples(self.source.parent / str(path.samples))
        return curve, self._attitude(curve, sampled)

    def _attitude(self, curve: Curve, sampled: AttitudeLaw | None) -> AttitudeLaw:
        given, task = self.content.path.attitude, self.content.task
        if given is not None and sampled is not None:
            raise InputError("attitude", "the samples have quaternions, too", "one of the two")
        if given is not None:
            return given.law(curve)
        if sampled is not None:
            return sampled
        if task.turns:
            raise InputError(
                "attitude",
                f"it is missing, task {task} needs it",
                "fixed, slerp, follow or point_at",
            )
        return FixedAttitude(np.eye(3))

    @contextmanager
    def _told(self, prefix: str = "") -> Iterator[None]:
        """Tell errors with this file and the key in it, unless they name another file."""
        try:
            yield
        except InputError as error:
            if error.source is not None:
                raise
            raise error.found_in(str(self.source), prefix) from None


def _polynomial(section: PolynomialSection) -> PolynomialCurve:
    columns = (section.x, section.y, section.z)
    coefficients = np.zeros((max(map(len, columns)), 3))
    for axis, column in enumerate(columns):
        coefficients[: len(column), axis] = column
    return PolynomialCurve(coefficients)


def load_scenario(name: str | Path) -> Scenario:
    """Read a scenario.

    Args:
        name: A file, or the name of a bundled scenario such as ``spatial_6dof/line``.

    Raises:
        InputError: Naming the file, the key, what was given and what is accepted.
    """
    source = find_scenario(str(name))
    text, data = read_yaml(source)
    try:
        return Scenario(source, text, ScenarioFile.model_validate(data))
    except ValidationError as error:
        raise _first_error(error, ScenarioFile, source) from None


def _first_error(error: ValidationError, schema: type[BaseModel], source: Path) -> InputError:
    """Pydantic's first error in our words; unknown and missing keys before wrong values."""
    order = {"extra_forbidden": 0, "missing": 1}
    first = min(error.errors(), key=lambda e: order.get(e["type"], 2))
    key = ".".join(str(part) for part in first["loc"]) or "file"
    if first["type"] == "extra_forbidden":
        keys = _keys_at(schema, first["loc"][:-1])
        return InputError(key, "there is no such key", ", ".join(keys), str(source))
    if first["type"] == "missing":
        return InputError(key, "it is missing", "a value, see freefloat schema", str(source))
    accepted = str(first["msg"]).removeprefix("Value error, ").removeprefix("Input should be ")
    return InputError(key, f"{_short(first['input'])} was given", accepted, str(source))


def _short(given: Any) -> str:
    text = repr(given)
    return text if len(text) <= 80 else text[:77] + "..."


def _keys_at(schema: type[BaseModel], location: tuple[int | str, ...]) -> list[str]:
    """The keys that the section at a location knows."""
    for part in location:
        for name, info in schema.model_fields.items():
            if part in (name, info.alias):
                schema = next(_sections_in(info.annotation), schema)
    return [info.alias or name for name, info in schema.model_fields.items()]


def _sections_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in getattr(annotation, "__args__", ()):
        yield from _sections_in(part)
