"""Motions of the joints to goals: what was found, or why nothing was."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from freefloat.beyond.missions.goals.goal import Goal
from freefloat.beyond.missions.goals.target import EndState
from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.plane import plane_of
from freefloat.dynamics.summary import natural_task
from freefloat.dynamics.system import System
from freefloat.limits.check import Contact
from freefloat.limits.limits import Limits
from freefloat.limits.result import LimitResult, all_violations, violated
from freefloat.motion.margin import Margin
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.paths.curves import PolynomialCurve
from freefloat.paths.orientation import FixedOrientation
from freefloat.paths.path import EndEffectorPath
from freefloat.paths.time_laws import TimeLaw
from freefloat.paths.timed_path import TimedPath
from freefloat.paths.timing import Timing
from freefloat.planning.answer import Answer, PhaseResult
from freefloat.rotations import Rotation
from freefloat.scene.scene import Scene
from freefloat.so3 import UPRIGHT, Array

_UNKNOWN = 60.0
"""Duration with which a search begins where none is given [s]."""


@dataclass(frozen=True, eq=False)
class GoalMotion(Answer):
    """A motion of the joints to a goal.

    Attributes:
        problem: Robot, momentum and scene; its path is not followed, but has the duration.
        goal: What is to be reached.
        limits: Limits that were required; without ``base_turn`` where the motion is a phase of a
            manoeuvre or a reorientation.
        feasible: Whether a motion was found that ends at the goal and keeps the limits.
        reason: Why this motion, or why none.
        needed: What would be enough, where it is known: a ``duration`` [s].
        motion: The motion; None where none was found. It may violate a limit.
        limit_results: Limits along it.
    """

    kind: ClassVar[str] = "goal"

    problem: Problem = field(repr=False)
    goal: Goal
    limits: Limits = field(repr=False)
    feasible: bool
    reason: str
    needed: dict[str, float] = field(default_factory=dict)
    motion: Motion | None = field(default=None, repr=False)
    limit_results: tuple[LimitResult, ...] = field(default=(), repr=False)

    @property
    def phases(self) -> tuple[PhaseResult, ...]:
        """The motion as the only phase."""
        return (PhaseResult("goal", "goal", self),)

    @property
    def duration(self) -> float | None:
        """[s]; None without a motion."""
        return None if self.motion is None else float(self.motion.times[-1])

    @property
    def error(self) -> float | None:
        """Largest error of the last state [m, rad, m/s, rad/s]; None without a motion."""
        if self.motion is None:
            return None
        first, end = self.motion.initial, last_state(self.motion)
        target = self.goal.target(self.motion.problem, first.attitude, first.joints)
        errors = [target.residuals(end)]
        if self.goal.joints is not None:
            rates = 0.0 if self.goal.joint_rates is None else self.goal.joint_rates
            errors += [end.joints - self.goal.joints, end.joint_rates - rates]
        return float(np.abs(np.concatenate(errors)).max())

    @cached_property
    def contact(self) -> Contact | None:
        """The deepest contact of bodies along the motion; None without contact."""
        return self.deepest_contact()

    def with_motion(self, motion: Motion, results: Sequence[LimitResult]) -> GoalMotion:
        """The same with a motion that ends at the goal, feasible where it keeps its limits."""
        violations = violated(results)
        reason = f"the goal is reached in {float(motion.times[-1]):.4g} s"
        if violations:
            reason = f"along the best motion that was found {all_violations(violations)}"
        return replace(
            self, problem=motion.problem, feasible=not violations, reason=reason, motion=motion,
            limit_results=tuple(results),
        )  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        motion = self.motion
        return {
            "feasible": self.feasible,
            "reason": self.reason,
            "needed": dict(self.needed),
            "goal": self.goal.to_dict(),
            "duration": self.duration,
            "error": self.error,
            "contact": self.contact and self.contact.to_dict(),
            "initial": None if motion is None else motion.initial.to_dict(),
            "final": None if motion is None else motion.final.to_dict(),
            "limits": [result.to_dict() for result in self.limit_results],
        }


def last_state(motion: Motion) -> EndState:
    """The last state of a motion, with its joint rates."""
    final = motion.final
    rates = motion.law.rates(final.time, final.attitude, final.joints).joints
    attitude = Rotation.from_quat(final.attitude).as_matrix()
    return EndState(final.time, attitude, final.joints, rates)


def earlier(problem: Problem, duration: float) -> Problem:
    """The problem a duration [s] earlier, seen from the centre of mass at that time."""
    way, limits = duration * problem.path.drift, problem.limits
    limits = limits and limits.seen_from(-way)
    return replace(problem, scene=problem.scene.later(-duration, way), limits=limits)


def goal_problem(
    system: System, attitude: Array, joints: Array, goal: Goal, scene: Scene
) -> Problem:
    """The problem of a motion to a goal; problems need a path, which is not followed.

    Args:
        system: Robot, momentum, wheels and drift.
        attitude: Of the spacecraft at the start, unit quaternion x, y, z, w.
        joints: At the start, shape (n,).
        goal: What is to be reached.
        scene: From the centre of mass at the start.

    Raises:
        InputError: If robot, momentum or attitude allow no task of a path, or the scene does not
            suit the robot.
    """
    system.model.require_one_arm("motions to a goal")
    task = natural_task(system.model)
    pose = system.model.end_effector_pose(UPRIGHT, joints)
    plane = plane_of(system.model)
    direction = np.array([1.0, 0.0, 0.0]) if plane is None else plane.axes[:, 0]
    curve = PolynomialCurve.line(pose.position, pose.position + direction)
    path = EndEffectorPath(curve, FixedOrientation(pose.rotation))
    timing = Timing(goal.duration or _UNKNOWN, TimeLaw.UNIFORM)
    margin = Margin(singularity_measure(system.model, task, "gjm"), 0.0)
    problem = Problem(
        system.model, TimedPath(path, timing, system.drift), task, system.momentum, margin,
        scene=scene, wheel_momentum=system.wheels,
    )  # fmt: skip
    problem.attitude(attitude, key="state.attitude")
    return problem
