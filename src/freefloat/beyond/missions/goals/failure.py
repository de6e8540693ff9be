"""Why no motion to a goal was found, and what would be enough."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from freefloat.beyond.missions.goals.goal_motion import GoalMotion, earlier, required_limits
from freefloat.beyond.missions.goals.joint_paths import JointCourse
from freefloat.beyond.missions.goals.query import violation_at_rest
from freefloat.beyond.missions.goals.search import REACHED, GoalSearch
from freefloat.limits.check import LimitChecker
from freefloat.limits.result import LimitResult, all_violations
from freefloat.rotations import Rotation


def why_not(
    outcome: GoalMotion, search: GoalSearch, seed: int, longer: GoalMotion | None, goal_words: str
) -> GoalMotion:
    """The outcome of a search that found no motion, with the reason.

    Args:
        outcome: The outcome.
        search: The search.
        seed: Seed of random paths.
        longer: What was found without the duration that was asked for.
        goal_words: What the goal is called.
    """
    if longer is not None and longer.duration is not None and longer.feasible:
        least = longer.duration
        reason = f"no motion in {outcome.goal.duration:g} s was found, but one in {least:.4g} s"
        return replace(outcome, reason=reason, needed={"duration": least})
    nearest = search.nearest()
    if nearest is None:
        return _at_the_goal(outcome, search, seed, goal_words)
    results = search.certification.checker.results(nearest.motion)
    return outcome.with_motion(nearest.motion, results)


def _at_the_goal(outcome: GoalMotion, search: GoalSearch, seed: int, goal_words: str) -> GoalMotion:
    """Why no path was found that ends at the goal: what it violates there, or how far it gets."""
    target = search.families[0].target
    nearest, *others = search.nearest_ends(seed)
    if np.abs(nearest.error).max(initial=0.0) > REACHED:
        reason = f"no motion with {goal_words} was found within the joint ranges"
        away = target.distance_text(nearest.error)
        return replace(outcome, reason=f"{reason}; the nearest one is {away} away")
    ends = [nearest, *(path for path in others if np.abs(path.error).max(initial=0.0) <= REACHED)]
    violations = [_violation(outcome, path.course) for path in ends]
    least = min(filter(None, violations), key=lambda found: abs(found.worst - found.allowed),
                default=None)  # fmt: skip
    if least is not None and None not in violations:
        reason = f"at {goal_words} of the nearest motion {least.violation()}"
        return replace(outcome, reason=reason)
    beyond = search.least_violations(ends)
    reason = f"{goal_words} is reached by coarse paths, but exactly by no motion that was found"
    if beyond:
        reason = f"{goal_words} is reached, but along the best path {all_violations(beyond)}"
    return replace(outcome, reason=reason)


def _violation(outcome: GoalMotion, course: JointCourse) -> LimitResult | None:
    """The limit that the state at the end of a path violates; None where it keeps all."""
    there = earlier(outcome.setting, -float(course.duration))
    attitude = Rotation.from_matrix(course.attitudes[-1]).as_quat()
    checker = LimitChecker(there, required_limits(there))
    return violation_at_rest(there, checker, attitude, course.joints[-1])
