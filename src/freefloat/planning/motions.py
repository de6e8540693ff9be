"""Precise motions of arm branches, and the evaluator of many motions for planning."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from freefloat.dynamics.redundancy import Redundancy
from freefloat.ensemble.endings import step_tolerance
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.integrators import precise_motion
from freefloat.ik.branches import ArmBranch
from freefloat.ik.numbering import MAX_BRANCHES
from freefloat.limits.limits import Limits
from freefloat.limits.result import LimitResult
from freefloat.motion.extrema import ClosestApproach, closest_approach, unwrapped
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.problem import Problem
from freefloat.motion.singularity import singular_event
from freefloat.planning.reasons import Verdict, verdict_on
from freefloat.planning.settings import Search
from freefloat.so3 import Array, frozen

_SAME_BRANCH = 1e-6
"""Distance of joints from the joints of their arm branch [rad, m]."""


@dataclass(frozen=True, eq=False)
class SimulatedBranch:
    """The motion of one arm branch.

    Attributes:
        branch: The arm at the start.
        motion: Motion from that start along the path.
        closest_approach: Closest approach to a dynamic singularity, by the problem's measure.
    """

    branch: ArmBranch
    motion: Motion = field(repr=False)
    closest_approach: ClosestApproach

    @property
    def title(self) -> str:
        """``branch 2 shoulder+ elbow- wrist+``; of redundant arms ``start 2``."""
        number, label = self.branch.index, self.branch.label
        kind = "start" if self.motion.problem.redundant else "branch"
        return f"{kind} {number}" + ("" if label == str(number) else f" {label}")

    @property
    def minimum_margin(self) -> float:
        """The smallest magnitude of the measure; zero for a motion that ends singular."""
        singular = self.motion.ending is Ending.SINGULAR
        return 0.0 if singular else self.closest_approach.value

    @property
    def feasible(self) -> bool:
        """Whether the motion completes and keeps the problem's margin."""
        return self.verdict().feasible

    def verdict(self, results: Iterable[LimitResult] = ()) -> Verdict:
        """The verdict by the margin, and by the limits along the motion."""
        return verdict_on(self.motion, results, self.closest_approach)

    def _outcome(self) -> dict[str, Any]:
        required = self.motion.setting.margin.threshold
        margin = {**self.closest_approach.to_dict(), "required": required, "kept": self.feasible}
        event = singular_event(self.motion)
        return {
            "branch": self.branch.index,
            "completed": self.motion.completed,
            "ended_at": self.motion.final.time,
            "singular": None if event is None else event.to_dict(),
            "min_margin": margin,
        }

    def summary(self) -> dict[str, Any]:
        """The outcome without the states, as a JSON document."""
        start = {"label": self.branch.label, "joints": self.branch.joints.tolist()}
        return {**self._outcome(), **start}

    def to_dict(self) -> dict[str, Any]:
        """The motion as a JSON document."""
        motion, problem = self.motion, self.motion.problem
        redundancy = problem.redundancy or Redundancy()
        return {
            **self._outcome(),
            "ending": motion.ending.value,
            "joint_names": list(problem.model.joint_names),
            "initial": motion.initial.to_dict(),
            "final": motion.final.to_dict(),
            "duration": problem.path.duration,
            "residuals": motion.residuals().to_dict(),
            "redundancy": redundancy.to_dict() if problem.redundant else None,
        }


def integrate_branch(problem: Problem, attitude: Array, branch: int) -> SimulatedBranch:
    """The motion of the arm branch with a number, which exists at the attitude (4,)."""
    start = next(entry for entry in problem.branches(attitude) if entry.index == branch)
    return simulated_branch(start, precise_motion(problem, attitude, start.joints))


def integrate_from(
    problem: Problem, attitude: Array, start: ArmBranch, **options: Any
) -> SimulatedBranch:
    """The motion from an arm branch at an attitude (4,); see :func:`integrate_motion`."""
    return simulated_branch(start, integrate_motion(problem, attitude, start.joints, **options))


def simulated_branch(start: ArmBranch, motion: Motion) -> SimulatedBranch:
    """An arm branch with its motion, and that motion's closest approach to a singularity."""
    motion, problem = unwrapped(motion), motion.problem
    approach = closest_approach(motion, problem.margin.measure)
    joints = problem.solved_joints(motion.initial.joints)
    return SimulatedBranch(replace(start, joints=joints), motion, approach)


def branch_at(problem: Problem, attitude: Array, joints: Array) -> ArmBranch:
    """The arm branch at the start of a path that joints (n,) belong to, modulo 2 pi.

    It has these joints. Where inverse kinematics finds no such branch, which is always so for
    redundant arms, its label is ``given``.
    """
    index, label = MAX_BRANCHES, "given"
    if not problem.redundant:
        for branch in problem.branches(attitude):
            if problem.model.joint_distance(branch.joints, joints) < _SAME_BRANCH:
                index, label = branch.index, branch.label
    return ArmBranch(index, label, frozen(joints))


def evaluator_for(
    problem: Problem,
    threads: int | None = None,
    limits: Limits | None = None,
    search: Search | None = None,
) -> FeasibilityEvaluator:
    """The evaluator of a problem, of headings precise enough for the limits of ranges.

    It measures the spacecraft's turn where the objective of the search depends on that.
    """
    limits = limits or Limits()
    if search is not None and search.objective.measures_turn and limits.base_turn is None:
        limits = replace(limits, base_turn=np.pi)
    return FeasibilityEvaluator(problem, threads, tolerance=step_tolerance(problem), limits=limits)


def evaluator_near(evaluator: FeasibilityEvaluator, joints: Array) -> FeasibilityEvaluator:
    """The evaluator of motions like one that begins with joints (n,), to which tolerances belong.

    A redundant arm begins where Newton's method leads from the joints; other arms in their branch.
    """
    problem = evaluator.problem
    if not problem.redundant or problem.start_joints is not None:
        return evaluator
    return FeasibilityEvaluator(
        replace(problem, start_joints=joints), evaluator.threads,
        tolerance=step_tolerance(problem), limits=evaluator.limits,
    )  # fmt: skip


def best_branch(evaluator: FeasibilityEvaluator, attitude: Array) -> tuple[int, Array]:
    """Number and initial joints of the arm branch with the largest margin at an attitude."""
    results = evaluator.evaluate(attitude[None])
    branch = int(np.argmax(results.margins[0]))
    return branch, results.joints[0, branch]
