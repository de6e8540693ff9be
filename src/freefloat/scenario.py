"""Scenario files: a problem written down, read, and built with errors that say where."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ValidationError
from scipy.spatial.transform import Rotation

from freefloat.assembly import Mount, Payload, Spacecraft
from freefloat.attitude_law import (
    AttitudeLaw,
    FixedAttitude,
    SlerpAttitude,
    follow_attitude,
    point_at_attitude,
)
from freefloat.bundled import find_robot, find_scenario
from freefloat.curve import ArcCurve, Curve, PolynomialCurve, SplineCurve
from freefloat.errors import InputError
from freefloat.model import FreeFloatingModel
from freefloat.path import EndEffectorPath, parse_samples, samples_text
from freefloat.problem import Margin, Problem
from freefloat.redundancy import Redundancy
from freefloat.schema import (
    AttitudeSection,
    FollowSection,
    OrientationSection,
    PayloadSection,
    PolynomialSection,
    RedundancySection,
    ScenarioFile,
    SpacecraftSection,
)
from freefloat.search import Search
from freefloat.singularity import joint_space_extremes, measure
from freefloat.spatial import Array, axes_rotation, frozen, rotation_matrix, unit_quaternion
from freefloat.timing import Stop, TimedPath, Timing
from freefloat.yaml_file import parse_yaml, read_text


@dataclass(frozen=True, eq=False)
class Scenario:
    """A scenario file that passed the schema.

    Attributes:
        source: The file.
        text: Its text.
        content: Its data.
        samples: Text of the CSV file that its path comes from, where it does.
    """

    source: Path
    text: str
    content: ScenarioFile
    samples: str | None = None

    def model(self) -> FreeFloatingModel:
        """Load the robot."""
        robot = self.content.robot
        with self.told("robot."):
            return FreeFloatingModel.from_urdf(
                find_robot(robot.urdf, self.source.parent),
                robot.end_effector,
                scale_mass=robot.scale_mass,
                spacecraft=None if robot.spacecraft is None else _spacecraft(robot.spacecraft),
                payload=None if robot.payload is None else _payload(robot.payload),
            )

    def problem(self, model: FreeFloatingModel | None = None) -> Problem:
        """Build everything.

        Args:
            model: The robot, where it is at hand already.

        Raises:
            InputError: Naming this file and the key, or the file that it leads to.
        """
        content, model = self.content, model or self.model()
        with self.told("path."):
            curve, attitude = self._curve_and_attitude()
        timing = content.timing
        with self.told():
            path = EndEffectorPath(curve, attitude)
            stops = tuple(Stop(stop.s, stop.t) for stop in timing.stops)
            timed = TimedPath(path, Timing(timing.duration, timing.law, stops))
            margin = content.margin
            of = measure(model, content.task, margin.measure)
            value = margin.value
            if margin.fraction is not None:
                value = margin.fraction * joint_space_extremes(model, of).magnitude
            return Problem(
                model, timed, content.task, np.array(content.momentum), Margin(of, value or 0.0),
                None if content.redundancy is None else _redundancy(content.redundancy),
            )  # fmt: skip

    def search(self) -> Search:
        """What a plan should look for.

        Raises:
            InputError: Naming this file and the key.
        """
        given = self.content.search
        with self.told():
            now = given.from_attitude
            attitude = None if now is None else frozen(unit_quaternion("search.from_attitude", now))
            return Search(given.objective, attitude, given.samples, given.seed)

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
            file = self.source.parent / str(path.samples)
            curve, sampled = parse_samples(self.samples or "", file)
        return curve, self._attitude(curve, sampled)

    def _attitude(self, curve: Curve, sampled: AttitudeLaw | None) -> AttitudeLaw:
        given, task = self.content.path.attitude, self.content.task
        if given is not None and sampled is not None:
            raise InputError("attitude", "the samples have quaternions, too", "one of the two")
        if given is not None:
            return _law(given, curve)
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
    def told(self, prefix: str = "") -> Iterator[None]:
        """Tell errors with this file and the key in it, unless they name another file."""
        try:
            yield
        except InputError as error:
            if error.source is not None:
                raise
            raise error.found_in(str(self.source), prefix) from None


def _spacecraft(section: SpacecraftSection) -> Spacecraft:
    mount = Mount(np.array(section.mount.xyz), np.array(section.mount.rpy))
    size = None if section.size is None else np.array(section.size)
    return Spacecraft(section.mass, np.array(section.inertia), mount, size)


def _payload(section: PayloadSection) -> Payload:
    return Payload(section.mass, np.array(section.inertia), np.array(section.com))


def _redundancy(section: RedundancySection) -> Redundancy:
    own = section.model_dump(exclude_none=True)
    return Redundancy(**own)


def _rotation(section: OrientationSection, key: str) -> Array:
    """An attitude's axes in the inertial frame, shape (3, 3)."""
    if section.quaternion is not None:
        return rotation_matrix(unit_quaternion(f"{key}.quaternion", section.quaternion))
    if section.rpy is not None:
        return np.asarray(Rotation.from_euler("xyz", section.rpy).as_matrix())
    kept, bent = (section.axes or {}).items()
    return axes_rotation(f"{key}.axes", kept, bent)


