"""Planning of manoeuvres: a path from the best attitude, how to get there, and what follows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from freefloat.beyond.missions.goals.goal import require_inside
from freefloat.beyond.missions.manoeuvre import (
    PATH,
    REORIENTATION,
    Manoeuvre,
    Phase,
    checked_phases,
)
from freefloat.beyond.missions.path_phase import PathPhase
from freefloat.beyond.missions.state import SystemState, keys_within
from freefloat.concurrency import Progress, step_of
from freefloat.errors import InputError, require_type
from freefloat.limits.limits import Limits, limits_for
from freefloat.motion.problem import Problem, require_problem
from freefloat.planning.answer import PhaseResult
from freefloat.planning.planner import plan
from freefloat.planning.settings import Search
from freefloat.so3 import Array, angle_between

if TYPE_CHECKING:  # pydantic imports slowly
    from freefloat.io.scenario.scenario import Scenario

_SAME_STATE = 1e-9
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
    """Plan a path, the motion to the state at which it begins, and the phases after it.

    The initial attitude of the first path is chosen by the objective of the search. A motion of the
    joints leads there from the present attitude and joints, see :func:`freefloat.move`. Every later
    phase begins with the state at which the one before ends.

    Args:
        problem: Problem of the first path. Its frame, whose origin is the centre of mass where the
            path begins, and its time are the frame and the time of the manoeuvre; the
            reorientation has negative times.
        phases: What follows.
        search: What to choose; with ``reorient`` it has the present attitude and joints.
        limits: Limits to keep in all phases, by default the problem's limits; ``base_turn`` on
            paths only. Where none of them depends on the speed, the reorientation takes as long as
            the path.
        reorient: Whether the present state is another one than the state of the path.
        threads: As for :func:`~freefloat.planning.planner.plan`.
        progress: Called with the fraction done, in [0, 1].

    Returns:
        The manoeuvre; of an infeasible one the phases up to the one that fails.

    Raises:
        InputError: If an argument is of another type; if ``reorient`` lacks the present attitude or
            joints; if a phase cannot follow those before: there is no such body or joint, or it
            begins elsewhere. What does not depend on the motions is found before they are planned.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> berth = ff.GoalPhase(ff.Goal(joints=[0.2, -0.4], duration=30.0))
        >>> manoeuvre = ff.plan_manoeuvre(problem, [berth])
        >>> [phase.kind for phase in manoeuvre.phases]
        ['path', 'goal']
    """
    search = Search() if search is None else search
    require_type("search", search, Search, "a Search, such as Search(samples=1024)")
    require_problem(problem)
    limits = limits_for(problem, limits) or Limits()
    following = checked_phases(problem, phases)
    present = _present_joints(problem.at_rest(0.0), search) if reorient else None
    share = 0.5 if reorient else 0.9
    step = step_of(progress, 0.0, share)
    first = plan(problem, search, limits, threads=threads, progress=step)
    path = PhaseResult(PATH, PathPhase.kind, first)
    if first.chosen is None or not first.feasible:
        return Manoeuvre(first, (path,), following, reorient)
    state = SystemState.at_start(first.chosen.motion)
    done: list[PhaseResult] = []
    if present is not None:
        own = state.limits(limits)
        done += _to_start(state, search, present, own, step_of(progress, share, 0.9))
    done.append(path)
    if all(phase.feasible for phase in done):
        done += _following(state.after(first.chosen.motion), following, limits)
    return Manoeuvre(first, tuple(done), following, reorient)


def _present_joints(problem: Problem, search: Search) -> Array:
    """The present joints, in their ranges, from which a reorientation begins, shape (n,)."""
    if search.from_attitude is None or search.joints is None:
        key = "search.from_attitude" if search.from_attitude is None else "search.joints"
        raise InputError(key, "it is missing, for a reorientation", "the present state")
    joints = problem.model.joint_vector(search.joints, "search.joints")
    require_inside(problem.model, joints, "search.joints")
    return joints


def _to_start(
    state: SystemState, search: Search, joints: Array, limits: Limits, progress: Progress | None
) -> list[PhaseResult]:
    """The motion from the present state that ends with another one; none where it is the same."""
    problem = state.problem
    present = problem.attitude(search.from_attitude)
    differences = np.concatenate([joints - state.joints, state.joint_rates])
    if max(angle_between(present, state.attitude), np.abs(differences).max()) <= _SAME_STATE:
        return []
    from freefloat.beyond.missions.goals.mover import arrive  # compiled kernels
    from freefloat.beyond.missions.goals.query import GoalStart

    end = GoalStart(state.attitude, state.joints, state.joint_rates)
    duration = None if limits.timed else problem.path.duration
    setting = state.setting.replace(limits=limits.without_turn)
    motion = arrive(
        setting, (present, joints), end, duration=duration,
        first_duration=problem.path.duration, seed=search.seed, progress=progress,
    )  # fmt: skip
    begin = -(motion.duration or 0.0)
    return [PhaseResult(REORIENTATION, motion.kind, motion, begin, begin * problem.drift)]


def _following(
    state: SystemState, phases: Sequence[Phase], limits: Limits
) -> Iterable[PhaseResult]:
    """The phases after the first path, up to the first that fails."""
    for number, phase in enumerate(phases):
        with keys_within(f"phases.{number}"):
            result = phase.run(state, state.limits(limits))
        yield PhaseResult(phase.name, phase.kind, result, state.time, state.centre)
        if not result.feasible:
            return
        state = phase.end(state, result)


class PosedManoeuvre:
    """The manoeuvre that a scenario asks for: phases follow its path, or a reorientation leads."""

    def __init__(self, scenario: Scenario) -> None:
        """Keep the scenario."""
        self._scenario = scenario

    @cached_property
    def phases(self) -> tuple[Phase, ...]:
        """What follows the path, see :meth:`.Scenario.phases`."""
        scenario, content = self._scenario, self._scenario.content
        problem, folder = scenario.problem(), scenario.file.parent
        keys, phases = list[str](), list[Phase]()
        with scenario.error_context():
            resting = problem.at_rest(problem.path.duration)
            posed = resting, folder, scenario.samples, content.search.seed
            for number, section in enumerate(content.phases):
                keys.append(f"phases.{number}.capture" if section.capture else f"phases.{number}")
                with keys_within(keys[-1]):
                    phases.append(section.to_phase(*posed))
            return checked_phases(resting, phases, keys)

    def plan(self, *, threads: int | None = None, progress: Progress | None = None) -> Manoeuvre:
        """The manoeuvre, see :func:`freefloat.plan_manoeuvre`."""
        scenario = self._scenario
        problem, search, phases = scenario.problem(), scenario.search(), scenario.phases()
        reorient = scenario.content.search.reorient
        with scenario.error_context():
            return plan_manoeuvre(
                problem, phases, search, reorient=reorient, threads=threads, progress=progress
            )
