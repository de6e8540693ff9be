"""Planning of manoeuvres: a path from the best attitude, how to get there, and what follows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from freefloat.concurrency import Progress, step_of
from freefloat.errors import InputError, require_type
from freefloat.limits.contact import self_contact
from freefloat.limits.limits import Limits
from freefloat.motion.certificate import certify
from freefloat.motion.joint_transfer import JointTransfer
from freefloat.motion.problem import Problem
from freefloat.planning.handover import Handover
from freefloat.planning.joint_motion import JointMotion, joint_motion, settling
from freefloat.planning.manoeuvre import Manoeuvre, PlannedPhase
from freefloat.planning.phases import CapturePhase, JointPhase, PathPhase, Phase
from freefloat.planning.plan import Plan, Search
from freefloat.planning.planner import plan
from freefloat.planning.reorientation import reorient
from freefloat.planning.simulation import simulate
from freefloat.so3 import angle_between

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
        problem: That of the first path. Its frame, whose origin is the centre of mass where the
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
        InputError: If an argument is of another type, a phase does not begin where the one before
            ends, or ``reorient`` lacks the present attitude or joints.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> manoeuvre = ff.plan_manoeuvre(problem, [ff.JointPhase([0.2, -0.4], duration=30.0)])
        >>> [phase.kind for phase in manoeuvre.phases]
        ['path', 'joints']
    """
    search = Search() if search is None else search
    limits = Limits() if limits is None else limits
    for phase in (following := tuple(phases)):
        accepted = "a PathPhase, a JointPhase or a CapturePhase"
        require_type("phases", phase, PathPhase | JointPhase | CapturePhase, accepted)
    if reorient and (search.from_attitude is None or search.joints is None):
        key = "search.from_attitude" if search.from_attitude is None else "search.joints"
        raise InputError(key, "it is missing, for a reorientation", "the present state")
    share = 0.5 if reorient else 0.9
    step = step_of(progress, 0.0, share)
    first = plan(problem, search, limits, threads=threads, progress=step)
    if first.chosen is None or not first.feasible:
        return Manoeuvre((PlannedPhase("path", 0.0, np.zeros(3), first),), first.reason)
    state = Handover.at_start(first.chosen.motion)
    done: list[PlannedPhase] = []
    if reorient:
        done += _to_start(state, search, limits, step_of(progress, share, 0.9))
    done.append(PlannedPhase("path", 0.0, np.zeros(3), first))
    if all(phase.feasible for phase in done):
        done += _following(state.after(first.chosen.motion), following, limits)
    return _assembled(done)


def _assembled(phases: Sequence[PlannedPhase]) -> Manoeuvre:
    """The manoeuvre, with its reason."""
    failed = next((phase for phase in phases if not phase.feasible), None)
    reason = f"all {len(phases)} phases succeed"
    if failed is not None:
        reason = f"{failed.name}: {failed.reason}"
    return Manoeuvre(tuple(phases), reason)


def _to_start(
    state: Handover, search: Search, limits: Limits, progress: Progress | None
) -> list[PlannedPhase]:
    """Reorientation and settling that end with a state; none that are not needed."""
    problem, done = state.problem, list[PlannedPhase]()
    joints = problem.model.joint_vector(search.joints, "search.joints")  # type: ignore[arg-type]
    attitude, begin = state.attitude, 0.0
    if max(np.abs(joints - state.joints).max(), np.abs(state.joint_rates).max()) > _SAME:
        settled = settling(problem, joints, attitude, state.joints, state.joint_rates, limits)
        begin = -settled.duration
        centre = begin * problem.path.drift
        done.append(PlannedPhase("settling", begin, centre, settled))
        attitude = settled.motion.initial.attitude
    present = problem.attitude(search.from_attitude)
    if angle_between(present, attitude) > _SAME:
        turned = reorient(problem, present, attitude, limits, joints=joints, progress=progress)
        begin -= turned.duration or 0.0
        done.insert(0, PlannedPhase("reorientation", begin, begin * problem.path.drift, turned))
    return done


def _following(state: Handover, phases: Sequence[Phase], limits: Limits) -> Iterable[PlannedPhase]:
    """The phases after the first path, up to the first that fails."""
    for phase in phases:
        start, centre = state.time, state.centre
        if isinstance(phase, CapturePhase):
            state, found = state.captured(phase)
            yield PlannedPhase(phase.name, start, centre, found)
            continue
        if isinstance(phase, JointPhase):
            result: JointMotion | Plan = _joints(state, phase, limits)
        else:
            result = _path(state, phase, limits)
        planned = PlannedPhase(phase.name, start, centre, result)
        yield planned
        motion = planned.motion
        if not planned.feasible or motion is None:
            return
        state = state.after(motion)


def _joints(state: Handover, phase: JointPhase, limits: Limits) -> JointMotion:
    problem = replace(state.problem, scene=state.scene)
    end = problem.model.joint_vector(phase.joints, f"phases.{phase.name}.joints")
    transfer = JointTransfer.between(
        state.joints, state.joint_rates, end, np.zeros_like(end), phase.duration
    )
    return joint_motion(problem, transfer, state.attitude, phase.duration, limits)


def _path(state: Handover, phase: PathPhase, limits: Limits) -> Plan:
    """The motion along a further path from the state that there is."""
    problem = state.stated(state.path_of(phase), phase.margin, phase)
    simulation = simulate(problem, state.attitude, joints=state.joints, limits=limits)
    chosen, results = simulation.chosen, simulation.limit_results
    kept = all(result.kept for result in results)
    reason = "the state at the end of the phase before"
    if not chosen.motion.completed:
        reason = f"{chosen.motion.ending.value} t = {chosen.motion.final.time:.4g} s"
    elif not simulation.feasible:
        reason = f"the margin {chosen.minimum_margin:.4g} is below {phase.margin:.4g}"
    elif not kept:
        worst = next(result for result in results if not result.kept)
        reason = f"{worst.limit} of {worst.where} is violated at t = {worst.time:.4g} s"
    return Plan(
        problem, Search(), simulation.feasible and kept, reason, chosen=chosen, limits=limits,
        limit_results=results, certificate=certify(chosen.motion),
        contact=self_contact(chosen.motion, results),
    )  # fmt: skip
