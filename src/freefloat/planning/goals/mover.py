"""Finding a motion of the joints to a goal from the state of a system."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from freefloat.concurrency import Progress, step_of
from freefloat.dynamics.inverse_dynamics import InverseDynamics
from freefloat.dynamics.system import System
from freefloat.errors import InputError, require_type, seed_number
from freefloat.limits.check import LimitChecker
from freefloat.limits.limits import Limits
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.planning.goals.certification import Certification
from freefloat.planning.goals.clearances import Clearances
from freefloat.planning.goals.effort import Effort
from freefloat.planning.goals.failure import too_far, turns_too_far, why_not
from freefloat.planning.goals.goal import Goal
from freefloat.planning.goals.goal_motion import GoalMotion, earlier, goal_problem
from freefloat.planning.goals.joint_paths import Ends, JointPaths
from freefloat.planning.goals.placements import Arm
from freefloat.planning.goals.relaxation import Relaxation
from freefloat.planning.goals.resting import violation_at_rest
from freefloat.planning.goals.search import GoalSearch
from freefloat.planning.goals.target import EndState
from freefloat.planning.goals.violations import ShapeLimits, StateLimits
from freefloat.scene.scene import Scene
from freefloat.so3 import Array, unit_quaternion

_MOVING = ((8, 1), (12, 1), (16, 1))
"""Spans and loops of paths that need not turn the spacecraft."""
_TURNING = ((8, 1), (8, 2), (8, 4), (8, 8), (8, 16), (8, 32))
"""Those of paths that turn it: small loops turn it with their area, and fit where large do not."""
_USED = 0.99
"""Fraction of limits of rates that paths in a given duration use."""
_FIRST = 0.5
"""Part of the progress that the search in a given duration is."""
_SAME = 1e-9
"""Distance from a goal that is the state at the start [rad, m]."""


class Start(NamedTuple):
    """The state at which a motion begins.

    Attributes:
        attitude: Attitude of the spacecraft, unit quaternion x, y, z, w.
        joints: Joint values [rad or m], shape (n,).
        joint_rates: Joint rates [rad/s or m/s], shape (n,).
    """

    attitude: Array
    joints: Array
    joint_rates: Array


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
    problem, start, limits = _posed(system, state, goal, limits, scene)
    return move_from(problem, start, goal, limits, seed=seed, progress=progress)


def sketch(
    system: System,
    state: tuple[npt.ArrayLike, npt.ArrayLike],
    goal: Goal,
    limits: Limits,
    scene: Scene,
    *,
    seed: int = 0,
) -> Motion | None:
    """A motion to a goal that is found at once: clearance, pointing and turn are left out.

    Args and errors are those of :func:`move`; None where no motion was found.
    """
    problem, start, limits = _posed(system, state, goal, limits, scene)
    _require_sense(problem, start, goal, limits)
    rates = replace(limits.without_turn, clearance=None, pointing=())
    return _search(problem, start, goal, rates, LimitChecker(problem, rates)).sketch(seed)


def _posed(
    system: System,
    state: tuple[npt.ArrayLike, npt.ArrayLike],
    goal: Goal,
    limits: Limits | None,
    scene: Scene | None,
) -> tuple[Problem, Start, Limits]:
    """The problem, the state and the limits of a search that begins at rest."""
    require_type("system", system, System, "a System, such as System(model)")
    require_type("goal", goal, Goal, "a Goal, such as Goal(joints=joints)")
    limits, scene = Limits() if limits is None else limits, Scene() if scene is None else scene
    require_type("limits", limits, Limits, "Limits, such as Limits(joint_rate=rates)")
    accepted = "attitude and joints"
    require_type("state", state, Sequence, accepted)
    if len(state) != 2:
        raise InputError("state", f"{len(state)} entries were given", accepted)
    attitude = unit_quaternion("state.attitude", state[0])
    joints = system.model.joint_vector(state[1], "state.joints")
    problem = goal_problem(system, attitude, joints, goal, scene)
    return problem, Start(attitude, joints, np.zeros_like(joints)), limits


def move_from(
    problem: Problem,
    start: Start,
    goal: Goal,
    limits: Limits,
    *,
    seed: int = 0,
    progress: Progress | None = None,
) -> GoalMotion:
    """The same with the system and the scene of a problem, whose path is not followed.

    Args:
        problem: From the centre of mass at the start.
        start: The state at the start, whose joints may move.
        goal: What is to be reached.
        limits: Limits in addition to the joint ranges.
        seed: Seed of the random paths.
        progress: Called with the fraction done, in [0, 1].
    """
    _require_sense(problem, start, goal, limits)
    checker = LimitChecker(problem, limits)
    outcome = GoalMotion(problem, goal, limits, False, "")
    for there, attitude, joints, rests in _known_states(problem, start, goal):
        seen = limits.seen_from((goal.duration or 0.0) * problem.path.drift)
        known = checker if there is problem else LimitChecker(there, seen)
        violation = violation_at_rest(there, known, attitude, joints, rests)
        if violation is not None:
            values = ", ".join(f"{value:.4g}" for value in joints)
            return replace(outcome, reason=violation.violation(f"with joints {values}"))
    reason = turns_too_far(goal, start.attitude, limits)
    if reason is not None:
        return replace(outcome, reason=reason)
    target = goal.target(problem, start.attitude, start.joints)
    if goal.duration is not None or not (problem.scene.tumbles or problem.path.drifts):
        reason = too_far(target, goal.duration or 0.0)
        if reason is not None:
            return replace(outcome, reason=reason)
    part = 1.0 if goal.duration is None else _FIRST
    first = step_of(progress, 0.0, part)
    search = _search(problem, start, goal, limits, checker, first)
    found = search.shortest(seed_number("seed", seed))
    if found is not None:
        return outcome.with_motion(found.motion, found.results)
    longer: GoalMotion | None = None
    if goal.duration is not None and limits.timed and not _is_there(problem, start, goal):
        free, rest = replace(goal, duration=None), step_of(progress, part, 1.0)
        longer = move_from(problem, start, free, limits, seed=seed, progress=rest)
    return why_not(outcome, search, seed, longer)


def _search(
    problem: Problem,
    start: Start,
    goal: Goal,
    limits: Limits,
    checker: LimitChecker,
    progress: Progress | None = None,
) -> GoalSearch:
    """The search for motions from a state to a goal."""
    shapes: list[ShapeLimits] = [StateLimits(problem, limits, start.attitude)]
    if checker.pairs is not None:
        clearances = Clearances(problem, checker.pairs, limits.clearance or 0.0)
        clearances.allow_start(start.joints, Rotation.from_quat(start.attitude).as_matrix())
        shapes.append(clearances)
    families = list(_families(problem, start, goal, limits, shapes, Effort()))
    by_time = bool(
        problem.depends_on_timing or problem.scene.tumbles or start.joint_rates.any()
        or goal.joint_rates is not None or goal.body(problem) is not None
    )  # fmt: skip
    certification = Certification(problem, checker, start.attitude, by_time)
    return GoalSearch(families, certification, step_of(progress, 0.0, 1.0))


def _require_sense(problem: Problem, start: Start, goal: Goal, limits: Limits) -> None:
    """Raise an InputError for a goal that robot, state and limits do not suit."""
    problem.model.require_one_arm("motions to a goal")
    goal.require_applicable(problem)
    if goal.duration is None and not limits.timed:
        accepted = "a goal.duration, or limits.joint_rate, base_rate or joint_torque"
        raise InputError("goal.duration", "nothing determines the duration", accepted)
    if goal.joint_rates is not None and limits.joint_rate is not None:
        rates = zip(problem.model.joint_names, goal.joint_rates, limits.joint_rate, strict=True)
        for name, rate, most in rates:
            if abs(rate) > most:
                given, accepted = f"{name} moves at {rate:g}", f"at most {most:g}, its limit"
                raise InputError("goal.joint_rates", given, accepted)
    if goal.duration is None and _is_there(problem, start, goal):
        raise InputError("goal", "it is the state at the start", "another one, or goal.duration")


def _is_there(problem: Problem, start: Start, goal: Goal) -> bool:
    """Whether the state at the start is the goal."""
    if start.joint_rates.any() or goal.joint_rates is not None:
        return False
    target = goal.target(problem, start.attitude, start.joints)
    attitude = Rotation.from_quat(start.attitude).as_matrix()
    away = [target.residuals(EndState(0.0, attitude, start.joints, start.joint_rates))]
    away += [] if goal.joints is None else [goal.joints - start.joints]
    return bool(np.abs(np.concatenate(away)).max() < _SAME)


def _known_states(
    problem: Problem, start: Start, goal: Goal
) -> Iterator[tuple[Problem, Array, Array, bool]]:
    """The states at both ends, if known, and whether the joints rest there.

    Before them comes the problem from the centre of mass at their time.
    """
    yield problem, start.attitude, start.joints, not start.joint_rates.any()
    if goal.attitude is None or goal.joints is None:
        return
    if not (problem.scene.tumbles or problem.path.drifts):
        yield problem, goal.attitude, goal.joints, goal.joint_rates is None
    elif goal.duration is not None:
        rests = goal.joint_rates is None
        yield earlier(problem, -goal.duration), goal.attitude, goal.joints, rests


def _families(
    problem: Problem,
    start: Start,
    goal: Goal,
    limits: Limits,
    shapes: Sequence[ShapeLimits],
    effort: Effort,
) -> Iterator[Relaxation]:
    """Families of paths in the order in which they are tried."""
    model, n = problem.model, problem.model.dof
    target = goal.target(problem, start.attitude, start.joints)
    end_rates = np.zeros(n) if goal.joint_rates is None else goal.joint_rates
    rates = np.ones(n) if limits.joint_rate is None else limits.joint_rate
    rates = np.where(np.isfinite(rates), rates, rates[np.isfinite(rates)].max(initial=1.0))
    used = 1.0 if goal.duration is None else _USED
    ends = Ends(*start[1:], goal.joints, None if target.body is not None else end_rates)
    both = np.array([start.joints, start.joints if goal.joints is None else goal.joints])
    half = np.where(model.prismatic, 1.0, np.pi)
    low, high = model.joint_ranges
    low = np.where(np.isfinite(low), low, both.min(axis=0) - half)
    high = np.where(np.isfinite(high), high, both.max(axis=0) + half)
    momenta = np.array([problem.momentum, problem.wheel_momentum])
    accelerations = _accelerations(problem, start, limits)
    for spans, loops in _MOVING if target.attitude is None else _TURNING:
        yield Relaxation(
            Arm.of(model), JointPaths(ends, spans, loops), target,
            Rotation.from_quat(start.attitude).as_matrix(), momenta, used * rates, accelerations,
            used * (limits.base_rate or np.inf), np.array([low, high]), shapes,
            goal.duration is None, goal.duration or problem.path.duration, effort,
        )  # fmt: skip


def _accelerations(problem: Problem, start: Start, limits: Limits) -> Array:
    """Accelerations of single joints that limits of torques permit at the start, shape (n,)."""
    n = len(start.joints)
    if limits.joint_torque is None:
        return np.full(n, np.inf)
    dynamics, still = InverseDynamics(problem.system), np.zeros(3 + n)
    torques = [
        dynamics.of_joints(start.attitude, start.joints, still, axis).joint_torques
        for axis in np.eye(n)
    ]
    return np.asarray(limits.joint_torque / np.abs(np.diag(torques)))
