"""Groups of runs that one ensemble integrates: those that differ in disturbances alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from freefloat.ensemble.disturbed_motions import integrate_disturbed
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.ensemble.equivalence import Equivalents, equivalents
from freefloat.ensemble.known_limits import KnownLimits, LimitValues
from freefloat.ensemble.many_motions import ManyMotions
from freefloat.ensemble.starts import starts_at
from freefloat.ensemble.systems import Systems
from freefloat.errors import FreeFloatError
from freefloat.io.scenario.path_schema import PathFrame
from freefloat.io.scenario.scenario import Scenario
from freefloat.limits.recorded_limits import RecordedLimits
from freefloat.motion.problem import Problem
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import UPRIGHT, Array, BoolArray, IntArray
from freefloat.studies.bounds import FRACTION, bound_ratios, is_bound, limit_scales
from freefloat.studies.document import scenario_from, with_values
from freefloat.studies.records import branch_choice
from freefloat.studies.robot_values import (
    SCALE_MASS,
    VariedRobot,
    nominal_values,
    vary_robots,
)
from freefloat.studies.run_values import arrays_of, fits_ensembles
from freefloat.studies.study import START_KEYS, Study
from freefloat.studies.unvaried import Unvaried, limits_of_runs

_RECORDED = 512
"""Motions that are recorded at once."""


@dataclass(frozen=True, eq=False)
class Start:
    """The start of the runs of a group.

    Attributes:
        attitude: Initial attitude, shape (4,); None where it varies.
        branch: Number of the arm branch; None for that near ``joints``, or the best of each run.
        joints: Joint values near those of the arm branch, shape (n,).
        unvaried: The base scenario, if the arm branch is that of its motion from each attitude.
    """

    attitude: Array | None = None
    branch: int | None = None
    joints: Array | None = None
    unvaried: Unvaried | None = None

    @property
    def is_best(self) -> bool:
        """Whether the arm branch is the best of each run."""
        return self.branch is None and self.joints is None and self.unvaried is None


@dataclass(frozen=True, eq=False)
class Group:
    """Runs of a study that differ in disturbances alone.

    Attributes:
        study: The study.
        problem: What the runs have in common.
        relative: Whether the margin is a fraction of the largest value of each run's measure.
        start: How the runs begin.
        limits: The limits that ensembles know.
        recorded: The limits that recorded motions show.
        others: Names of the limits that only precise motions show.
        nominal: Values of the varied keys of limits and margin that the problem has.
        robot: The robot of which those of the runs are variations.
        stricter: Whether ensembles begin with a stricter tolerance, as the undisturbed motion is
            cheaper then.
    """

    study: Study
    problem: Problem
    relative: bool
    start: Start
    limits: KnownLimits
    recorded: RecordedLimits
    others: tuple[str, ...]
    nominal: Mapping[str, float]
    robot: VariedRobot
    stricter: bool = False

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
            attitudes = np.tile(np.asarray(self.start.attitude), (len(places), 1))
        else:
            attitudes = attitudes[places]
        joints = self.start.joints
        if self.start.unvaried is not None:
            joints = self.start.unvaried.joints_at(attitudes, threads)
            known = np.isfinite(joints).all(axis=1)
            places, attitudes, joints = places[known], attitudes[known], joints[known]
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
            self.start.branch,
            joints,
            threads,
            limits=self.limits,
            stricter=self.stricter,
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
        self, disturbed: Equivalents, motions: ManyMotions, threads: int
    ) -> ManyMotions:
        """Motions with the limits that recorded ones show, of those that keep all else."""
        known = motions.limits
        values = LimitValues.empty(len(motions), len(self.recorded.names))
        keeping = ((known.ratios <= 1.0) & known.certain).all(axis=1)
        kept = np.flatnonzero(motions.feasible & keeping)
        for chosen in np.split(kept, range(_RECORDED, len(kept), _RECORDED)):
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
        decisive = known if self.start.is_best else slice(None)
        violated = (limits.certain & (limits.ratios > 1.0))[:, decisive].any(axis=1)
        certain = violated & limits.certain[:, known].all(axis=1)
        certain |= limits.certain.all(axis=1) & kept & (not self.others)
        return np.asarray(kept), np.asarray(motions.completed & certain)

    def are_decided(self, motions: ManyMotions) -> BoolArray:
        """Whether motions have a verdict; those of others need a precise motion, shape (K,)."""
        _, certain = self.keep_limits(motions)
        return np.asarray(motions.reached & ~motions.failed & (certain | ~motions.feasible))


def _begins_stricter(group: Group, number: int) -> bool:
    """Whether undisturbed motions with a run's robot are cheaper with a stricter tolerance."""
    start = group.start
    if start.attitude is None:
        return False
    values, attitude = group.study.variation.values(number, 1), start.attitude[None]
    robots, fits = group.robot.robots(values, np.array([number]))
    if not fits.all() or (robots is not None and not robots.suit(group.problem).all()):
        return False
    starts = starts_at(group.problem, attitude, start.branch, start.joints, robots)
    begun = starts.joints[starts.exist]
    every = np.zeros(len(begun), dtype=int)
    systems = Systems.of(group.problem)
    if robots is not None:  # else machine code for one robot is loaded, too
        systems = replace(systems, robots=robots[every])
    once, again = (
        EnsembleIntegrator(group.problem, 1)
        .integrate(attitude[every], begun, systems, stricter=stricter)
        .evaluations.sum()
        for stricter in (True, False)
    )
    return bool(once < again)


def group_of(study: Study, number: int) -> Group | None:
    """The group whose first run has a number; None where its runs are executed one by one."""
    return _grouped(study, number)[0]


