"""Planning of manoeuvres: a path from the best attitude, how to get there, and what follows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from freefloat.concurrency import Progress, step_of
from freefloat.errors import InputError, require_type
from freefloat.limits.limits import Limits
from freefloat.motion.problem import Problem, require_problem
from freefloat.planning.answer import PhaseResult
from freefloat.planning.joints.joint_motion import settling
from freefloat.planning.joints.reorientation import reorient
from freefloat.planning.phases.expected_state import keys_within
from freefloat.planning.phases.manoeuvre import Manoeuvre
from freefloat.planning.phases.phase import Phase, checked_phases
from freefloat.planning.phases.state import SystemState
from freefloat.planning.planner import plan
from freefloat.planning.settings import Search
from freefloat.so3 import Array, angle_between

_SAME = 1e-9
"""Angle between attitudes, and difference of joints, that are the same [rad, m]."""


def plan_manoeuvre(
    problem: Problem,
    phases: Iterable[Phase] = (),
    search: Search | None = None,
    limits: Limits | None = None,
    *,
    reorient: bool = False,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Manoeuvre:
    """Plan a path, the reorientation to its initial attitude, and the phases after it.

    The initial attitude of the first path is chosen by the objective of the search; with
    ``"nearest"`` the reorientation is the smallest. Loops of the joints turn the spacecraft, then
    the joints settle at those with which the path begins. Every later phase begins with the state
    at which the one before ends.

    Args:
        problem: Problem of the first path. Its frame, whose origin is the centre of mass where the
            path begins, and its time are those of the manoeuvre; reorientation and settling have
            negative times.
        phases: What follows.
        search: What to choose; with ``reorient`` it has the present attitude and joints.
        limits: Limits to keep in all phases; ``base_turn`` on paths only, bodies and corridor of
            the scene in all phases but the reorientation.
        reorient: Whether the present attitude is another one than that of the path.
        threads: As for :func:`~freefloat.planning.planner.plan`.
        progress: Called with the fraction done, in [0, 1].

    Returns:
        The manoeuvre; of an infeasible one the phases up to the one that fails.

    Raises:
        InputError: If an argument is of another type; if ``reorient`` lacks the present attitude or
            joints, or is asked for with drift and a point of ``limits.pointing``; if a phase cannot
            follow those before: there is no such body or joint, or it begins elsewhere. What does
            not depend on the motions is found before they are planned.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> manoeuvre = ff.plan_manoeuvre(problem, [ff.JointPhase([0.2, -0.4], duration=30.0)])
        >>> [phase.kind for phase in manoeuvre.phases]
        ['path', 'joints']
    """
    search = Search() if search is None else search
    require_type("search", search, Search, "a Search, such as Search(samples=1024)")
    limits = Limits() if limits is None else limits
    require_problem(problem)
    following = checked_phases(problem, phases)
    present = None
    if reorient:
        present = _present_joints(problem, search)
        _require_directions(problem, limits)
    share = 0.5 if reorient else 0.9
    step = step_of(progress, 0.0, share)
    first = plan(problem, search, limits, threads=threads, progress=step)
    path = PhaseResult("path", "path", first)
    if first.chosen is None or not first.feasible:
        return Manoeuvre(first, (path,), first.reason)
    state = SystemState.at_start(first.chosen.motion)
    done: list[PhaseResult] = []
    if present is not None:
        done += _to_start(state, search, present, limits, step_of(progress, share, 0.9))
    done.append(path)
    if all(phase.feasible for phase in done):
        done += _following(state.after(first.chosen.motion), following, limits)
    return Manoeuvre.of(first, done)


def _present_joints(problem: Problem, search: Search) -> Array:
    """The present joints, in their ranges, from which a reorientation begins, shape (n,)."""
    if search.from_attitude is None or search.joints is None:
        key = "search.from_attitude" if search.from_attitude is None else "search.joints"
        raise InputError(key, "it is missing, for a reorientation", "the present state")
    model = problem.model
    joints = model.joint_vector(search.joints, "search.joints")
    for name, value, *ends in zip(model.joint_names, joints, *model.joint_ranges, strict=True):
        if not ends[0] <= value <= ends[1]:
            accepted = f"{ends[0]:g} to {ends[1]:g} rad or m"
            raise InputError("search.joints", f"{name} is {value:g}", accepted)
    return joints


def _require_directions(problem: Problem, limits: Limits) -> None:
    """Raise an InputError for points whose place depends on the duration of a reorientation."""
    for number, limit in enumerate(limits.pointing):
        if limit.point is not None and problem.path.drifts:
            key = f"limits.pointing.{number}.target.point"
            given = "the centre of mass drifts during the reorientation"
            raise InputError(key, given, "a direction, or no drift")


def _to_start(
    state: SystemState, search: Search, joints: Array, limits: Limits, progress: Progress | None
) -> list[PhaseResult]:
    """Reorientation and settling that end with a state; none that are not needed."""
    problem, attitude, begin = state.problem, state.attitude, 0.0
    done: list[PhaseResult] = []
    if max(np.abs(joints - state.joints).max(), np.abs(state.joint_rates).max()) > _SAME:
        settled = settling(problem, joints, attitude, state.joints, state.joint_rates, limits)
        begin = -settled.duration
        centre = begin * problem.path.drift
        done.append(PhaseResult("settling", "joints", settled, begin, centre))
        attitude = settled.motion.initial.attitude
    present = problem.attitude(search.from_attitude)
    if angle_between(present, attitude) > _SAME:
        turned = reorient(problem, present, attitude, limits, joints=joints, progress=progress)
        begin -= turned.duration or 0.0
        centre = begin * problem.path.drift
        done.insert(0, PhaseResult("reorientation", "reorientation", turned, begin, centre))
    return done


def _following(
    state: SystemState, phases: Sequence[Phase], limits: Limits
) -> Iterable[PhaseResult]:
    """The phases after the first path, up to the first that fails."""
    for number, phase in enumerate(phases):
        with keys_within(f"phases.{number}"):
            result = phase.run(state, limits.seen_from(state.centre))
        yield PhaseResult(phase.name, phase.kind, result, state.time, state.centre)
        if not result.feasible:
            return
        state = phase.end(state, result)
