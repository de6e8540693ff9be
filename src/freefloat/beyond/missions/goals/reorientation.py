"""Turning the spacecraft by the arm alone: a goal with an attitude, and the joints back."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import numpy.typing as npt

from freefloat.beyond.missions.goals.goal import Goal
from freefloat.beyond.missions.goals.goal_motion import GoalMotion
from freefloat.beyond.missions.goals.resting import violation_at_rest
from freefloat.concurrency import Progress
from freefloat.errors import InputError
from freefloat.limits.check import LimitChecker
from freefloat.limits.limits import Limits, limits_for
from freefloat.motion.problem import Problem, require_problem
from freefloat.so3 import Array, angle_between

_SAME_ATTITUDE = 1e-9
"""Angle between attitudes that are the same [rad]."""


def reorient(
    problem: Problem,
    start: npt.ArrayLike,
    goal: npt.ArrayLike,
    limits: Limits | None = None,
    *,
    joints: Mapping[str, float] | npt.ArrayLike | None = None,
    duration: float | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> GoalMotion:
    """Find a motion of the arm that turns the spacecraft from one attitude to another.

    The short form of :func:`freefloat.move` to a goal with an attitude and the joints back.

    Args:
        problem: Robot, momentum and scene; its path is not followed.
        start: Attitude at the start, quaternion x, y, z, w.
        goal: Attitude at the end.
        limits: Limits in addition to the joint ranges, by default those of the problem;
            ``base_turn`` is not considered.
        joints: Where the arm begins and ends, by name or shape (n,); by default the problem's
            ``start_joints``, without these the first arm branch from which the path can begin at
            the goal and that keeps the limits, or the middles of the joint ranges.
        duration: Duration [s]; by default the shortest one found that limits permit, and that of
            the path where none depends on the speed.
        seed: Seed of the random paths.
        progress: Called with the fraction done, in [0, 1].

    Raises:
        InputError: If an argument is not of this kind, the attitudes are the same, or the arm
            violates a limit at the joints.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> result = ff.reorient(problem, [0, 0, 0, 1], problem.attitude(heading=0.5))
        >>> result.feasible, result.error < 1e-9
        (True, True)
    """
    from freefloat.beyond.missions.goals.mover import move_from  # compiled kernels
    from freefloat.beyond.missions.goals.query import GoalStart, Query

    require_problem(problem)
    problem.model.require_one_arm("reorientations")
    limits = (limits_for(problem, limits) or Limits()).without_turn
    begin, end = problem.attitude(start, key="from"), problem.attitude(goal, key="to")
    if angle_between(begin, end) < _SAME_ATTITUDE:
        raise InputError("to", "it is the attitude at the start", "another attitude")
    if duration is None and not limits.timed:
        duration = problem.path.duration
    rest = _rest(problem, limits, end, joints)
    wanted = Goal(attitude=end, joints=rest, duration=duration)
    state = GoalStart(begin, rest, np.zeros_like(rest))
    return move_from(Query(problem, state, wanted, limits), seed=seed, progress=progress)


def _rest(
    problem: Problem,
    limits: Limits,
    goal: Array,
    joints: Mapping[str, float] | npt.ArrayLike | None,
) -> Array:
    """The first joints at which the arm keeps its limits at the goal, shape (n,)."""
    checker = LimitChecker(problem, limits)
    violations = []
    for candidate in _candidates(problem, goal, joints):
        violation = violation_at_rest(problem, checker, goal, candidate)
        if violation is None:
            return candidate
        violations.append(violation)
    raise InputError(
        "joints", violations[-1].violation("at the goal"), "joints that keep the limits"
    )


def _candidates(
    problem: Problem, goal: Array, joints: Mapping[str, float] | npt.ArrayLike | None
) -> Iterator[Array]:
    """Joints that were given, or arm branches at the start of the path and the middle of ranges."""
    given = problem.start_joints if joints is None else joints
    if given is not None:
        yield problem.model.joint_vector(given, "joints")
        return
    yield from (branch.joints for branch in problem.branches(goal))
    ends = np.array(problem.model.joint_ranges)
    yield np.where(np.isfinite(ends).all(axis=0), ends, 0.0).mean(axis=0)
