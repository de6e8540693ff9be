"""Groups of runs that one ensemble integrates: those that differ in disturbances alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from freefloat.ensemble.disturbed_motions import (
    integrate_disturbed,
)
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.ensemble.equivalence import equivalents
from freefloat.ensemble.many_motions import ManyMotions
from freefloat.ensemble.starts import starts_at
from freefloat.ensemble.systems import Systems
from freefloat.errors import FreeFloatError
from freefloat.io.scenario.path_schema import PathFrame
from freefloat.io.scenario.scenario import Scenario
from freefloat.motion.problem import Problem
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import UPRIGHT, Array, BoolArray, IntArray
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
from freefloat.studies.unvaried import (
    Unvaried,
    has_ranges_and_limits,
    keeps_ranges,
    leaves_ranges,
    range_ratios,
)


@dataclass(frozen=True, eq=False)
class Group:
    """Runs of a study that differ in disturbances alone.

    Attributes:
        study: The study.
        problem: What the runs have in common.
        relative: Whether the margin is a fraction of the measure's largest value.
        attitude: Initial attitude, shape (4,); None where it varies.
        branch: Number of the arm branch; None for that near ``joints``, or the best of each run.
        joints: Joint values near those of the arm branch, shape (n,).
        unvaried: The base scenario, if the arm branch is that of its motion from each attitude.
        ranges: Whether joints have ranges.
        limited: Whether anything else is limited, which only precise motions show.
        stricter: Whether ensembles begin with a stricter tolerance, as the undisturbed motion is
            cheaper then.
        robot: The robot of which those of the runs are variations.
    """

    study: Study
    problem: Problem
    relative: bool
    attitude: Array | None
    branch: int | None
    joints: Array | None
    unvaried: Unvaried | None
    ranges: bool
    limited: bool
    stricter: bool
    robot: VariedRobot

    def integrate(self, numbers: IntArray, threads: int) -> tuple[IntArray, ManyMotions]:
        """Integrate runs; return the numbers of those whose values fit, and their motions."""
        first = int(numbers[0])
        count = int(numbers[-1]) + 1 - first
        values = self.study.variation.values(first, count)
        arrays, fits = arrays_of(values, self.problem, count)
        attitudes = arrays.pop("attitudes", None)
        thresholds = arrays.pop("thresholds", None)
        robots, accepted = self.robot.robots(values, np.arange(first, first + count))
        fits &= accepted
        if robots is not None:
            fits &= robots.suit(self.problem)
        disturbed = equivalents(self.problem, count, **arrays, robots=robots)
        places = numbers - first
        places = places[(fits & ~disturbed.turns_too_often)[places]]
        if attitudes is None:
            attitudes = np.tile(np.asarray(self.attitude), (len(places), 1))
        else:
            attitudes = attitudes[places]
        joints = self.joints
        if self.unvaried is not None:
            joints = self.unvaried.joints_at(attitudes, threads)
            known = np.isfinite(joints).all(axis=1)
            places, attitudes, joints = places[known], attitudes[known], joints[known]
        disturbed = disturbed[places]
        if thresholds is None:
            required = np.full(len(places), self.problem.margin.threshold)
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
            ranges=self.ranges and not self.limited,
            stricter=self.stricter,
        )
        return places + first, motions

    def are_feasible(self, motions: ManyMotions) -> BoolArray:
        """Whether motions keep the margin and, at the steps, joint ranges, shape (K,)."""
        kept = range_ratios(self.problem, motions) <= 1.0 if self.ranges else True
        return np.asarray(motions.feasible & kept)

    def are_decided(self, motions: ManyMotions) -> BoolArray:
        """Whether motions have a verdict; those of others need a precise motion, shape (K,)."""
        decided = motions.reached & ~motions.failed
        if self.limited:
            return np.asarray(decided & ~motions.feasible)
        if self.ranges:
            decided &= (
                keeps_ranges(self.problem, motions)
                | leaves_ranges(self.problem, motions)
                | ~motions.feasible
            )
        return np.asarray(decided)


def _begins_stricter(group: Group, number: int) -> bool:
    """Whether undisturbed motions with a run's robot are cheaper with a stricter tolerance."""
    if group.attitude is None:
        return False
    values, attitude = group.study.variation.values(number, 1), group.attitude[None]
    robots, fits = group.robot.robots(values, np.array([number]))
    if not fits.all() or (robots is not None and not robots.suit(group.problem).all()):
        return False
    starts = starts_at(group.problem, attitude, group.branch, group.joints, robots)
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


