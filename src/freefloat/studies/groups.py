"""Groups of runs that one ensemble integrates: those that differ in disturbances alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from freefloat.ensemble.disturbed_motions import integrate_disturbed
from freefloat.ensemble.equivalence import ScaledMotions, equivalents
from freefloat.ensemble.known_limits import KNOWN, KnownLimits, LimitValues
from freefloat.ensemble.many_motions import ManyMotions
from freefloat.io.scenario.scenario import Scenario
from freefloat.limits.limits import GIVEN
from freefloat.limits.recorded_limits import RECORDED, RecordedLimits
from freefloat.motion.pointing import AttitudeLimits
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, BoolArray, IntArray
from freefloat.studies.disturbances import FRACTION, arrays_of, bound_ratios, limit_scales
from freefloat.studies.study import Study
from freefloat.studies.varied_robots import (
    VariedRobot,
)

_RECORDED_TOGETHER = 512
"""Motions that are recorded at once."""


@dataclass(frozen=True, eq=False)
class Group:
    """Runs of a study that differ in disturbances alone.

    Attributes:
        study: The study.
        problem: What the runs have in common.
        relative: Whether the margin is a fraction of the largest value of each run's measure.
        attitude: Initial attitude, shape (4,); None where it varies.
        branch: Number of the arm branch; None for that near joints, or the best of each run.
        joints: Joint values near those of the arm branch, shape (n,); None where the attitude
            varies, or without them.
        limits: The limits that ensembles know.
        recorded: The limits that recorded motions show.
        others: Names of the limits that only precise motions show.
        nominal: Values of the varied keys of limits and margin that the problem has.
        robot: The robot of which those of the runs are variations.
    """

    study: Study
    problem: Problem
    relative: bool
    attitude: Array | None
    branch: int | None
    joints: Array | None
    limits: KnownLimits
    recorded: RecordedLimits
    others: tuple[str, ...]
    nominal: Mapping[str, float]
    robot: VariedRobot

    @property
    def starts_at_best(self) -> bool:
        """Whether the arm branch is the best of each run."""
        return self.branch is None and self.study.arm_start.joints is None

    def integrate(self, numbers: IntArray, threads: int) -> tuple[IntArray, ManyMotions]:
        """Integrate runs; return the numbers of those whose values fit, and their motions."""
        first = int(numbers[0])
        count = int(numbers[-1]) + 1 - first
        values = self.study.variation.values(first, count)
        arrays, fits = arrays_of(values, self.problem, count)
        attitudes = arrays.pop("attitudes", None)
        thresholds = arrays.pop("thresholds", None)
        ratios, accepted = bound_ratios(values, self.nominal, count)
        fits &= accepted
        fractions = 1.0 / ratios.pop(FRACTION, np.ones(count))
        robots, accepted = self.robot.robots(values, np.arange(first, first + count))
        fits &= accepted
        if robots is not None:
            fits &= robots.suit(self.problem)
        limits = dict(zip(self.limit_names, self.limit_places, strict=True))
        limits.pop("clearance", None)  # whose bound chooses the pairs of bodies
        scales = limit_scales(ratios, limits, self.limits.attitude.pointing)
        disturbed = equivalents(self.problem, count, **arrays, robots=robots, scales=scales)
        places = numbers - first
        places = places[(fits & ~disturbed.turns_too_often)[places]]
        if attitudes is None:
            attitudes = np.tile(np.asarray(self.attitude), (len(places), 1))
        else:
            attitudes = attitudes[places]
        joints = self.joints
        if joints is None and self.study.arm_start.joints is not None:
            joints = self.study.joints_near(attitudes)
        disturbed = disturbed[places]
        if thresholds is None:
            required = self.problem.margin.threshold * fractions[places]
            thresholds = required * disturbed.magnifications if self.relative else required
        else:
            thresholds = thresholds[places]
        motions = integrate_disturbed(
            disturbed,
            attitudes,
            thresholds,
            self.branch,
            joints,
            threads,
            limits=self.limits,
        )
        if self.recorded.names:
            motions = self._with_recorded(disturbed, motions, threads)
        return places + first, motions

    @property
    def limit_names(self) -> tuple[str, ...]:
        """Names of the limits of which motions of the group have ratios."""
        return self.limits.names + self.recorded.names

    @property
    def limit_places(self) -> tuple[tuple[str, ...], ...]:
        """Of each of these limits the joints, or other names, of its quantities."""
        return self.limits.places + self.recorded.places

    def _with_recorded(
        self, disturbed: ScaledMotions, motions: ManyMotions, threads: int
    ) -> ManyMotions:
        """Motions with the limits that recorded ones show, of those that keep all else."""
        known = motions.limits
        values = LimitValues.empty(len(motions), len(self.recorded.names))
        keeping = ((known.ratios <= 1.0) & known.certain).all(axis=1)
        kept = np.flatnonzero(motions.feasible & keeping)
        parts = range(_RECORDED_TOGETHER, len(kept), _RECORDED_TOGETHER)
        for chosen in np.split(kept, parts) if len(kept) else ():
            found = self.recorded.values(
                disturbed[chosen], motions.attitudes[chosen], motions.joints[chosen], threads
            )
            for array, part in zip(values, found, strict=True):
                array[chosen] = part
        return replace(motions, limits=known.and_others(values))

    def are_feasible(self, motions: ManyMotions) -> BoolArray:
        """Whether motions keep the margin and the limits that ensembles know, shape (K,)."""
        return np.asarray(motions.feasible & self.keep_limits(motions)[0])

    def keep_limits(self, motions: ManyMotions) -> tuple[BoolArray, BoolArray]:
        """Whether motions keep the limits that ensembles know, and where all limits are decided.

        Shape (K,) each.
        """
        limits = motions.limits
        kept, known = (limits.ratios <= 1.0).all(axis=1), slice(len(self.limits.names))
        # another arm branch may keep what recorded motions show
        decisive = known if self.starts_at_best else slice(None)
        violated = (limits.certain & (limits.ratios > 1.0))[:, decisive].any(axis=1)
        certain = violated & limits.certain[:, known].all(axis=1)
        certain |= limits.certain.all(axis=1) & kept & (not self.others)
        return np.asarray(kept), np.asarray(motions.completed & certain)

    def are_decided(self, motions: ManyMotions) -> BoolArray:
        """Whether motions have a verdict; those of others need a precise motion, shape (K,)."""
        _, certain = self.keep_limits(motions)
        return np.asarray(motions.reached & ~motions.failed & (certain | ~motions.feasible))


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
