"""Turning the spacecraft by closed motions of the arm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, cast

import numpy as np
import numpy.typing as npt

from freefloat.concurrency import Progress
from freefloat.errors import InputError, finite_number, seed_number, whole_number
from freefloat.limits.limits import Limits
from freefloat.limits.result import LimitResult
from freefloat.motion.joint_loops import JointLoops
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem, require_problem
from freefloat.planning.answer import Answer, PhaseResult
from freefloat.planning.joints.loop_count import MOST_LOOPS, LoopCountSearch
from freefloat.planning.joints.loop_motion import LoopMotions
from freefloat.records import Joints, Quaternions
from freefloat.so3 import Array, angle_between, frozen

_SAME = 1e-9
"""Angle between attitudes that are the same [rad]."""
_OUTSIDE = 1e-9
"""Component of a rotation about axes about which loops do not turn the spacecraft [rad]."""

_FARTHEST = 1e3
"""Largest joint value [rad, m]; differences of larger ones have too few digits."""


@dataclass(frozen=True, eq=False)
class Reorientation(Answer):
    """A motion of the arm that turns the spacecraft and ends where it began.

    Attributes:
        problem: Robot and momentum; its path is not followed, but has the timing of the motion.
        start: Attitude at the start, unit quaternion x, y, z, w.
        goal: Attitude at the end.
        joints: Where the arm begins and ends, shape (n,).
        limits: Limits that were required, without ``base_turn``.
        allowed: Duration that was allowed [s]; None without one.
        reached: Whether a motion was found that ends at the goal and keeps the limits.
        reason: Why this motion, or why none.
        needed: What would be enough: a ``duration`` [s], a number of ``loops``, or ``range_factor``
            on the widths of the joint ranges; empty if it was reached, or nothing is known.
        motion: The motion along loops of the joints; None where none was found.
        limit_results: Limits along the motion.
    """

    kind: ClassVar[str] = "reorientation"

    problem: Problem = field(repr=False)
    start: Quaternions
    goal: Quaternions
    joints: Joints
    limits: Limits = field(repr=False)
    allowed: float | None
    reached: bool
    reason: str
    needed: dict[str, float] = field(default_factory=dict)
    motion: Motion | None = field(default=None, repr=False)
    limit_results: tuple[LimitResult, ...] = field(default=(), repr=False)

    def __post_init__(self) -> None:
        for name in ("start", "goal", "joints"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        object.__setattr__(self, "limits", self.limits.without_turn)

    @property
    def feasible(self) -> bool:
        """The same as ``reached``."""
        return self.reached

    @property
    def loops(self) -> JointLoops | None:
        """The loops of the joints; None where none were found."""
        return None if self.motion is None else cast(JointLoops, self.motion.curve)

    @property
    def phases(self) -> tuple[PhaseResult, ...]:
        """The reorientation as the only phase."""
        return (PhaseResult("reorientation", "reorientation", self),)

    @property
    def duration(self) -> float | None:
        """Duration of the motion [s]; None without one."""
        return None if self.motion is None else float(self.motion.times[-1])

    @property
    def error(self) -> float | None:
        """Angle between the attitude at the end and the goal [rad]; None without a motion."""
        motion = self.motion
        return None if motion is None else float(angle_between(motion.final.attitude, self.goal))

    @property
    def joint_travel(self) -> Array | None:
        """Path length of each joint [rad or m], shape (n,); None without a motion."""
        if self.motion is None:
            return None
        return frozen(np.abs(np.diff(self.motion.joints, axis=0)).sum(axis=0))

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of ``freefloat reorient``."""
        travel, motion = self.joint_travel, self.motion
        return {
            "reached": self.reached,
            "reason": self.reason,
            "needed": dict(self.needed),
            "from": self.start.tolist(),
            "to": self.goal.tolist(),
            "turn_deg": float(np.degrees(angle_between(self.start, self.goal))),
            "joints": self.joints.tolist(),
            "allowed_duration": self.allowed,
            "duration": self.duration,
            "loops": None if self.loops is None else self.loops.to_dict(),
            "joint_travel": None if travel is None else travel.tolist(),
            "error": self.error,
            "final": None if motion is None else motion.final.to_dict(),
            "limits": [result.to_dict() for result in self.limit_results],
        }


