"""Finding a motion of the joints to a goal from the state of a system, or why there is none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from freefloat.beyond.missions.goals.attitude_kernel import JointCourse
from freefloat.beyond.missions.goals.certification import Certification
from freefloat.beyond.missions.goals.clearances import Clearances
from freefloat.beyond.missions.goals.goal import Goal
from freefloat.beyond.missions.goals.goal_motion import (
    GoalMotion,
    earlier,
    goal_setting,
    required_limits,
)
from freefloat.beyond.missions.goals.joint_integration import integrate_spline
from freefloat.beyond.missions.goals.query import GoalStart, Query, families_of, violation_at_rest
from freefloat.beyond.missions.goals.search import REACHED, GoalSearch
from freefloat.beyond.missions.goals.violations import ShapeLimits, StateLimits
from freefloat.concurrency import Progress, step_of
from freefloat.dynamics.system import System
from freefloat.errors import InputError, require_type, seed_number
from freefloat.limits.limit import OFF
from freefloat.limits.limits import LimitChecker, Limits, limits_for
from freefloat.limits.result import LimitResult, all_violations
from freefloat.motion.joint_curves import JointSpline
from freefloat.motion.law import JointLaw
from freefloat.motion.motion import Motion
from freefloat.motion.setting import JointSetting
from freefloat.rotations import Rotation
from freefloat.scene.scene import Scene
from freefloat.scene.tumbling import Tumbling
from freefloat.so3 import Array, unit_quaternion

_FIRST = 0.5
"""Part of the progress that the search in a given duration is."""


def move(
    system: System,
    state: tuple[npt.ArrayLike, npt.ArrayLike],
    goal: Goal,
    limits: Limits | None = None,
    scene: Scene | None = None,
    *,
    seed: int = 0,
    progress: Progress | None = None,
) -> GoalMotion:
    """Find a motion of the joints from a state at rest to a goal.

    Joint splines are found by optimization from random paths and from straight ways to arm branches
    at the goal. They keep joint ranges and limits, and are as short as limits of rates and torques
    permit near where the search ends: that no motion is found does not prove that there is none. A
    dynamic singularity on the way is no obstacle, as joints are prescribed.

    Args:
        system: Robot, momentum, wheels and drift.
        state: Attitude of the spacecraft, quaternion x, y, z, w, and joint values (n,).
        goal: What is to be reached.
        limits: Limits in addition to the joint ranges.
        scene: Bodies and corridor, from the centre of mass at the start.
        seed: Seed of the random paths.
        progress: Called with the fraction done, in [0, 1].

    Raises:
        InputError: If an argument is of another kind, or nothing determines the duration.

    Example:
        >>> system = ff.System(ff.FreeFloatingModel.from_urdf("planar_2dof"))
        >>> limits = ff.Limits(joint_rate=[0.1, 0.1])
        >>> state = [0.0, 0.0, 0.0, 1.0], [0.3, 0.7]
        >>> result = ff.move(system, state, ff.Goal(joints=[0.6, 0.2]), limits)
        >>> result.feasible, round(result.duration, 1)
        (True, 5.5)
    """
    query = posed(system, state, goal, limits, scene)
    return move_from(query, seed=seed, progress=progress)


def sketch(query: Query, seed: int) -> Motion | None:
    """A motion to a goal that is found at once: clearance, pointing and turn are left out.

    None where no motion was found; raises as :func:`move`.
    """
    rates = replace(query.limits.without_turn, clearance=OFF, pointing=())
    query = replace(query, setting=query.setting.replace(limits=rates))
    query.require_sense()
    return _search(query, None).sketch(seed)


def posed(
    system: System,
    state: tuple[npt.ArrayLike, npt.ArrayLike],
    goal: Goal,
    limits: Limits | None = None,
    scene: Scene | None = None,
) -> Query:
    """What is asked for, from a state at rest; arguments and errors are as for :func:`move`."""
    require_type("system", system, System, "a System, such as System(model)")
    require_type("goal", goal, Goal, "a Goal, such as Goal(joints=joints)")
    limits, scene = Limits() if limits is None else limits, Scene() if scene is None else scene
    require_type("limits", limits, Limits, "Limits, such as Limits(joint_rate=rates)")
    require_type("scene", scene, Scene, "Scene(bodies, corridor)")
    accepted = "attitude and joints"
    require_type("state", state, Sequence, accepted)
    if len(state) != 2:
        raise InputError("state", f"{len(state)} entries were given", accepted)
    attitude = unit_quaternion("state.attitude", state[0])
    joints = system.model.joint_vector(state[1], "state.joints")
    setting = goal_setting(system, attitude, goal, scene)
    setting = setting.replace(limits=limits_for(setting, limits))
    return Query(setting, GoalStart(attitude, joints, np.zeros_like(joints)), goal)


def move_from(query: Query, *, seed: int = 0, progress: Progress | None = None) -> GoalMotion:
    """Find a motion of the joints to a goal, from a state at which they may move.

    Args:
        query: What is asked for.
        seed: Seed of the random paths.
        progress: Called with the fraction done, in [0, 1].

    Raises:
        InputError: If robot, state and limits do not suit the goal.
    """
    query.require_sense()
    goal = query.goal
    outcome = GoalMotion(query.setting, goal, False, "", seed=seed_number("seed", seed))
    reason = query.known_obstacle()
    if reason is not None:
        return replace(outcome, reason=reason)
    part = 1.0 if goal.duration is None else _FIRST
    search = _search(query, step_of(progress, 0.0, part))
    found = search.shortest(outcome.seed)
    if found is not None:
        return outcome.with_motion(found.motion, found.results)
    longer: GoalMotion | None = None
    if goal.duration is not None and query.limits.timed and not query.is_there:
        free = replace(query, goal=replace(goal, duration=None))
        longer = move_from(free, seed=seed, progress=step_of(progress, part, 1.0))
    return _why_not(outcome, search, seed, longer, query.goal_words)


def _search(query: Query, progress: Progress | None) -> GoalSearch:
    """The search for motions to a goal."""
    setting, start, pairs = query.setting, query.start, query.checker.pairs
    shapes: list[ShapeLimits] = [StateLimits(setting, query.limits, start.attitude)]
    if pairs is not None:
        shapes.append(Clearances(setting, pairs, start.joints, query.attitude))
    families = list(families_of(query, shapes))
    return GoalSearch(families, Certification(query), step_of(progress, 0.0, 1.0))


def arrive(
    setting: JointSetting,
    present: tuple[Array, Array],
    state: GoalStart,
    *,
    duration: float | None = None,
    first_duration: float,
    seed: int = 0,
    progress: Progress | None = None,
) -> GoalMotion:
    """Find a motion of the joints from rest that ends with a state at time zero.

    When it begins is known only once it is found, and with it where the bodies of the scene are
    then. So it is found backward in time, from time zero: momentum, wheels, drift and the rates of
    these bodies have opposite signs.

    Args:
        setting: Robot, momentum, scene and limits at time zero, from the centre of mass then.
        present: Attitude of the spacecraft and joints where it begins.
        state: The state at the end.
        duration: Duration [s]; None for the shortest one found that limits permit.
        first_duration: Duration with which the search for that one begins [s].
        seed: Seed of the random paths.
        progress: Called with the fraction done, in [0, 1].

    Returns:
        The motion, from its first centre of mass.
    """
    attitude, joints = present
    query = Query(
        _backward(setting), state._replace(joint_rates=-state.joint_rates),
        Goal(attitude=attitude, joints=joints, duration=duration),
        goal_words="the given beginning", first_duration=first_duration,
    )  # fmt: skip
    back = move_from(query, seed=seed, progress=progress)
    rates = state.joint_rates if state.joint_rates.any() else None
    goal = Goal(None, state.attitude, state.joints, duration=duration, joint_rates=rates)
    outcome = replace(back, setting=setting, goal=goal, motion=None, limit_results=())
    return outcome if back.law is None else _forward(outcome, back.law, attitude)


def _forward(outcome: GoalMotion, back: JointLaw, attitude: Array) -> GoalMotion:
    """The outcome with the motion whose joints are the joints of a motion backward in time."""
    there = earlier(outcome.setting, back.duration)
    curve = JointSpline(back.curve.control_points[::-1])
    motion = integrate_spline(JointLaw(there, curve, back.duration), attitude)
    results = LimitChecker(there, required_limits(there)).results(motion)
    return replace(outcome, setting=there).with_motion(motion, results)


def _backward(setting: JointSetting) -> JointSetting:
    """The setting backward in time."""
    bodies = tuple(
        replace(body, motion=replace(body.motion, rate=-body.motion.rate))
        if isinstance(body.motion, Tumbling) else body
        for body in setting.scene.bodies
    )  # fmt: skip
    return replace(
        setting, momentum=-setting.momentum, wheel_momentum=-setting.wheel_momentum,
        drift=-setting.drift, scene=Scene(bodies, setting.scene.corridor),
    )  # fmt: skip


def _why_not(
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
    results = search.certification.query.checker.results(nearest.motion)
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
