"""Groups of runs that one ensemble integrates, as they differ in disturbances alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from freefloat.ensemble.disturbed_verdicts import ManyMotions, integrate_disturbed
from freefloat.ensemble.known_limits import KNOWN, KnownLimits, LimitValues
from freefloat.ensemble.systems import ScaledMotions, equivalents
from freefloat.errors import FreeFloatError
from freefloat.io.scenario.path_schema import FrameName
from freefloat.io.scenario.scenario import Scenario
from freefloat.limits.kinds.end_effector import CorridorLimit
from freefloat.limits.limits import GIVEN
from freefloat.limits.recorded_limits import RecordedLimits
from freefloat.motion.pointing import AttitudeLimits
from freefloat.motion.problem import Problem
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import UPRIGHT, Array, BoolArray, IntArray
from freefloat.studies import disturbances
from freefloat.studies.study import Study
from freefloat.studies.study_file import START_KEYS, initial_attitude
from freefloat.studies.variation import with_values
from freefloat.studies.varied_robots import SCALE_MASS, VariedRobot, nominal_values, vary_robots

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
        branch: Number of the arm branch; None for the branch near joints, or the best of each run.
        joints: Joint values near the joints of the arm branch, shape (n,); None where the
            attitude varies, or without them.
        limits: The limits that ensembles know.
        recorded: The limits that recorded motions show.
        others: Names of the limits that only precise motions show.
        nominal: Values of the varied keys of limits and margin that the problem has.
        robot: The robot of which the robots of the runs are variations.
        line: The path, if its ends vary.
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
    line: disturbances.Line | None

    @property
    def starts_at_best(self) -> bool:
        """Whether the arm branch is the best of each run."""
        return self.branch is None and self.study.arm_start.joints is None

    def integrate(self, numbers: IntArray, threads: int) -> tuple[IntArray, ManyMotions]:
        """Integrate runs; return the numbers of the runs whose values fit, and their motions."""
        first = int(numbers[0])
        drawn = self.study.variation.values(first, int(numbers[-1]) + 1 - first)
        values = disturbances.selected(drawn, numbers - first)
        arrays, fits = disturbances.arrays_of(values, self.problem, len(numbers))
        ratios, accepted = disturbances.bound_ratios(values, self.nominal, len(numbers))
        if self.line is not None:
            arrays["offsets"] = self.line.offsets(values, len(numbers))
            fits &= disturbances.are_lines(arrays["offsets"], self.problem)
        chosen = np.flatnonzero(fits & accepted & self.robot.accepts(values, len(numbers)))
        numbers, values = numbers[chosen], disturbances.selected(values, chosen)
        arrays = {name: array[chosen] for name, array in arrays.items()}
        ratios = {key: ratio[chosen] for key, ratio in ratios.items()}
        attitudes, thresholds = arrays.pop("attitudes", None), arrays.pop("thresholds", None)
        fractions = 1.0 / ratios.pop(disturbances.FRACTION, np.ones(len(numbers)))
        robots = self.robot.robots(values, numbers)
        limits = dict(zip(self.limit_names, self.limit_places, strict=True))
        for limit in self.recorded.along:  # their bounds are the same in all runs
            limits.pop(limit.name)
        scales = disturbances.limit_scales(ratios, limits, self.limits.attitude.pointing)
        disturbed = equivalents(self.problem, len(numbers), **arrays, robots=robots, scales=scales)
        if attitudes is None:
            attitudes = np.tile(np.asarray(self.attitude), (len(numbers), 1))
        if thresholds is None:
            thresholds = self.problem.margin.threshold * fractions
            thresholds *= disturbed.magnifications if self.relative else 1.0
        suited = ~disturbed.turns_too_often
        suited &= True if robots is None else robots.suit(self.problem)
        disturbed, numbers = disturbed[suited], numbers[suited]
        attitudes, thresholds = attitudes[suited], thresholds[suited]
        joints = self.joints
        if joints is None and self.study.arm_start.joints is not None:
            joints = self.study.joints_near(attitudes)
        motions = integrate_disturbed(
            disturbed, attitudes, thresholds, self.branch, joints, threads, limits=self.limits
        )
        if self.recorded.names:
            motions = self._with_recorded(disturbed, motions, threads)
        return numbers, motions

    @property
    def limit_names(self) -> tuple[str, ...]:
        """Names of the limits of which motions of the group have ratios."""
        return self.limits.names + self.recorded.names

    @property
    def limit_places(self) -> tuple[tuple[str, ...], ...]:
        """Joints, or other names, of the quantities of each limit of :attr:`limit_names`."""
        return self.limits.places + self.recorded.places

    def _with_recorded(
        self, disturbed: ScaledMotions, motions: ManyMotions, threads: int
    ) -> ManyMotions:
        """Motions with the limits that recorded motions show, for motions that keep all else."""
        known = motions.limits
        values = LimitValues.empty(len(motions), len(self.recorded.names))
        keeping = ((known.ratios <= 1.0) & known.certain).all(axis=1)
        kept = np.flatnonzero(motions.feasible & keeping)
        parts = range(_RECORDED_TOGETHER, len(kept), _RECORDED_TOGETHER)
        for chosen in np.split(kept, parts) if len(kept) else ():
            recorded = self.recorded.values(
                disturbed[chosen], motions.attitudes[chosen], motions.joints[chosen], threads
            )
            for array, part in zip(values, recorded, strict=True):
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
        """Whether motions have a verdict; verdicts of others need a precise motion, shape (K,)."""
        _, certain = self.keep_limits(motions)
        return np.asarray(motions.reached & ~motions.failed & (certain | ~motions.feasible))


@lru_cache(maxsize=4)
def grouped(study: Study, number: int) -> tuple[Group | None, list[str]]:
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
    fits = {key for key in parameters if disturbances.fits_ensembles(key, listed)}
    own = {k: v for k, v in parameters.items() if disturbances.is_bound(k) or k not in fits}
    nominal = {key: value for key, value in own.items() if key in fits}
    own |= nominal_values(parameters, study.base)
    document = with_values(study.base, own)
    scenario = study.scenario_of(document)
    problem = scenario.problem()
    if not problem.model.has_one_arm:
        reasons.append("several arms move")
        return None
    apart = list(_unfit_values(study, scenario, problem, parameters))
    moved = vary_robots(study.content.vary, listed) or "timing.duration" in parameters
    limits, recorded, others = _limits_of_runs(
        scenario, mounts=_mounts_vary(parameters), moved=moved
    )
    if others:
        shown = f"limits that only precise motions show ({', '.join(others)})"
        reasons.append(f"they keep all else and have {shown}")
    reasons[:0] = apart
    if apart:
        return None
    start, attitude, joints = study.arm_start, None, None
    if start.joints is not None and study.start_problem.dof != problem.dof:
        reasons.append("the unvaried robot has another number of joints")
        return None
    if not any(key in parameters for key in START_KEYS):
        attitude = initial_attitude(problem, study.initial_attitude(number))
        if not problem.branches(attitude):
            reasons.append("the arm does not reach the start of the path")
            return None
        if start.joints is not None:
            (joints,) = study.joints_near(attitude[None])
    return Group(
        study, problem, scenario.content.margin.fraction is not None, attitude,
        start.branch if isinstance(start.branch, int) else None, joints, limits, recorded, others,
        nominal, _varied_robot(study, document, scenario),
        disturbances.line_of(scenario, parameters),
    )  # fmt: skip


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
    turned = _moves_with_robot(scenario) and frame is not FrameName.SPACECRAFT
    if turned and _mounts_vary(parameters):
        yield f"the mount varies, and with it the {frame} frame of the path"
    attitude = content.path.attitude
    if disturbances.lines_vary(parameters):
        if frame not in (FrameName.INERTIAL, FrameName.SPACECRAFT):
            yield f"the path varies in the frame {frame}"
        elif attitude is not None and (attitude.follow or attitude.point_at):
            yield "the path varies, and with it the orientation of the end-effector"
    if "heading_deg" in parameters and not problem.has_headings:
        yield "heading_deg varies, but the spacecraft does not turn in a plane"


def _mounts_vary(parameters: Mapping[str, Any]) -> bool:
    return any(key.startswith("robot.spacecraft.mount.") for key in parameters)


def _varied_robot(study: Study, document: dict[str, Any], scenario: Scenario) -> VariedRobot:
    """The robot of a group, and how the robot of a run is built, without a factor on all links."""

    def model_of(number: int) -> FreeFloatingModel:
        values = study.parameters(number).items()
        robot_values = {key: value for key, value in values if key.split(".")[0] == "robot"}
        if not isinstance(robot_values.get(SCALE_MASS, {}), dict):
            robot_values[SCALE_MASS] = 1.0
        return study.scenario_of(with_values(document, robot_values)).model()

    model, search, present = scenario.model(), scenario.search(), None
    if _moves_with_robot(scenario) and search.joints is not None:  # without, there is no path
        attitude = UPRIGHT if search.from_attitude is None else search.from_attitude
        present = attitude, model.joint_vector(search.joints)
    return VariedRobot(model, scenario.content.robot, model_of, present)


def _moves_with_robot(scenario: Scenario) -> bool:
    """Whether the path is stated in the frame of the spacecraft, of the base, or of a link."""
    return scenario.content.path.frame not in (FrameName.INERTIAL, *scenario.scene().names)


def _limits_of_runs(
    scenario: Scenario, *, mounts: bool, moved: bool
) -> tuple[KnownLimits, RecordedLimits, tuple[str, ...]]:
    """The limits that ensembles know, those that recorded motions show, and names of the others.

    Args:
        scenario: The scenario.
        mounts: Whether mounts vary, so that axes and bodies of the arm's first link do.
        moved: Whether durations or robots vary, so that the bodies of a scene are elsewhere.
    """
    limits, problem = scenario.limits(), scenario.problem()
    bounds = {kind.name: getattr(limits, kind.name) for kind in GIVEN}
    numbers = {name: b for name, b in bounds.items() if b is not None and not isinstance(b, str)}
    names = {name for name, bound in numbers.items() if np.size(bound) > 0}
    if problem.scene.corridor is not None:
        names.add(CorridorLimit.name)
    recorded = (
        RecordedLimits(problem) if mounts else RecordedLimits.of(problem, limits, moved=moved)
    )
    attitude = AttitudeLimits(
        pointing=() if mounts else limits.pointing, base_turn=limits.base_turn
    )
    known = KnownLimits(problem.model, limits.joint_rate, limits.base_rate, attitude)
    seen = {*KNOWN, *recorded.names} - ({"pointing"} if mounts else set())
    return known, recorded, tuple(sorted(names - seen))