def reorient(
    problem: Problem,
    start: npt.ArrayLike,
    goal: npt.ArrayLike,
    limits: Limits | None = None,
    *,
    joints: Mapping[str, float] | npt.ArrayLike | None = None,
    duration: float | None = None,
    loops: int | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Reorientation:
    """Find a motion of the arm that turns the spacecraft from one attitude to another.

    The joints travel a closed loop as few times as the joint ranges and the other limits permit,
    and end where they began. A dynamic singularity on the way is no obstacle, as joints are
    prescribed. Limits of rates and torques determine the duration; without any of them it is that
    of the problem's path. The scene and
    ``limits.base_turn`` are not considered. That no
    motion is found does not prove that there is none.

    Args:
        problem: Robot, momentum and time law; its path is not followed.
        start: Attitude at the start, quaternion x, y, z, w.
        goal: Attitude at the end.
        limits: Limits in addition to the joint ranges.
        joints: Where the arm begins and ends, by name or shape (n,); by default the problem's
            ``start_joints``, without these the first arm branch from which the path can begin at
            the goal and that keeps the limits, or the middles of the joint ranges.
        duration: Longest duration [s].
        loops: Number of loops, by default the fewest.
        seed: Seed of the random loops that are tried first.
        progress: Called with the fraction done, in [0, 1].

    Raises:
        InputError: If an argument is not of this kind, the attitudes are the same, or the arm
            violates a limit at the joints.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> result = ff.reorient(problem, [0, 0, 0, 1], problem.attitude(heading=0.5))
        >>> result.reached, result.loops.count
        (True, 1)
    """
    require_problem(problem)
    limits = Limits() if limits is None else limits.without_turn
    start, goal = problem.attitude(start, key="from"), problem.attitude(goal, key="to")
    if angle_between(start, goal) < _SAME:
        raise InputError("to", "it is the attitude at the start", "another attitude")
    if duration is not None:
        accepted = "a positive number of seconds"
        duration = finite_number("duration", duration, accepted, np.finfo(float).tiny)
    if loops is not None:
        whole_number("loops", loops, 1, MOST_LOOPS)
    seed = seed_number("seed", seed)
    motions = _motions(problem, limits, start, goal, joints)
    rest = motions.search.joints
    outcome = Reorientation(problem, start, goal, rest, limits, duration, False, "")
    if np.linalg.norm(motions.unreachable) > _OUTSIDE:
        return replace(outcome, reason="closed loops of the joints do not turn it about this axis")
    least = motions.least_duration
    if duration is not None and duration < least * (1.0 - _SAME):
        why = "with these limits of rates" if motions.timed else "as the path of the problem"
        reason = f"it takes at least {least:.4g} s, {why}, but {duration:g} s are allowed"
        return replace(outcome, reason=reason, needed={} if motions.timed else {"duration": least})
    search = LoopCountSearch(motions, seed, progress)
    found = search.fewest(duration) if loops is None else search.exactly(loops)
    if found is None:
        return replace(outcome, reason=_failure(search, loops), needed=search.needed(loops))
    kept = duration is None or found.duration <= duration * (1.0 + _SAME)
    count = found.loops.count
    reason = f"{count} loop{'s' if count > 1 else ''}, {found.duration:.4g} s"
    if not kept:
        reason += f", but {duration:g} s are allowed"
    return replace(
        outcome, problem=found.motion.problem, reached=kept, reason=reason, motion=found.motion,
        limit_results=found.results,
        needed={} if kept else {"duration": found.duration},
    )  # fmt: skip


def _failure(search: LoopCountSearch, count: int | None) -> str:
    """Why no motion was found."""
    number = f"up to {MOST_LOOPS}" if count is None else str(count)
    if search.violation is None:
        return f"no {number} loops within the joint ranges with this rotation were found"
    limit, where = search.violation.limit, search.violation.where
    return f"all motions of {number} loops that were found violate {limit} of {where}"


def _motions(
    problem: Problem,
    limits: Limits,
    start: Array,
    goal: Array,
    joints: Mapping[str, float] | npt.ArrayLike | None,
) -> LoopMotions:
    """Motions from the first joints at which the arm keeps its limits."""
    model = problem.model
    if joints is not None or problem.start_joints is not None:
        chosen = problem.start_joints if joints is None else joints
        candidates = [model.joint_vector(chosen)]  # type: ignore[arg-type]
        largest = float(np.abs(candidates[0]).max())
        finite_number("joints", largest, f"values of at most {_FARTHEST:g}", 0.0, _FARTHEST)
    else:
        lower, upper = model.joint_ranges
        bounded = np.isfinite(lower) & np.isfinite(upper)
        ends = np.where(bounded, [lower, upper], 0.0)
        candidates = [branch.joints for branch in problem.branches(goal)] + [ends.mean(axis=0)]
    violations = []
    for candidate in candidates:
        motions = LoopMotions(problem, limits, candidate, start, goal)
        violation = motions.shape_violation(motions.search.rest)
        if violation is None:
            return motions
        violations.append(violation)
    last = violations[-1]
    raise InputError("joints", f"{last.limit} of {last.where} is {last.worst:.4g} at these joints",
                     f"joints that keep the limit {last.allowed:.4g}")  # fmt: skip
