"""Motions along further paths from the state that there is, without a search."""

from __future__ import annotations

import numpy as np

from freefloat.certificate.certificate import certify
from freefloat.ik.branches import ArmBranch
from freefloat.ik.numbering import MAX_BRANCHES
from freefloat.limits.check import LimitChecker
from freefloat.limits.contact import self_contact
from freefloat.limits.limits import LimitResult, Limits, violated
from freefloat.motion.extrema import closest_approach
from freefloat.motion.integration import integrate_motion
from freefloat.motion.problem import Problem
from freefloat.planning.phases.phases import PathPhase
from freefloat.planning.phases.prescribed_path import JUMP
from freefloat.planning.phases.state import Handover
from freefloat.planning.plan import Plan
from freefloat.planning.settings import Search
from freefloat.planning.simulation import SimulatedBranch
from freefloat.so3 import Array, frozen

_NEAR = 1e-6
"""Distance of joints from those of their arm branch [rad, m]."""


def branch_at(problem: Problem, attitude: Array, joints: Array) -> ArmBranch:
    """The arm branch at the start of a path that joints (n,) belong to, modulo 2 pi.

    It has these joints. Where inverse kinematics finds no such branch, which is always so for
    redundant arms, its label is ``given``.
    """
    index, label = MAX_BRANCHES, "given"
    if not problem.redundant:
        for branch in problem.branches(attitude):
            if problem.model.joint_distance(branch.joints, joints) < _NEAR:
                index, label = branch.index, branch.label
    return ArmBranch(index, label, frozen(joints))


def continued(state: Handover, phase: PathPhase, limits: Limits) -> Plan:
    """The motion along a further path from a state, exactly as it is.

    Raises:
        InputError: If the path does not begin with that state.
    """
    problem = state.problem_of(phase)
    motion = integrate_motion(problem, state.attitude, state.joints)
    approach = closest_approach(motion, problem.margin.measure)
    branch = branch_at(problem, state.attitude, state.joints)
    chosen = SimulatedBranch(branch, motion, approach)
    results = LimitChecker(problem, limits).results(motion)
    failure = _failure(state, chosen, results)
    return Plan(
        problem, Search(), failure is None, failure or "the state at the end of the phase before",
        chosen=chosen, limits=limits, limit_results=results, certificate=certify(motion),
        contact=self_contact(motion, results),
    )  # fmt: skip


def _failure(
    state: Handover, chosen: SimulatedBranch, results: tuple[LimitResult, ...]
) -> str | None:
    """Why the motion is not feasible; None if it is."""
    motion, required = chosen.motion, chosen.motion.problem.margin.threshold
    if not motion.completed:
        return f"{motion.ending.value} t = {motion.final.time:.4g} s"
    change = float(np.abs(Handover.at_start(motion).joint_rates - state.joint_rates).max())
    if change > JUMP:
        needed = "a phase of joints before it brings the arm to rest"
        return f"joint rates would change by {change:.3g} rad/s or m/s where it begins; {needed}"
    if not chosen.feasible:
        return f"the margin {chosen.minimum_margin:.4g} is below {required:.4g}"
    for worst in violated(results):
        return f"{worst.limit} of {worst.where} is violated at t = {worst.time:.4g} s"
    return None
