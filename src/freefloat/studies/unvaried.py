"""The unvaried scenario of a study, and what limits its motions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freefloat.ensemble.disturbed_motions import (
    SAFE_RANGE,
    STRICT_SAFE_RANGE,
    integrate_disturbed,
)
from freefloat.ensemble.endings import NORMAL
from freefloat.ensemble.equivalence import equivalents
from freefloat.ensemble.many_motions import ManyMotions
from freefloat.io.scenario.scenario import Scenario
from freefloat.limits.limits import GIVEN
from freefloat.motion.problem import Problem
from freefloat.robot.joint_ranges import largest_range_ratio
from freefloat.so3 import Array, BoolArray
from freefloat.studies.document import scenario_from
from freefloat.studies.study import Study

_OUTSIDE = 1.001
"""Fraction of a joint range beyond which values at the steps show that it is left."""


@dataclass(frozen=True, eq=False)
class Unvaried:
    """The base scenario of a study, in the arm branches of whose motions the runs begin.

    Attributes:
        problem: The base scenario's problem, which may have ``start_joints``.
        ranges: Whether the choice of its motion depends on joint ranges.
    """

    problem: Problem
    ranges: bool

    @classmethod
    def of(cls, study: Study) -> Unvaried | None:
        """That of a study; None where limits choose the motion, which only precise ones show."""
        scenario = scenario_from(study.posed(study.base), study.base_source.absolute())
        problem = scenario.search().applied_to(scenario.problem())
        ranges, limited = has_ranges_and_limits(scenario)
        if problem.start_joints is not None:
            return cls(problem, False)
        return None if limited else cls(problem, ranges)

    def joints_at(self, attitudes: Array, threads: int) -> Array:
        """Initial joint values of its motions from attitudes (K, 4).

        Returns:
            Shape (K, n); NaN where there is no motion, or a precise one decides which it is.
        """
        required = np.full(len(attitudes), self.problem.margin.threshold)
        begun = None
        if self.problem.start_joints is not None:
            sets = self.problem.many_branches(attitudes)
            begun = np.full((len(attitudes), self.problem.model.arm_dof), np.nan)
            begun[np.nonzero(sets.exist)[0]] = sets.joints[sets.exist]
        motions = integrate_disturbed(
            equivalents(self.problem.replace(start_joints=None), len(attitudes)), attitudes,
            required, joints=begun, threads=threads, ranges=self.ranges,
        )  # fmt: skip
        if not self.ranges:
            return motions.joints
        decided = keeps_ranges(self.problem, motions) | ~motions.feasible
        return np.where(decided[:, None], motions.joints, np.nan)


def keeps_ranges(problem: Problem, motions: ManyMotions) -> BoolArray:
    """Whether motions keep their joint ranges by more than an ensemble's errors, shape (K,)."""
    safe = np.where(motions.deciders == NORMAL, SAFE_RANGE, STRICT_SAFE_RANGE)
    return np.asarray(range_ratios(problem, motions) <= safe)


def leaves_ranges(problem: Problem, motions: ManyMotions) -> BoolArray:
    """Whether motions leave their joint ranges, by more than an ensemble's errors, shape (K,)."""
    return np.asarray(range_ratios(problem, motions) > _OUTSIDE)


def range_ratios(problem: Problem, motions: ManyMotions) -> Array:
    """Ratios of joint ranges that motions use, at the integrator's steps, shape (K,)."""
    return largest_range_ratio(problem.model.joint_ranges, motions.lower, motions.upper)


def has_ranges_and_limits(scenario: Scenario) -> tuple[bool, bool]:
    """Whether the joints of a scenario have ranges, and whether anything else is limited."""
    problem = scenario.problem()
    ranges = bool(np.isfinite(problem.model.joint_ranges).any())
    limits = scenario.limits()
    bounds = [bound for kind in GIVEN if (bound := getattr(limits, kind.name)) is not None]
    given = any(np.size(bound) > 0 and not isinstance(bound, str) for bound in bounds)
    return ranges, given or problem.scene.corridor is not None