def why_apart(study: Study, number: int) -> list[str]:
    """Why runs of the group whose first run has a number are executed one by one."""
    return _grouped(study, number)[1]


@lru_cache(maxsize=4)
def _grouped(study: Study, number: int) -> tuple[Group | None, list[str]]:
    """The group whose first run has a number, if any; why its runs are executed one by one."""
    reasons: list[str] = []
    try:
        return _group(study, number, reasons), reasons
    except FreeFloatError:  # which is the result of each run
        return None, reasons


def _group(study: Study, number: int, reasons: list[str]) -> Group | None:
    """The group whose first run has a number, if any; adds to the reasons why runs are apart."""
    parameters = study.parameters(number)
    listed = study.variation.listed
    own = {key: value for key, value in parameters.items() if not fits_ensembles(key, listed)}
    nominal = {key: value for key, value in parameters.items() if is_bound(key)}
    nominal = {key: value for key, value in nominal.items() if key not in own}
    own |= nominal
    own |= nominal_values(parameters, study.base)
    document = study.posed(with_values(study.base, own))
    scenario = scenario_from(document, study.base_source.absolute())
    problem = scenario.problem()
    if not problem.model.has_one_arm:
        reasons.append("several arms move")
        return None
    reasons += _unfit_values(study, scenario, problem, parameters)
    start = _start_of(study, problem, parameters, reasons)
    apart = bool(reasons)
    moved = vary_robots(study.content.vary, listed) or "timing.duration" in parameters
    limits, recorded, others = limits_of_runs(
        scenario, mounts=_mounts_vary(parameters), moved=moved
    )
    if others:
        shown = f"limits that only precise motions show ({', '.join(others)})"
        reasons.append(f"{shown} are checked along these where all else is kept")
    if apart:
        return None
    group = Group(
        study, problem, scenario.content.margin.fraction is not None, start, limits, recorded,
        others, nominal, _varied_robot(study, document, scenario),
    )  # fmt: skip
    return replace(group, stricter=_begins_stricter(group, number))


def _start_of(
    study: Study, problem: Problem, parameters: Mapping[str, Any], reasons: list[str]
) -> Start:
    """How runs begin; adds why ensembles cannot, to the reasons."""
    content = study.content
    branch = content.branch if isinstance(content.branch, int) else None
    unvaried = Unvaried.of(study) if content.branch is None else None
    if unvaried is not None and unvaried.problem.model.arm_dof != problem.model.arm_dof:
        reasons.append("the unvaried robot has another number of joints")
    elif any(key in parameters for key in START_KEYS):
        if content.branch is None and unvaried is None:
            reasons.append(
                "limits that only precise motions show choose the arm branch at each attitude, "
                "unless branch or search.joints does"
            )
        return Start(branch=branch, unvaried=unvaried)
    heading = None if content.heading_deg is None else np.radians(content.heading_deg)
    attitude = problem.attitude(content.attitude, heading=heading)
    if not problem.branches(attitude):
        reasons.append("the arm does not reach the start of the path")
    if reasons:
        return Start(attitude)
    joints = None
    if unvaried is not None:
        (joints,) = unvaried.joints_at(attitude[None], 1)
    if content.branch is None and (joints is None or not np.isfinite(joints).all()):
        choice = branch_choice(
            None, study.posed(study.base), problem, attitude, study.base_source.absolute()
        )
        branch, joints = choice.get("branch"), choice.get("joints")
    return Start(attitude, branch, joints)


def _unfit_values(
    study: Study, scenario: Scenario, problem: Problem, parameters: Mapping[str, Any]
) -> Iterator[str]:
    """Yield why the varied values of a scenario cannot differ in an ensemble."""
    content, relative = scenario.content, scenario.content.margin.fraction is not None
    timed = content.timing.stops or content.timing.speeds or problem.path.frame
    if "timing.duration" in parameters and timed:
        yield "timing.duration varies with stops, given speeds or a path on a moving body"
    if "margin.value" in parameters and relative:
        yield "margin.value varies beside margin.fraction"
    if relative and vary_robots(study.content.vary, study.variation.listed):
        yield "the robot varies, and with fraction_of: run the margin with it"
    frame = content.path.frame
    turned = _moves_with_robot(scenario) and frame is not PathFrame.SPACECRAFT
    if turned and _mounts_vary(parameters):
        yield f"the mount varies, and with it the {frame} frame of the path"
    if "heading_deg" in parameters and not problem.task.planar:
        yield "heading_deg varies, but the task is not planar"


def _mounts_vary(parameters: Mapping[str, Any]) -> bool:
    return any(key.startswith("robot.spacecraft.mount.") for key in parameters)


def _varied_robot(study: Study, document: dict[str, Any], scenario: Scenario) -> VariedRobot:
    """The robot of a group, and how that of a run is built, without a factor on all links."""

    def model_of(number: int) -> FreeFloatingModel:
        values = study.parameters(number).items()
        own = {key: value for key, value in values if key.split(".")[0] == "robot"}
        if not isinstance(own.get(SCALE_MASS, {}), dict):
            own[SCALE_MASS] = 1.0
        return scenario_from(with_values(document, own), study.base_source.absolute()).model()

    model, search, present = scenario.model(), scenario.search(), None
    if _moves_with_robot(scenario) and search.joints is not None:  # without, there is no path
        attitude = UPRIGHT if search.from_attitude is None else search.from_attitude
        present = attitude, model.joint_vector(search.joints)
    return VariedRobot(model, scenario.content.robot, model_of, present)


def _moves_with_robot(scenario: Scenario) -> bool:
    """Whether the path is stated in the frame of the spacecraft, of the base, or of a link."""
    return scenario.content.path.frame not in (PathFrame.INERTIAL, *scenario.scene().names)
