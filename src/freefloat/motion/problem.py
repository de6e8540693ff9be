"""Problems: a robot, a path and the momentum, checked against each other."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.redundancy import Redundancy
from freefloat.dynamics.resolved_rates import ResolvedRateSolver
from freefloat.dynamics.system import System
from freefloat.dynamics.tasks import Task, require_task
from freefloat.errors import InputError, require_type
from freefloat.motion.branches_on_path import BranchesOnPath
from freefloat.motion.joint_curves import ArmCurve, ArmCurves
from freefloat.motion.margin import Margin
from freefloat.motion.pointing import AttitudeLimits
from freefloat.motion.problem_inputs import (
    margin_of,
    model_of,
    path_of,
    require_few_revolutions,
    require_planar,
    task_of,
)
from freefloat.paths.curves import Curve
from freefloat.paths.orientation import FreeOrientation
from freefloat.paths.path import EndEffectorPath
from freefloat.paths.timed_path import TimedPath, path_key
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.source import RobotSource
from freefloat.scene.scene import Scene
from freefloat.so3 import Array, IntArray, frozen, zeros

Prescribed = tuple[Array, Any, Array | None]
"""Twist of the end-effector, path speed ds/dt, joint rates of further arms that move."""
Prescription = Callable[[float], tuple[Any, ...]]
"""By time: twist, path speed, and joint values and rates of further arms that move."""
_APART = 1e-6
"""Smallest distance of breaks, as a fraction of the duration."""


@dataclass(frozen=True, eq=False, init=False)
class Problem(BranchesOnPath):
    """A robot, a path for its end-effector, and the angular momentum of the system.

    Attributes:
        model: Robot; also a URDF, as :meth:`.FreeFloatingModel.from_urdf` reads it, followed by the
            end-effector.
        path: Pose of the end-effector by time; a :class:`~freefloat.paths.timed_path.PathStack`
            where further arms follow paths of their own; also a path or curve with ``duration``
            [s], followed from rest to rest.
        task: Prescribed components of the end-effector twist, or its value, such as ``"pose"``; by
            default as many as the arm can follow.
        momentum: Angular momentum about the centre of mass, inertial axes [N m s], shape (3,).
        margin: Required distance from dynamic singularities; also a measure and its value, such as
            ``("gjm", 0.05)``; by default none, of det S*.
        redundancy: Null-space motion of a redundant arm; by default the joint rates have the
            smallest Euclidean norm.
        start_joints: Joint values, shape (n,); only the arm configuration at the start of the path
            that is closest to them is considered; all configurations when left out.
        scene: Bodies beside the robot, and the corridor of the end-effector.
        wheel_momentum: Part of the momentum that wheels store, constant in the spacecraft frame
            [N m s], shape (3,): the wheels turn with constant rates relative to the spacecraft, and
            their masses and inertias belong to it.
        arms: Joint curves of further arms that move along these, by name.
        limits: :class:`~freefloat.limits.limits.Limits` that functions keep or check unless others
            are given; None for none, not even joint ranges. The problem of a scenario has its own.

    Example:
        >>> line = ff.paths.PolynomialCurve.line([0.9, 0.2, 0.0], [0.6, 0.7, 0.0])
        >>> problem = ff.Problem(
        ...     "planar_2dof", "end_effector", path=line, duration=20.0, margin=("gjm", 0.05)
        ... )
        >>> str(problem.task), problem.redundant
        ('planar-position', False)
    """

    model: FreeFloatingModel = field(repr=False)
    path: TimedPath = field(repr=False)
    task: Task
    momentum: Array
    margin: Margin
    redundancy: Redundancy | None
    start_joints: Array | None
    scene: Scene = field(repr=False)
    wheel_momentum: Array = field(repr=False)
    arms: ArmCurves = field(repr=False)
    limits: AttitudeLimits | None = field(repr=False)
    drift: Array = field(init=False, repr=False)

    def __init__(
        self,
        model: FreeFloatingModel | RobotSource | str | Path,
        end_effector: str | TimedPath | EndEffectorPath | Curve | None = None,
        task: Task | str | None = None,
        momentum: npt.ArrayLike | None = None,
        margin: Margin | tuple[str, float] | None = None,
        redundancy: Redundancy | None = None,
        start_joints: Mapping[str, float] | npt.ArrayLike | None = None,
        scene: Scene | None = None,
        wheel_momentum: npt.ArrayLike | None = None,
        arms: ArmCurves | Mapping[str, ArmCurve] | None = None,
        limits: AttitudeLimits | None = None,
        *,
        path: TimedPath | EndEffectorPath | Curve | None = None,
        duration: float | None = None,
    ) -> None:
        """Build what is given as a plain value; ``path`` may be given in place of the end-effector.

        Raises:
            InputError: If a value is missing, or parts do not suit one another.
        """
        if end_effector is not None and not isinstance(end_effector, str):
            if path is not None:
                raise InputError("path", "it was given twice", "one path")
            path, end_effector = end_effector, None
        robot = model_of(model, end_effector)
        timed = path_of(path, duration)
        task = task_of(robot, timed) if task is None else require_task(robot, task)
        values = {
            "model": robot, "path": timed, "task": task,
            "momentum": zeros() if momentum is None else momentum,
            "margin": margin_of(robot, task, margin),
            "redundancy": redundancy, "start_joints": start_joints,
            "scene": Scene() if scene is None else scene,
            "wheel_momentum": zeros() if wheel_momentum is None else wheel_momentum,
            "arms": arms if isinstance(arms, ArmCurves) else ArmCurves(arms or {}),
            "limits": limits, "drift": timed.drift,
        }  # fmt: skip
        for name, value in values.items():
            object.__setattr__(self, name, value)
        self._require_parts()

    def _require_parts(self) -> None:
        """Raise an InputError unless all parts suit one another; keep arrays as checked."""
        if not self.path.moves:
            raise InputError("path", "its length is zero", "a path that moves or rotates")
        self._require_setting()
        self.arms.require_applicable(self.model, self.path.duration)
        self._require_paths()
        if self.start_joints is not None:
            joints = frozen(self.model.joint_vector(self.start_joints, "start_joints"))
            object.__setattr__(self, "start_joints", frozen(self.solved_joints(joints)))
        if self.redundancy is not None:
            accepted = "Redundancy, such as Redundancy(metric='energy')"
            require_type("redundancy", self.redundancy, Redundancy, accepted)
            self.redundancy.require_applicable(self.model, self.task)
        self.scene.require_applicable(self.model, self.path.duration)
        if self.task.planar:
            require_planar(self.plane, self.system, self.path, self.task)
        require_few_revolutions(self.system, self.path.duration)

    def _require_paths(self) -> None:
        """Raise an InputError unless there is a path for each arm, as the task needs it."""
        names, arms = [*self.path.by_arm][1:], [*self.model.path_arms]
        if names != arms:
            problem = f"paths of {', '.join(names) or 'no further arm'} were given"
            accepted = f"paths of {', '.join(arms) or 'no further arm'}: PathStack.of(...)"
            raise InputError("robot.arms", problem, accepted)
        for arm, path in self.path.by_arm.items():
            free = isinstance(path.path.orientation, FreeOrientation)
            if free and self.task.prescribes_orientation:
                problem = f"it is missing, task {self.task} needs it"
                accepted = "EndEffectorPath(curve, FixedOrientation(axes)), or another law"
                raise InputError(f"{path_key(arm)}.attitude", problem, accepted)

    @property
    def depends_on_timing(self) -> bool:
        """Whether the motion is another one at another speed.

        With momentum or drift the system moves while the end-effector rests; a path in the frame of
        a tumbling body is another one.
        """
        return self.system.rotates or self.path.depends_on_time

    def stretched(self, factor: float) -> Problem:
        """The same problem, all times of its path and its joint curves multiplied by a factor."""
        return replace(self, path=self.path.stretched(factor), arms=self.arms.stretched(factor))

    def with_system(self, system: System) -> Problem:
        """The same problem for another system, whose drift its path has, checked again."""
        momenta = {"momentum": system.momentum, "wheel_momentum": system.wheels}
        path = self.path.with_drift(system.drift)
        return self.replace(model=system.model, path=path, **momenta)

    def at_rest(self, t: float) -> Problem:
        """The same problem, the robot being at all times as it is at a time [s]."""
        if not self.robot_varies:
            return self
        chain, limits = self.model_at(t), self.limits
        limits = limits and limits.of_joints(chain.dof)
        return self.replace(model=chain, arms=ArmCurves(), limits=limits)

    @cached_property
    def breaks(self) -> Array:
        """Times [s], rising, at which high derivatives of the path or of joint curves jump."""
        if not self.robot_varies:
            return self.path.breaks
        both, apart = np.union1d(self.path.breaks, self.arms.breaks), _APART * self.path.duration
        both = both[(both > apart) & (both < self.path.duration - apart)]
        return frozen(both[np.diff(both, prepend=0.0) > apart])

    def prescribed(self, t: float | Array, segment: int | IntArray | None = None) -> Prescribed:
        """What the rates at times [s] have to be, with the segments of :meth:`.Timing.s`."""
        twist, speed = self.path.twist_and_speed(t, segment)
        return twist, speed, self.arms.at(t, 1) if self.robot_varies else None

    def prescribed_between(self, start: float, end: float) -> Prescription:
        """What is prescribed between times [s] without a break in between, and a little beyond."""
        twist_and_speed = self.path.prescribed_between(start, end)
        if not self.robot_varies:
            return twist_and_speed
        further = self.arms.prescribed_between(start, end)
        return lambda t: (*twist_and_speed(t), *further(t))

    def resolved_rate_solver(self) -> ResolvedRateSolver:
        """Solver of equation (4) for this problem."""
        return ResolvedRateSolver(self.system, self.task, self.redundancy)


def require_problem(value: object) -> None:
    """Raise an InputError unless the value is a problem."""
    accepted = "a Problem: problem() of a Scenario, such as load_scenario(...).problem()"
    require_type("problem", value, Problem, accepted)
