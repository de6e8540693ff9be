"""Scenario files: a problem, its search and its limits as YAML, and back."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.redundancy import Redundancy
from freefloat.dynamics.system import System
from freefloat.errors import InputError
from freefloat.io.scenario.arms_section import curves_of
from freefloat.io.scenario.limits_section import limits_of
from freefloat.io.scenario.path_schema import PathSection
from freefloat.io.scenario.path_section import frame_of, path_of
from freefloat.io.scenario.planned import PlannedScenario
from freefloat.io.scenario.robot_section import RobotFile
from freefloat.io.scenario.scene_section import FileShapes
from freefloat.io.scenario.schema import OF_PATHS, ScenarioFile
from freefloat.io.scenario.yaml import error_context, file_keys, parse_yaml, read_text, validated
from freefloat.kinds import SECTIONS, named
from freefloat.limits.limits import Limits
from freefloat.motion.joint_curves import ArmCurves
from freefloat.motion.margin import Margin
from freefloat.motion.problem import Problem
from freefloat.paths.relative_path import RelativePath
from freefloat.paths.timed_path import PathStack, TimedPath, path_key
from freefloat.paths.timing import Timing
from freefloat.planning.settings import Search
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.named_files import find_scenario
from freefloat.robot.source import RobotSource
from freefloat.scene.scene import Scene
from freefloat.scene.scene_body import SceneBody
from freefloat.singularities.global_maximum import largest_magnitude
from freefloat.so3 import Pose


@dataclass(frozen=True, eq=False)
class Scenario(PlannedScenario):
    """A scenario file that passed the schema; robot and problem are built once, when needed.

    Attributes:
        source: The file.
        text: Text of the file.
        content: Data of the file.
        samples: Texts of the CSV files of its paths, by the names that it gives them.
        robot: The robot, if it does not come from the files that the scenario names.
        shapes: Shapes of bodies of the scene, by name, likewise.
    """

    source: Path
    text: str = field(repr=False)
    content: ScenarioFile = field(repr=False)
    samples: Mapping[str, str] = field(default_factory=dict, repr=False)
    robot: FreeFloatingModel | None = field(default=None, repr=False)
    shapes: FileShapes = field(default_factory=dict, repr=False)

    def robot_sources(self) -> tuple[RobotSource, ...]:
        """The file of the robot, then those that are attached to it."""
        robot, file = self.content.robot, self.source
        return robot.source(file), *(RobotSource.of(part.urdf) for part in robot.parts(file))

    def model(self) -> FreeFloatingModel:
        """The robot."""
        return self._model

    @cached_property
    def _model(self) -> FreeFloatingModel:
        return self.robot or self.content.robot.to_model(self.source)

    def problem(self) -> Problem:
        """The problem that the scenario poses.

        Raises:
            InputError: If it is invalid; it names the file and the key.
        """
        return self._problem

    @cached_property
    def _problem(self) -> Problem:
        content, model, arms = self.content, self.model(), self._curves
        with self.error_context():
            if content.goal is not None:
                problem = "the scenario has a goal in place of a path"
                raise InputError("goal", problem, "path, timing and task; plan finds the motion")
            timing = content.timing.to_timing()
        limits, scene = self.limits(), self.scene()
        timed = self._path(content.path, "", timing, scene)
        further = {}
        for name, section in content.robot.own_paths.items():
            with self.error_context():
                if section.samples is not None:
                    problem, key = "a file was given for the path of a further arm", path_key(name)
                    raise InputError(f"{key}.samples", problem, "waypoints, or another curve")
            further[name] = self._path(section, name, timing, scene)
        with self.error_context():
            value = content.margin.value or 0.0
            with file_keys(measure="margin.measure"):
                measure = singularity_measure(model, content.task, content.margin.measure)
            if content.margin.fraction is not None:
                value = content.margin.fraction * largest_magnitude(model, content.task, measure)
            redundancy = None
            if content.redundancy is not None:
                redundancy = Redundancy(**content.redundancy.model_dump(exclude_none=True))
            if further:
                timed = PathStack.of(timed, further)
            momentum, margin = np.array(content.momentum), Margin(measure, value)
            return Problem(
                model, timed, content.task, momentum, margin, redundancy, scene=scene,
                wheel_momentum=np.array(content.wheels.momentum), arms=arms, limits=limits,
            )  # fmt: skip

    @cached_property
    def _curves(self) -> ArmCurves:
        content = self.content
        return curves_of(content.robot.arms, self.model(), self.source, content.timing.duration)

    def frame(self, section: PathSection, arm: str, scene: Scene) -> Pose | SceneBody | None:
        """The frame of a path for the arm with a name, see :func:`.path_section.frame_of`."""
        model, now = self.model(), self._curves.at(0.0)
        joint = model.joint_names.index(model.joints_of_arm(arm)[0]) if arm else 0
        return frame_of(section.frame, model, self.search(), scene, now, joint)

    def _path(self, section: PathSection, arm: str, timing: Timing, scene: Scene) -> TimedPath:
        """The path of a section, for the arm with a name."""
        key = path_key(arm)
        with self.error_context(), file_keys(path=key):
            frame = self.frame(section, arm, scene)
        with self.error_context(f"{key}."):
            known = frame if isinstance(frame, Pose) else None
            path = path_of(section, self.content.task, self.samples, self.source.parent, known)
        with self.error_context(), file_keys(path=key):
            drift = np.array(self.content.drift)
            if isinstance(frame, SceneBody):  # it tumbles
                return RelativePath(frame, path, timing).timed(drift)
            return TimedPath(path, timing, drift)

    def system(self) -> System:
        """The robot with its momentum, wheels and drift."""
        return self._system

    @cached_property
    def _system(self) -> System:
        content, model = self.content, self.model()
        with self.error_context():
            vectors = (content.momentum, content.wheels.momentum, content.drift)
            return System(model, *map(np.array, vectors))

    def scene(self) -> Scene:
        """Bodies and corridor; raises an InputError that names the file and the key."""
        with self.error_context():
            return self.content.scene.to_scene(self.source.parent, self.shapes)

    def goal(self) -> Any:
        """The goal that the scenario has in place of a path; None where it has a path."""
        with self.error_context():
            section = self.content.goal
            if section is None:
                return None
            self.model().require_supported("motions to a goal")
            return section.to_goal(self.model())

    def search(self) -> Search:
        """The search for a plan.

        Raises:
            InputError: If it is invalid; it names the file and the key.
        """
        arguments = self.content.search.attributes()
        del arguments["reorient"]
        with self.error_context():
            return Search(**arguments)

    def phases(self) -> tuple[Any, ...]:
        """What follows the path, see :func:`freefloat.plan_manoeuvre`.

        Raises:
            InputError: If a value is invalid, or a phase cannot follow those before; it names the
                file and the key.
        """
        if not self.content.phases:
            return ()
        phases: tuple[Any, ...] = named(SECTIONS["phases"].posed)(self).phases
        return phases

    @property
    def has_phases(self) -> bool:
        """Whether ``plan`` finds a manoeuvre: phases follow the path, or a reorientation leads."""
        return bool(self.content.phases) or self.content.search.reorient

    def limits(self) -> Limits:
        """The limits of the problem's motions.

        Raises:
            InputError: If a joint is unknown, or the URDF lacks a limit that is taken from it.
        """
        with self.error_context("limits."):
            return limits_of(self.content.limits, self.model())

    def error_context(
        self, prefix: str = "", options: Sequence[str] = ()
    ) -> AbstractContextManager[None]:
        """Context in which errors name this file, see :func:`.yaml.error_context`."""
        return error_context(self.source, prefix, options)


def load_scenario(name: str | Path | dict[str, Any]) -> Scenario:
    """Scenario of a file, or of a dictionary with the keys of one.

    Args:
        name: A file, the name of a bundled scenario such as ``spatial_6dof/line``, or a dictionary,
            whose numbers may be NumPy's and whose paths are relative to the working folder.

    Raises:
        InputError: If it is invalid: file, line, key, value given and values accepted.

    Example:
        >>> scenario = ff.load_scenario("spatial_6dof/line")
        >>> scenario.problem().path.duration
        100.0
    """
    if isinstance(name, dict):
        plain = json.loads(json.dumps(name, default=_plain))
        return parse_scenario(yaml.safe_dump(plain, sort_keys=False), Path("scenario"))
    source = find_scenario(str(name))
    return parse_scenario(read_text(source), source)


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)


def load_robot(name: str | Path) -> FreeFloatingModel:
    """Model of the robot of a scenario, or of a file with nothing but ``robot``.

    Raises:
        InputError: As for :func:`load_scenario`.
    """
    source = find_scenario(str(name))
    text = read_text(source)
    data = parse_yaml(text, source)
    schema: type[RobotFile | ScenarioFile] = RobotFile if list(data) == ["robot"] else ScenarioFile
    return validated(schema, data, source, text).robot.to_model(source)


def parse_scenario(
    text: str,
    source: Path,
    samples: Mapping[str, str] | None = None,
    robot: FreeFloatingModel | None = None,
    shapes: FileShapes | None = None,
) -> Scenario:
    """Scenario of a text.

    Args:
        text: Content of the file.
        source: The file: named in errors, and the folder of the files that the text names.
        samples: Texts of the CSV files of its paths, by name; default: read from the files.
        robot: The robot; default: the robot of the files that the scenario names.
        shapes: Shapes of bodies of the scene, likewise.

    Raises:
        InputError: As for :func:`load_scenario`.
    """
    data = parse_yaml(text, source)
    content = validated(ScenarioFile, data, source, text)
    if content.goal is not None:
        given = [*data, *(f"search.{key}" for key in data.get("search") or ())]
        if unused := [key for key in given if key in OF_PATHS]:
            accepted = f"a scenario with a goal, without {', '.join(unused)}"
            with error_context(source):
                raise InputError(unused[0], "motions to a goal do not use it", accepted)
    if samples is None:
        samples = content.sample_texts(source.parent)
    return Scenario(source, text, content, samples, robot, shapes or {})