class _UnfitError(Exception):
    """Runs are none of an ensemble; its argument is why."""


def group_of(study: Study, number: int) -> Group | None:
    """The group whose first run has a number; None where its runs are executed one by one."""
    return _grouped(study, number)[0]


def why_apart(study: Study, number: int) -> str | None:
    """Why runs of the group whose first run has a number are executed one by one; None else."""
    group, reason = _grouped(study, number)
    limited = group is not None and group.limited
    return (
        "limits are checked along precise motions where the margin is kept" if limited else reason
    )


@lru_cache(maxsize=4)
def _grouped(study: Study, number: int) -> tuple[Group | None, str | None]:
    """The group whose first run has a number, or why there is none."""
    try:
        return _group(study, number), None
    except _UnfitError as unfit:
        return None, str(unfit)
    except FreeFloatError:  # which is the result of each run
        return None, None


def _group(study: Study, number: int) -> Group:
    content, parameters = study.content, study.parameters(number)
    own = {key: value for key, value in parameters.items() if not fits_ensembles(key)}
    own |= nominal_values(parameters, study.base)
    document = study.posed(with_values(study.base, own))
    scenario = scenario_from(document, study.base_source.absolute())
    problem = scenario.problem()
    _require_fit(study, scenario, problem, parameters)
    ranges, limited = has_ranges_and_limits(scenario)
    attitude = joints = None
    branch = content.branch if isinstance(content.branch, int) else None
    unvaried = Unvaried.of(study) if content.branch is None else None
    if unvaried is not None and unvaried.problem.model.arm_dof != problem.model.arm_dof:
        raise _UnfitError("the unvaried robot has another number of joints")
    if not any(key in parameters for key in START_KEYS):
        heading = None if content.heading_deg is None else np.radians(content.heading_deg)
        attitude = problem.attitude(content.attitude, heading=heading)
        if not problem.branches(attitude):
            raise _UnfitError("the arm does not reach the start of the path")
        if unvaried is not None:
            (joints,), unvaried = unvaried.joints_at(attitude[None], 1), None
        if content.branch is None and (joints is None or not np.isfinite(joints).all()):
            choice = branch_choice(
                None, study.posed(study.base), problem, attitude, study.base_source.absolute()
            )
            branch, joints = choice.get("branch"), choice.get("joints")
    elif content.branch is None and unvaried is None:
        raise _UnfitError(
            "limits choose the arm branch at each attitude, unless branch or search.joints does"
        )
    group = Group(
        study, problem, scenario.content.margin.fraction is not None, attitude, branch, joints,
        unvaried, ranges, limited, False, _varied_robot(study, document, scenario),
    )  # fmt: skip
    return replace(group, stricter=_begins_stricter(group, number))


def _require_fit(
    study: Study, scenario: Scenario, problem: Problem, parameters: Mapping[str, Any]
) -> None:
    """Raise an _UnfitError unless the varied values of a scenario can differ in an ensemble."""
    timing, relative = scenario.content.timing, scenario.content.margin.fraction is not None
    if not problem.model.has_one_arm:
        raise _UnfitError("several arms move")
    if "timing.duration" in parameters and (timing.stops or timing.speeds or problem.path.frame):
        raise _UnfitError(
            "timing.duration varies with stops, given speeds or a path on a moving body"
        )
    if "margin.value" in parameters and relative:
        raise _UnfitError("margin.value varies beside margin.fraction")
    if vary_robots(study.content.vary, study.variation.listed):  # of which these are others
        if relative:
            raise _UnfitError("the robot varies, and with fraction_of: run the margin with it")
        frame, mounts = scenario.content.path.frame, any(".mount." in key for key in parameters)
        if mounts and _moves_with_robot(scenario) and frame is not PathFrame.SPACECRAFT:
            raise _UnfitError(f"the mount varies, and with it the {frame} frame of the path")
    if "heading_deg" in parameters and not problem.task.planar:
        raise _UnfitError("heading_deg varies, but the task is not planar")


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
