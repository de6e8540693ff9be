"""Scenario files: a problem written down, read, and built with errors that say where."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from freefloat.brief import brief
from freefloat.dynamics.measures import largest_magnitude, measure
from freefloat.dynamics.redundancy import Redundancy
from freefloat.errors import InputError, did_you_mean
from freefloat.io.robot_parts import RobotParts
from freefloat.io.robot_schema import RobotFile
from freefloat.io.schema import (
    AttitudeSection,
    FollowSection,
    JointLimits,
    OrientationSection,
    PolynomialSection,
    RedundancySection,
    ScenarioFile,
)
from freefloat.io.schema_errors import validated
from freefloat.io.yaml import parse_yaml, read_text
from freefloat.limits.limits import Limits
from freefloat.motion.problem import Margin, Problem
from freefloat.paths.curves import ArcCurve, Curve, PolynomialCurve, SplineCurve
from freefloat.paths.orientation import (
    DirectedOrientation,
    FixedOrientation,
    FreeOrientation,
    OrientationLaw,
    SlerpOrientation,
)
from freefloat.paths.path import EndEffectorPath, parse_samples, samples_text
from freefloat.paths.timing import Stop, TimedPath, Timing
from freefloat.planning.options import Search
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.names import find_robot, find_scenario
from freefloat.so3 import Array, axes_rotation, frozen, rotation_matrix, unit_quaternion


@dataclass(frozen=True, eq=False)
class Scenario:
    """A scenario file that passed the schema.

    Attributes:
        source: The file.
        text: Its text.
        content: Its data.
        samples: Text of the CSV file that its path comes from, where it does.
    """

    __repr__ = brief

    source: Path
    text: str
    content: ScenarioFile
    samples: str | None = None

    def urdf(self) -> Path:
        """The robot's file; of a robot put together in the scenario the arm's."""
        with self.told("robot."):
            return find_robot(self.content.robot.urdf, self.source.parent)

    def model(self) -> FreeFloatingModel:
        """Load the robot."""
        return RobotParts.of(self.content.robot, self.source).model()

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
                value = margin.fraction * largest_magnitude(model, of)
            return Problem(
                model, timed, content.task, np.array(content.momentum), Margin(of, value or 0.0),
                None if content.redundancy is None else _redundancy(content.redundancy),
            )  # fmt: skip

    def stretched(self, factor: float) -> Scenario:
        """The same scenario with all times of its path multiplied by a factor."""
        data = parse_yaml(self.text, self.source)
        timing = data["timing"]
        timing["duration"] = float(timing["duration"]) * factor
        for stop in timing.get("stops", []):
            stop["t"] = float(stop["t"]) * factor
        text = yaml.safe_dump(data, sort_keys=False)
        return parse_scenario(text, self.source, self.samples)

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

    def limits(self, model: FreeFloatingModel | None = None) -> Limits:
        """What motions may ask for.

        Args:
            model: The robot, where it is at hand already.

        Raises:
            InputError: If a joint is unknown, or the URDF does not tell a limit that is wanted of
                it.
        """
        given, model = self.content.limits, model or self.model()
        with self.told("limits."):
            speeds, efforts = (
                {body.joint: getattr(body, name) for body in model.bodies[1:]}
                for name in ("rated_speed", "rated_effort")
            )
            return Limits(
                _joint_limits("joint_rate", given.joint_rate, speeds),
                _joint_limits("joint_torque", given.joint_torque, efforts),
                given.base_rate,
                given.clearance,
            )

    def _curve_and_attitude(self) -> tuple[Curve, OrientationLaw]:
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

    def _attitude(self, curve: Curve, sampled: OrientationLaw | None) -> OrientationLaw:
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
        return FreeOrientation()

    @contextmanager
    def told_path(self) -> Iterator[None]:
        """Tell errors about the path with this file, and others as they are."""
        try:
            yield
        except InputError as error:
            raise (error.found_in(str(self.source)) if error.key == "path" else error) from None

    @contextmanager
    def told(self, prefix: str = "") -> Iterator[None]:
        """Tell errors with this file and the key in it, unless they name another file."""
        try:
            yield
        except InputError as error:
            if error.source is not None:
                raise
            raise error.found_in(str(self.source), prefix) from None


def _joint_limits(key: str, given: JointLimits | None, rated: dict[str, float]) -> Array | None:
    """Limits joint by joint, infinite where a map leaves one out; None where none are given."""
    if given is None:
        return None
    if given == "urdf":
        untold = [joint for joint, value in rated.items() if not np.isfinite(value)]
        if untold:
            raise InputError(
                key,
                f"the URDF tells none for {', '.join(untold)}",
                "a number, or a map from joint to number",
            )
        return np.array(list(rated.values()))
    if isinstance(given, dict):
        for joint in given:
            if joint not in rated:
                told = f"no such joint moves{did_you_mean(joint, rated)}"
                raise InputError(f"{key}.{joint}", told, ", ".join(rated))
        return np.array([given.get(joint, np.inf) for joint in rated])
    return np.full(len(rated), given)


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


def _law(section: AttitudeSection, curve: Curve) -> OrientationLaw:
    """The attitude law along a curve."""
    if section.fixed is not None:
        return FixedOrientation(_rotation(section.fixed, "attitude.fixed"))
    if section.slerp is not None:
        start = _rotation(section.slerp.start, "attitude.slerp.from")
        return SlerpOrientation(start, _rotation(section.slerp.end, "attitude.slerp.to"))
    if section.point_at is not None:
        return DirectedOrientation.point_at(curve, section.point_at.axis, section.point_at.target)
    follow = section.follow or FollowSection(axis="x", normal=(0.0, 0.0, 1.0))
    return DirectedOrientation.follow(curve, follow.axis, follow.normal)


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


def load_robot(name: str | Path) -> RobotParts:
    """Read the robot of a scenario, or of a file that says nothing but ``robot``.

    Args:
        name: A file, or the name of a bundled scenario.

    Raises:
        InputError: As for :func:`load_scenario`.
    """
    source = find_scenario(str(name))
    data = parse_yaml(read_text(source), source)
    if isinstance(data, dict) and list(data) == ["robot"]:
        section = validated(RobotFile, data, source).robot
    else:
        section = validated(ScenarioFile, data, source).robot
    return RobotParts.of(section, source)


def parse_scenario(text: str, source: Path, samples: str | None = None) -> Scenario:
    """A scenario from its text.

    Args:
        text: What the file says.
        source: The file; named in errors, and what it leads to is looked for beside it.
        samples: Text of the CSV file that the path comes from; read where it is left out.

    Raises:
        InputError: As for :func:`load_scenario`.
    """
    content = validated(ScenarioFile, parse_yaml(text, source), source)
    if content.path.samples is not None and samples is None:
        samples = samples_text(source.parent / content.path.samples)
    return Scenario(source, text, content, samples)
