"""Motions of the joints to a goal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from freefloat.concurrency import Progress, step_of
from freefloat.errors import InputError, require_type, seed_number
from freefloat.limits.check import LimitChecker
from freefloat.limits.limits import Limits
from freefloat.limits.result import LimitResult
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem, require_problem
from freefloat.planning.answer import Answer, PhaseResult
from freefloat.planning.goals.certification import Certification
from freefloat.planning.goals.clearances import Clearances
from freefloat.planning.goals.goal import FRAMES, Goal
from freefloat.planning.goals.joint_paths import Ends, JointPaths
from freefloat.planning.goals.kernel import Arm
from freefloat.planning.goals.relaxation import Relaxation
from freefloat.planning.goals.search import GoalSearch
from freefloat.planning.goals.target import Target
from freefloat.planning.goals.violations import StateLimits
from freefloat.so3 import Array, Pose, frozen

_FAMILIES = ((8, 1), (12, 1))
"""Spans and loops of paths of joints that need not turn the spacecraft."""
_TURNING = ((8, 1), (8, 2), (8, 4), (8, 8), (8, 16), (8, 32))
"""Those of paths that also turn it."""
_HALF_TURN = np.pi


@dataclass(frozen=True, eq=False)
class GoalMotion(Answer):
    """A motion of the joints to a goal, from joints at rest or moving.

    Attributes:
        problem: Robot, momentum and scene; its path is not followed, but has the timing.
        limits: Limits that were required, without ``base_turn`` where the attitude is a goal.
        feasible: Whether a motion was found that ends at the goal and keeps the limits.
        reason: Why this motion, or why none.
        needed: What would be enough, such as a ``duration`` [s].
        motion: The motion; None where none was found.
        limit_results: Limits along it.
    """

    kind: ClassVar[str] = "goal"

    problem: Problem = field(repr=False)
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

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        motion = self.motion
        return {
            "feasible": self.feasible,
            "reason": self.reason,
            "needed": dict(self.needed),
            "duration": self.duration,
            "initial": None if motion is None else motion.initial.to_dict(),
            "final": None if motion is None else motion.final.to_dict(),
            "limits": [result.to_dict() for result in self.limit_results],
        }


def move_from(
    problem: Problem,
    attitude: Array,
    joints: Array,
    goal: Goal,
    limits: Limits,
    *,
    rates: Array | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> GoalMotion:
    n = problem.model.dof
    begin = np.zeros(n) if rates is None else rates
    target, end = _resolved(problem, attitude, joints, goal)
    ends = Ends(joints, begin, end, None if target.body is not None else np.zeros(n))
    timed = goal.duration is None and limits.timed
    reference = goal.duration or problem.path.duration
    checker = LimitChecker(problem, limits)
    start = Rotation.from_quat(attitude).as_matrix()
    clearances = None
    shapes: list[Any] = [StateLimits(problem, limits, attitude)]
    if checker.pairs is not None:
        clearances = Clearances(problem, checker.pairs, limits.clearance or 0.0)
        clearances.at_rest(joints, start)
        shapes.append(clearances)
    by_time = problem.depends_on_timing or problem.scene.tumbles or bool(begin.any()) or target.body is not None
    rate = np.ones(n) if limits.joint_rate is None else limits.joint_rate
    rate = np.where(np.isfinite(rate), rate, rate[np.isfinite(rate)].max(initial=1.0))
    low, high = problem.model.joint_ranges
    others = joints if end is None else end
    low = np.where(np.isfinite(low), low, np.minimum(joints, others) - _HALF_TURN)
    high = np.where(np.isfinite(high), high, np.maximum(joints, others) + _HALF_TURN)
    momenta = np.array([problem.momentum, problem.wheel_momentum])
    families = [
        Relaxation(
            Arm.of(problem.model), JointPaths(ends, spans, loops), target, start, momenta, rate,
            limits.base_rate or np.inf, np.array([low, high]), shapes, timed, reference,
        )
        for spans, loops in (_FAMILIES if target.attitude is None else _TURNING)
    ]  # fmt: skip
    certification = Certification(problem, checker, attitude, by_time, clearances)
    search = GoalSearch(families, certification, step_of(progress, 0.0, 1.0))
    found = search.shortest(seed)
    if found is None:
        return GoalMotion(problem, limits, False, "no motion was found " + str([ (f.limit, f.where, f.worst) for f in search.failures]))
    reason = f"the goal is reached in {found.motion.times[-1]:.4g} s"
    return GoalMotion(found.motion.problem, limits, True, reason, {}, found.motion, found.results)


def _resolved(problem: Problem, attitude: Array, joints: Array, goal: Goal) -> tuple[Target, Array | None]:
    """The target of a goal, and the joints at its end."""
    wanted = None if goal.attitude is None else Rotation.from_quat(goal.attitude).as_matrix()
    pose, body = goal.pose, None
    if pose is not None and goal.frame not in FRAMES:
        body = next(body for body in problem.scene.bodies if body.name == goal.frame)
    elif pose is not None and goal.frame != "inertial":
        from freefloat.dynamics.summary import frames_at
        frames = frames_at(problem.model, attitude, joints)
        frames["end_effector"] = problem.model.end_effector_pose(attitude, joints)
        pose = frames[goal.frame] @ pose
    return Target(problem, wanted, pose, body), goal.joint_vector(problem.model)
