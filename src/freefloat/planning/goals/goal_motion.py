"""Motions of the joints to goals: what was found, or why nothing was."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.momentum import Task
from freefloat.dynamics.system import System
from freefloat.limits.contact import Contact
from freefloat.limits.limits import Limits
from freefloat.limits.result import LimitResult, violated
from freefloat.motion.margin import Margin
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.paths.curves import PolynomialCurve
from freefloat.paths.orientation import FixedOrientation
from freefloat.paths.path import EndEffectorPath
from freefloat.paths.time_laws import TimeLaw
from freefloat.paths.timing import TimedPath, Timing
from freefloat.planning.answer import Answer, PhaseResult
from freefloat.planning.goals.goal import Goal
from freefloat.planning.goals.target import EndState
from freefloat.scene.scene import Scene
from freefloat.so3 import Array

_UNKNOWN = 60.0
"""Duration of the path of a problem that has none, which is not followed [s]."""


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
        first, end = self.motion.initial, self.goal.joints
        target = self.goal.target(self.motion.problem, first.attitude, first.joints)
        residuals = np.abs(target.residuals(last_state(self.motion))).max(initial=0.0)
        final = self.motion.final.joints
        return float(max(residuals, 0.0 if end is None else np.abs(final - end).max()))

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


def all_violations(violations: Sequence[LimitResult]) -> str:
    """Such as ``the joint rate of q1 is violated at t = 2 s, at most ... and the ...``."""
    return " and ".join(entry.violation(f"at t = {entry.time:.4g} s") for entry in violations)


def last_state(motion: Motion) -> EndState:
    """The last state of a motion, with its joint rates."""
    final = motion.final
    rates = motion.law.rates(final.time, final.attitude, final.joints).joints
    attitude = Rotation.from_quat(final.attitude).as_matrix()
    return EndState(final.time, attitude, final.joints, rates)


def earlier(problem: Problem, duration: float) -> Problem:
    """The problem a duration [s] earlier, with the scene from the centre of mass at that time."""
    scene = problem.scene.later(-duration, duration * problem.path.drift)
    return replace(problem, scene=scene)


def goal_problem(
    system: System, attitude: Array, joints: Array, goal: Goal, scene: Scene
) -> Problem:
    """A problem whose path, from the end-effector toward the axis of z, is not followed."""
    model = system.model
    model.require_one_arm("motions to a goal")
    axes = np.array([body.axis for body in model.bodies[1:]])
    planar = model.dof <= 3 and bool(np.abs(axes[:, :2]).max() == 0.0)
    task = Task.PLANAR_POSITION if planar else Task.POSE if model.dof >= 6 else Task.POSITION
    task = task if len(task.rows) <= model.dof or planar else Task.PLANAR_POSITION
    pose = model.end_effector_pose(attitude, joints)
    curve = PolynomialCurve.line(pose.position, [0.0, 0.0, pose.position[2]])
    path = EndEffectorPath(curve, FixedOrientation(pose.rotation))
    timing = Timing(goal.duration or _UNKNOWN, TimeLaw.UNIFORM)
    margin = Margin(singularity_measure(model, task, "gjm"), 0.0)
    return Problem(
        model, TimedPath(path, timing, system.drift), task, system.momentum, margin, scene=scene,
        wheel_momentum=system.wheels,
    )  # fmt: skip