def _law(section: AttitudeSection, curve: Curve) -> AttitudeLaw:
    """The attitude law along a curve."""
    if section.fixed is not None:
        return FixedAttitude(_rotation(section.fixed, "attitude.fixed"))
    if section.slerp is not None:
        start = _rotation(section.slerp.start, "attitude.slerp.from")
        return SlerpAttitude(start, _rotation(section.slerp.end, "attitude.slerp.to"))
    if section.point_at is not None:
        return point_at_attitude(curve, section.point_at.axis, section.point_at.target)
    follow = section.follow or FollowSection(axis="x", normal=(0.0, 0.0, 1.0))
    return follow_attitude(curve, follow.axis, follow.normal)


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
    return parse_scenario(read_text(source), source)


def parse_scenario(text: str, source: Path, samples: str | None = None) -> Scenario:
    """A scenario from its text.

    Args:
        text: What the file says.
        source: The file; named in errors, and what it leads to is looked for beside it.
        samples: Text of the CSV file that the path comes from; read where it is left out.

    Raises:
        InputError: As for :func:`load_scenario`.
    """
    try:
        content = ScenarioFile.model_validate(parse_yaml(text, source))
    except ValidationError as error:
        raise _first_error(error, ScenarioFile, source) from None
    if content.path.samples is not None and samples is None:
        samples = samples_text(source.parent / content.path.samples)
    return Scenario(source, text, content, samples)


_WORDS = {
    "float_type": "a number",
    "int_type": "an integer",
    "bool_type": "true or false",
    "string_type": "text",
    "finite_number": "a finite number",
    "tuple_type": "a list",
    "list_type": "a list",
    "dict_type": "keys and values",
    "model_type": "keys and values",
    "model_attributes_type": "keys and values",
    "string_too_short": "a name",
}
"""What is accepted, for the kinds of pydantic's errors whose own words are Python's."""


def _first_error(error: ValidationError, schema: type[BaseModel], source: Path) -> InputError:
    """Pydantic's first error in our words; unknown and missing keys before wrong values."""
    order = {"extra_forbidden": 0, "missing": 1}
    found = sorted(error.errors(), key=lambda e: order.get(e["type"], 2))
    first = found[0]
    location = [str(part) for part in first["loc"] if "[" not in str(part)]
    steps = [part for part in location if part not in ("constrained-float", "float")]
    key = ".".join(steps) or "file"
    kind, details = first["type"], first.get("ctx", {})
    if kind == "extra_forbidden":
        keys = _keys_at(schema, first["loc"][:-1])
        return InputError(key, "there is no such key", ", ".join(keys), str(source))
    if kind == "missing":
        if len(first["loc"]) > 1 and isinstance(first["loc"][-1], int):
            short = ".".join(steps[:-1])
            return InputError(
                short, "it is too short", "more entries, see freefloat schema", str(source)
            )
        return InputError(key, "it is missing", "a value, see freefloat schema", str(source))
    accepted = _WORDS.get(kind) or str(first["msg"]).removeprefix("Value error, ")
    if kind == "too_long":
        accepted = f"{details['max_length']} entries at most"
    if kind == "too_short":
        accepted = f"{details['min_length']} entries or more"
    if len(location) != len(steps):  # one factor, or a map
        accepted = "a number from 1e-06 to 1e+06, or a map from link to such a number"
    accepted = accepted.removeprefix("Input should be ")
    return InputError(key, f"{_short(first['input'])} was given", accepted, str(source))


def _short(given: Any) -> str:
    text = "nothing" if given is None else repr(given)
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
