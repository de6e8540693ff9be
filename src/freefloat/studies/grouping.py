"""Which runs of a study form a group, and why others are executed one by one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import Any

from freefloat.errors import FreeFloatError
from freefloat.io.scenario.path_schema import FrameName
from freefloat.io.scenario.scenario import Scenario
from freefloat.motion.problem import Problem
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import UPRIGHT
from freefloat.studies.disturbances import fits_ensembles, is_bound
from freefloat.studies.groups import Group, limits_of_runs
from freefloat.studies.study import Study, initial_attitude
from freefloat.studies.study_file import START_KEYS
from freefloat.studies.variation import with_values
from freefloat.studies.varied_robots import (
    SCALE_MASS,
    VariedRobot,
    nominal_values,
    vary_robots,
)


def group_of(study: Study, number: int) -> Group | None:
    """The group whose first run has a number; None where its runs are executed one by one."""
    return grouped(study, number)[0]


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
    own = {key: value for key, value in parameters.items() if not fits_ensembles(key, listed)}
    nominal = {key: value for key, value in parameters.items() if is_bound(key) and key not in own}
    own |= nominal | nominal_values(parameters, study.base)
    document = with_values(study.base, own)
    scenario = study.scenario_of(document)
    problem = scenario.problem()
    if not problem.model.has_one_arm:
        reasons.append("several arms move")
        return None
    apart = list(_unfit_values(study, scenario, problem, parameters))
    moved = vary_robots(study.content.vary, listed) or "timing.duration" in parameters
    limits, recorded, others = limits_of_runs(
        scenario, mounts=_mounts_vary(parameters), moved=moved
    )
    if others:
        shown = f"limits that only precise motions show ({', '.join(others)})"
        reasons.append(f"{shown} are checked along these where all else is kept")
    reasons[:0] = apart
    if apart:
        return None
    start, attitude, joints = study.arm_start, None, None
    if start.joints is not None and study.start_problem.model.arm_dof != problem.model.arm_dof:
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
    if "heading_deg" in parameters and not problem.has_headings:
        yield "heading_deg varies, but the spacecraft does not turn in a plane"


def _mounts_vary(parameters: Mapping[str, Any]) -> bool:
    return any(key.startswith("robot.spacecraft.mount.") for key in parameters)


def _varied_robot(study: Study, document: dict[str, Any], scenario: Scenario) -> VariedRobot:
    """The robot of a group, and how that of a run is built, without a factor on all links."""

    def model_of(number: int) -> FreeFloatingModel:
        values = study.parameters(number).items()
        own = {key: value for key, value in values if key.split(".")[0] == "robot"}
        if not isinstance(own.get(SCALE_MASS, {}), dict):
            own[SCALE_MASS] = 1.0
        return study.scenario_of(with_values(document, own)).model()

    model, search, present = scenario.model(), scenario.search(), None
    if _moves_with_robot(scenario) and search.joints is not None:  # without, there is no path
        attitude = UPRIGHT if search.from_attitude is None else search.from_attitude
        present = attitude, model.joint_vector(search.joints)
    return VariedRobot(model, scenario.content.robot, model_of, present)


def _moves_with_robot(scenario: Scenario) -> bool:
    """Whether the path is stated in the frame of the spacecraft, of the base, or of a link."""
    return scenario.content.path.frame not in (FrameName.INERTIAL, *scenario.scene().names)
