"""The unvaried scenario of a study, and what limits its motions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freefloat.ensemble.disturbed_motions import integrate_disturbed
from freefloat.ensemble.equivalence import equivalents
from freefloat.ensemble.known_limits import KNOWN, KnownLimits
from freefloat.io.scenario.scenario import Scenario
from freefloat.limits.kinds.clearance import ClearanceLimit
from freefloat.limits.limits import GIVEN, Limits
from freefloat.limits.recorded_limits import RecordedLimits
from freefloat.limits.values import OFF
from freefloat.motion.pointing import AttitudeLimits
from freefloat.motion.problem import Problem
from freefloat.so3 import Array
from freefloat.studies.document import scenario_from
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
        scenario = scenario_from(study.posed(study.base), study.base_source.absolute())
        problem = scenario.search().applied_to(scenario.problem())
        if problem.start_joints is not None:
            return cls(problem, None)
        limits, others = limits_of_runs(scenario)
        return None if others or not problem.model.has_one_arm else cls(problem, limits)

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
    scenario: Scenario, *, mounts: bool = False
) -> tuple[KnownLimits, tuple[str, ...]]:
    """The limits of a scenario that ensembles know, and the names of the others.

    Args:
        scenario: The scenario.
        mounts: Whether mounts vary, so that axes of the arm's first link do.
    """
    limits, problem = scenario.limits(), scenario.problem()
    unknown = ("pointing",) if mounts else ()
    others = [name for name in _given(limits) if name not in KNOWN or name in unknown]
    if problem.scene.corridor is not None:
        others.append("corridor")
    attitude = AttitudeLimits(
        pointing=() if mounts else limits.pointing, base_turn=limits.base_turn
    )
    return KnownLimits(problem.model, limits.joint_rate, limits.base_rate, attitude), tuple(others)


def recorded_limits(
    scenario: Scenario, others: tuple[str, ...]
) -> tuple[RecordedLimits, tuple[str, ...]]:
    """The limits of a scenario that recorded motions show, and the names of the others left."""
    limits = scenario.limits()
    stated = limits.clearance if ClearanceLimit.name in others else None
    clearance = None if stated == OFF else stated
    recorded = RecordedLimits(scenario.problem(), limits.joint_torque, clearance)
    return recorded, tuple(name for name in others if name not in recorded.names)


def _given(limits: Limits) -> list[str]:
    """The names of limits that have a bound."""
    bounds = {kind.name: getattr(limits, kind.name) for kind in GIVEN}
    return [
        name for name, bound in bounds.items()
        if bound is not None and np.size(bound) > 0 and not isinstance(bound, str)
    ]  # fmt: skip
