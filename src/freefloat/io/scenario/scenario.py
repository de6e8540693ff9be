"""What a scenario file poses: a problem, its search, its limits; and what planning finds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from freefloat.concurrency import Progress, working_folder
from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.redundancy import Redundancy
from freefloat.dynamics.system import System
from freefloat.errors import InputError
from freefloat.io.scenario.arms_section import curves_of
from freefloat.io.scenario.limits_section import limits_of
from freefloat.io.scenario.path_schema import PathSection
from freefloat.io.scenario.path_section import frame_of, path_of
from freefloat.io.scenario.scene_section import FileShapes
from freefloat.io.scenario.schema import ScenarioFile
from freefloat.io.scenario.yaml import error_context, file_keys
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
from freefloat.scene.scene import Scene
from freefloat.scene.scene_body import SceneBody
from freefloat.singularities.global_maximum import largest_magnitude
from freefloat.so3 import Array, Pose

if TYPE_CHECKING:  # compiled kernels are slow to import
    from freefloat.planning.margin_map import HeadingMap
    from freefloat.planning.simulation import Simulation
    from freefloat.planning.space.attitude_map import AttitudeMap


@dataclass(frozen=True, eq=False)
class Scenario:
    """A scenario file that passed the schema; robot and problem are built once, when needed.

    Attributes:
        source: The file.
        text: Text of the file.
        content: Data of the file.
        samples: Texts of the CSV files of its paths, by the names that it gives them.
        robot: The robot, if it does not come from the files that the scenario names.
        shapes: Shapes of bodies of the scene, by name, likewise.
        start_joints: Joints that the arm starts near, of a problem that says so; shape (n,).
        folder: Working folder when it was read.
    """

    source: Path
    text: str = field(repr=False)
    content: ScenarioFile = field(repr=False)
    samples: Mapping[str, str] = field(default_factory=dict, repr=False)
    robot: FreeFloatingModel | None = field(default=None, repr=False)
    shapes: FileShapes = field(default_factory=dict, repr=False)
    start_joints: Array | None = field(default=None, repr=False)
    folder: str = field(default_factory=working_folder, repr=False, compare=False)

    @property
    def file(self) -> Path:
        """The file by a name that leads to it, also after the working folder has changed."""
        return self.source if self.folder == working_folder() else Path(self.folder, self.source)

    def model(self) -> FreeFloatingModel:
        """The robot."""
        return self._model

    @cached_property
    def _model(self) -> FreeFloatingModel:
        return self.robot or self.content.robot.to_model(self.file)

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
        own = content.robot.own_paths.items()
        further = {name: self._path(section, name, timing, scene) for name, section in own}
        with self.error_context():
            value = content.margin.value or 0.0
            with file_keys(measure="margin.measure"):
                measure = singularity_measure(model, content.task, content.margin.measure)
            if content.margin.fraction is not None:
                value = content.margin.fraction * largest_magnitude(model, content.task, measure)
            stated = content.redundancy
            redundancy = Redundancy(**stated.model_dump(exclude_none=True)) if stated else None
            if further:
                timed = PathStack.of(timed, further)
            momentum, margin = np.array(content.momentum), Margin(measure, value)
            return Problem(
                model, timed, content.task, momentum, margin, redundancy, self.start_joints,
                wheel_momentum=np.array(content.wheels.momentum), scene=scene, arms=arms,
                limits=limits,
            )  # fmt: skip

    @cached_property
    def _curves(self) -> ArmCurves:
        content = self.content
        return curves_of(content.robot.arms, self.model(), self.file, content.timing.duration)

    def frame(self, section: PathSection, arm: str, scene: Scene) -> Pose | SceneBody | None:
        """The frame of a path for the arm with a name, see :func:`.path_section.frame_of`."""
        model, now = self.model(), self._curves.at(0.0)
        joint = model.joint_names.index(model.joints_of_arm(arm)[0]) if arm else 0
        return frame_of(section.frame, model, self.search(), scene, now, joint)

    def _path(self, section: PathSection, arm: str, timing: Timing, scene: Scene) -> TimedPath:
        """The path of a section, for the arm with a name."""
        key = path_key(arm)
        with self.error_context(), file_keys(path=key):
            if arm and section.samples is not None:
                problem = "a file was given for the path of a further arm"
                raise InputError("path.samples", problem, "waypoints, or another curve")
            frame = self.frame(section, arm, scene)
        with self.error_context(f"{key}."):
            known = frame if isinstance(frame, Pose) else None
            path = path_of(section, self.content.task, self.samples, self.file.parent, known)
        with self.error_context(), file_keys(path=key):
            if isinstance(frame, SceneBody):  # it tumbles
                return RelativePath(frame, path, timing).timed(np.array(self.content.drift))
            return TimedPath(path, timing, np.array(self.content.drift))

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
            return self.content.scene.to_scene(self.file.parent, self.shapes)

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
            InputError: If a value is invalid, or a phase cannot follow the phases before it.
        """
        if not self.content.phases:
            return ()
        phases: tuple[Any, ...] = named(SECTIONS["phases"].posed)(self).phases
        return phases

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

    def plan(
        self, *, stretch: bool = False, threads: int | None = None, progress: Progress | None = None
    ) -> Any:
        """What the command ``plan`` finds.

        Args:
            stretch: Whether the duration may grow until rates and torques keep their limits.
            threads: Number of cores to use; all available ones when left out.
            progress: Called with the fraction done, in [0, 1].

        Returns:
            A plan of the path; a manoeuvre where phases follow it or a reorientation leads to it; a
            motion of the joints where the scenario has a goal.

        Raises:
            InputError: If a value of the scenario is not accepted, or what is not a path alone is
                to be stretched.

        Example:
            >>> ff.load_scenario("planar_2dof/line").plan().feasible
            True
        """
        key = "phases" if self.content.phases or self.content.search.reorient else "goal"
        if key == "goal" and self.content.goal is None:
            from freefloat.planning.planner import plan

            problem, search = self.problem(), self.search()
            with self.error_context():
                return plan(problem, search, stretch=stretch, threads=threads, progress=progress)
        if stretch:
            reason = "a goal or phases have durations of their own"
            raise InputError("stretch", reason, "longer durations in the scenario")
        return named(SECTIONS[key].posed)(self).plan(threads=threads, progress=progress)

    def simulate(
        self,
        attitude: npt.ArrayLike | None = None,
        *,
        heading: float | None = None,
        branch: int | None = None,
        joints: npt.ArrayLike | None = None,
        stop_at_margin: bool = False,
    ) -> Simulation:
        """The motions of all arm branches from one attitude, as the command ``simulate``.

        The arguments are as for :func:`~freefloat.planning.simulation.simulate`; without
        ``branch`` and ``joints`` the arm configuration closest to the joints of the search is
        chosen, where it has joints.

        Raises:
            InputError: As for that function.
            UnreachableError: If no arm configuration reaches the start of the path.

        Example:
            >>> ff.load_scenario("planar_2dof/line").simulate(heading=0.0).feasible
            True
        """
        from freefloat.planning.simulation import simulate

        problem, search = self.problem(), self.search()
        start = problem.attitude(attitude, heading=heading)
        with self.error_context(options=("attitude", "branch", "joints")):
            if joints is None and branch is None:
                joints = search.applied_to(problem).closest_start(start)
            return simulate(
                problem, start, branch=branch, joints=joints, others=True,
                stop_at_margin=stop_at_margin,
            )  # fmt: skip

    def map(self, samples: int | None = None, **options: Any) -> AttitudeMap | HeadingMap:
        """The minimum margins over all initial attitudes, as the command ``map``.

        Args:
            samples: Number of attitudes; by default the number of the search.
            **options: As for :func:`~freefloat.planning.space.map_sampling.attitude_map`.

        Raises:
            InputError: As for that function.

        Example:
            >>> round(ff.load_scenario("planar_2dof/line").map(24).feasible_fraction, 2)
            0.42
        """
        from freefloat.planning.space.map_sampling import attitude_map

        problem = self.problem()
        options = {"search": self.search(), "refine": True, **options}
        with self.error_context(options=("samples", *options)):
            return attitude_map(problem, samples, **options)
