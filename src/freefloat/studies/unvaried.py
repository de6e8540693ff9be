"""The unvaried scenario of a study, and what limits its motions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freefloat.ensemble.disturbed_motions import integrate_disturbed
from freefloat.ensemble.equivalence import equivalents
from freefloat.ensemble.known_limits import KNOWN, KnownLimits
from freefloat.io.scenario.scenario import Scenario
from freefloat.limits.limits import GIVEN
from freefloat.limits.recorded_limits import RECORDED, RecordedLimits
from freefloat.motion.pointing import AttitudeLimits
from freefloat.motion.problem import Problem
from freefloat.so3 import Array
from freefloat.studies.study import Study


@dataclass(frozen=True, eq=False)
class Unvaried:
    """The base scenario of a study, in the arm branches of whose motions the runs begin.

    Attributes:
        problem: The base scenario's problem, which may have ``start_joints``.
        limits: Those on which the choice of its motion depends; None where it depends on none.
    """

    problem: Problem
    limits: KnownLimits | None

    @classmethod
    def of(cls, study: Study) -> Unvaried | None:
        """That of a study; None where limits choose the motion, which only precise ones show."""
        scenario = study.scenario_of(study.base)
        problem = scenario.search().applied_to(scenario.problem())
        if problem.start_joints is not None:
            return cls(problem, None)
        limits, recorded, others = limits_of_runs(scenario)
        apart = others or recorded.names or not problem.model.has_one_arm
        return None if apart else cls(problem, limits)

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
            required, joints=begun, threads=threads, limits=self.limits,
        )  # fmt: skip
        if self.limits is None:
            return motions.joints
        certain = motions.limits.certain.all(axis=1)
        return np.where((certain | ~motions.feasible)[:, None], motions.joints, np.nan)


def limits_of_runs(
    scenario: Scenario, *, mounts: bool = False, moved: bool = False
) -> tuple[KnownLimits, RecordedLimits, tuple[str, ...]]:
    """The limits that ensembles know, those that recorded motions show, and names of the others.

    Args:
        scenario: The scenario.
        mounts: Whether mounts vary, so that axes and bodies of the arm's first link do.
        moved: Whether durations or robots vary, so that the bodies of a scene are elsewhere.
    """
    limits, problem = scenario.limits(), scenario.problem()
    bounds = {kind.name: getattr(limits, kind.name) for kind in GIVEN}
    given = {
        name: bound for name, bound in bounds.items()
        if bound is not None and np.size(bound) > 0 and not isinstance(bound, str)
    }  # fmt: skip
    shown = {} if mounts or (moved and problem.scene.bodies) else given
    recorded = RecordedLimits(problem, *(shown.get(name) for name in RECORDED))
    _ = recorded.places  # or the error of shapes that cannot be used
    attitude = AttitudeLimits(
        pointing=() if mounts else limits.pointing, base_turn=limits.base_turn
    )
    known = KnownLimits(problem.model, limits.joint_rate, limits.base_rate, attitude)
    seen = {*KNOWN, *recorded.names} - ({"pointing"} if mounts else set())
    corridor = () if problem.scene.corridor is None else ("corridor",)
    return known, recorded, (*sorted(given.keys() - seen), *corridor)
