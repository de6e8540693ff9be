"""Goals and phases in scenario files: what takes the place of a path, and what follows it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np
from pydantic import model_validator

from freefloat.dynamics.tasks import Task
from freefloat.errors import InputError
from freefloat.io.scenario.field_types import (
    Inertia,
    Name,
    NotNegative,
    Number,
    Orientation,
    Positive,
    Quaternion,
    Section,
    Vector,
    exactly_one_of,
    rotation_of,
)
from freefloat.io.scenario.path_schema import FrameName, PathSection, TimingSection, timing_content
from freefloat.io.scenario.path_section import path_of, section_of
from freefloat.motion.problem import Problem
from freefloat.paths.relative_path import RelativePath
from freefloat.paths.timed_path import TimedPath
from freefloat.robot.model import FreeFloatingModel
from freefloat.scene.scene import Scene
from freefloat.so3 import Pose

if TYPE_CHECKING:  # every scenario file has these keys, few have phases
    from freefloat.beyond.missions.goals.goal import Goal
    from freefloat.beyond.missions.manoeuvre import Phase


class PoseSection(Section):
    """A pose of the end-effector."""

    position: Vector
    """Position [m]."""
    orientation: Orientation | None = None
    """Default: along the axes of the frame."""
    frame: Name = "inertial"
    """Frame of both: ``inertial``, whose origin is the centre of mass at time zero; ``spacecraft``,
    ``base`` or ``end_effector``, where the motion begins; or a body of the scene at the end, whose
    twist the end-effector has then."""

    def to_pose(self, key: str) -> Pose:
        """The pose; raises an InputError that names keys below a key if the orientation is none."""
        rotation = np.eye(3)
        if self.orientation is not None:
            rotation = rotation_of(self.orientation, f"{key}.orientation")
        return Pose(np.array(self.position), rotation)


class GoalSection(Section):
    """What shall hold at the end of a motion of the joints: pose or joints, attitude, or both."""

    pose: PoseSection | None = None
    """Pose of the end-effector."""
    attitude: Quaternion | None = None
    """Attitude of the spacecraft, quaternion x, y, z, w."""
    joints: list[Number] | dict[str, Number] | None = None
    """Joints [rad, m]: in the order of the chain, or by name."""
    duration: Positive | None = None
    """Duration [s]; default: the shortest one found that limits of rates and torques permit."""

    @model_validator(mode="after")
    def _asks_for_something(self) -> GoalSection:
        if (self.pose, self.attitude, self.joints) == (None, None, None):
            raise ValueError("pose, attitude or joints")
        return self

    def to_goal(self, model: FreeFloatingModel) -> Goal:
        """The goal; raises an InputError if a value is invalid, naming keys below ``goal``."""
        from freefloat.beyond.missions.goals.goal import Goal

        pose, frame = None, "inertial"
        if self.pose is not None:
            pose, frame = self.pose.to_pose("goal.pose"), self.pose.frame
        joints = None if self.joints is None else model.joint_vector(self.joints, "goal.joints")
        attitude = None if self.attitude is None else np.array(self.attitude)
        return Goal(pose, attitude, joints, frame, self.duration)


class ToSection(PoseSection):
    """A pose to which the end-effector moves from where it is, on the shortest way."""

    frame: Literal["inertial", "spacecraft", "base", "end_effector"] = "inertial"
    """Frame of position and orientation: ``inertial``, from the centre of mass at time zero; or,
    where the phase begins, the frame of the root link, of the link that carries the first joint,
    or of the end-effector."""


class CaptureSection(Section):
    """A body of the scene that is grasped: it becomes a payload."""

    body: Name
    """Name of the body."""
    mass: Positive
    """Mass [kg]."""
    inertia: Inertia | None = None
    """Inertia about its centre of mass, axes of its frame [kg m²]; default: the inertia of its
    tumbling."""
    com: Vector | None = None
    """Centre of mass in its frame [m]; default: the centre of mass of its tumbling, or zero."""


class PhaseSection(Section):
    """A phase after the path, from the state at which the one before ends: exactly one kind."""

    name: Name | None = None
    """Name of the phase, unlike the names of other phases; default: its kind, with a number where
    another phase has that name: ``goal``, ``goal 2``."""
    path: PathSection | None = None
    """A path that begins with the end-effector's pose and velocity; its frame is ``inertial`` or a
    body of the scene."""
    to: ToSection | None = None
    """A pose at which the end-effector comes to rest, on the shortest way."""
    joints: list[Number] | dict[str, Number] | None = None
    """Joints at which the arm comes to rest [rad, m], in the order of the chain, or by name: the
    short form of a goal with these joints and the duration."""
    goal: GoalSection | None = None
    """What shall hold at its end; the motion of the joints to it is found."""
    capture: CaptureSection | None = None
    timing: TimingSection | None = None
    """Time law of a path; ``optimal`` with speeds only."""
    duration: Positive | None = None
    """Duration of the motion to a pose or to joints [s]; of joints by default the shortest one
    found that limits of rates and torques permit."""
    margin: NotNegative = 0.0
    """Smallest allowed magnitude of ``margin.measure`` on a path or to a pose."""

    _exactly_one = exactly_one_of("path", "to", "joints", "goal", "capture")

    @model_validator(mode="after")
    def _has_its_time(self) -> PhaseSection:
        if (self.path is not None) != (self.timing is not None):
            raise ValueError("path together with its timing, such as timing: {duration: 40}")
        if self.to is not None and self.duration is None:
            raise ValueError("duration together with to")
        if self.to is None and self.joints is None and self.duration is not None:
            raise ValueError("duration together with to or joints; paths have timing.duration")
        if "margin" in self.model_fields_set and self.path is None and self.to is None:
            raise ValueError("margin together with path or to")
        return self

    def to_phase(
        self, problem: Problem, folder: Path, samples: Mapping[str, str], seed: int
    ) -> Phase:
        """The phase.

        Args:
            problem: Problem of the scenario.
            folder: Folder of the files that it names.
            samples: Texts of the CSV files among them, by name.
            seed: Seed of the search for a motion to a goal.

        Raises:
            InputError: If a value is invalid; keys are below the key of its kind.
        """
        from freefloat.beyond.missions.capture_phase import CapturePhase
        from freefloat.beyond.missions.goal_phase import GoalPhase
        from freefloat.beyond.missions.goals.goal import Goal, require_inside
        from freefloat.beyond.missions.path_phase import PathPhase

        name = self.name or ""
        if self.capture is not None:
            return CapturePhase(name=name, **self.capture.model_dump())
        if self.goal is not None:
            return GoalPhase(self.goal.to_goal(problem.model), name, seed)
        if self.joints is not None:
            joints = problem.model.joint_vector(self.joints, "joints")
            require_inside(problem.model, joints, "joints")
            return GoalPhase(Goal(joints=joints, duration=self.duration), name, seed)
        if self.to is not None:
            pose = self.to.to_pose("to")
            straight = Goal(pose, frame=self.to.frame, duration=self.duration)
            return PathPhase(straight, name, self.margin)
        path = self._path(problem.task, problem.scene, folder, samples)
        return PathPhase(path, name, self.margin)

    def _path(
        self, task: Task, scene: Scene, folder: Path, samples: Mapping[str, str]
    ) -> TimedPath | RelativePath:
        from freefloat.beyond.missions.state import keys_within

        section, timing = cast(PathSection, self.path), cast(TimingSection, self.timing)
        kind = section.frame
        known = [FrameName.INERTIAL, *scene.names]
        if kind not in known:
            raise InputError("path.frame", f"{kind!s} was given", ", ".join(known))
        with keys_within("path"):
            path = path_of(section, task, samples, folder, None)
        if kind is FrameName.INERTIAL:
            return TimedPath(path, timing.to_timing())
        return RelativePath(scene.bodies[scene.names.index(kind)], path, timing.to_timing())


def phases_content(phases: Sequence[Phase]) -> tuple[list[dict[str, Any]], dict[str, str]]:
    """Contents of the sections that describe phases, and texts of CSV files by name.

    Raises an InputError if scenario files cannot describe one.
    """
    from freefloat.beyond.missions.goals.goal import Goal
    from freefloat.beyond.missions.path_phase import PathPhase
    from freefloat.beyond.missions.state import keys_within

    contents: list[dict[str, Any]] = []
    samples: dict[str, str] = {}
    for number, phase in enumerate(phases):
        with keys_within(f"phases.{number}"):
            content = {"name": phase.name, **phase.to_dict()}
            if isinstance(phase, PathPhase) and not isinstance(phase.path, Goal):
                path, texts = section_of(phase.path.path, f"phase_{number}.csv")
                if isinstance(phase.path, RelativePath):
                    path["frame"] = phase.path.body.name
                content |= {"path": path, "timing": timing_content(phase.path.timing)}
                samples |= texts
        contents.append(content)
    return contents, samples
