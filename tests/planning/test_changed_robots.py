"""The same task by another robot: mount, masses, payload and joints change the plan."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import yaml

from freefloat.io.scenario import Scenario, parse_scenario
from freefloat.limits.check import check_limits
from freefloat.planning.heading_map import evaluator_for
from freefloat.planning.limit_keeping import keep_limits
from freefloat.planning.plan import Plan
from freefloat.planning.planner import plan_in_space
from freefloat.robot.names import models_folder

pytestmark = pytest.mark.usefixtures("kernels")


def changed(name: str, samples: int, **robot: Any) -> Scenario:
    """A bundled scenario, searched with fewer samples, with other keys under ``robot``."""
    file = models_folder() / f"{name}.yaml"
    content = yaml.safe_load(file.read_text())
    content["search"]["samples"] = samples
    content["robot"].update(robot)
    return parse_scenario(yaml.safe_dump(content), file)


def planned(scenario: Scenario, stretch: float = 1.0) -> Plan:
    """The plan, but for what it bears of other attitudes, momenta and durations."""
    limits = scenario.limits()
    assert limits is not None
    evaluator = evaluator_for(scenario.problem().stretched(stretch))
    return keep_limits(evaluator, plan_in_space(evaluator, scenario.search()), limits)


SPACECRAFT = {"mass": 200, "inertia": [35, 35, 35], "size": [1, 1, 1]}
SAMPLES = 32
USUAL: dict[str, Plan] = {}


def usual(name: str) -> Plan:
    """The plan for the robot as it is."""
    if name not in USUAL:
        USUAL[name] = planned(changed(name, SAMPLES))
    return USUAL[name]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "robot", "mass"),
    [
        ("ur5_servicer/inspect",
         {"spacecraft": {**SPACECRAFT, "mount": {"xyz": [0.5, 0.3, 0.2], "rpy": [0.0, 1.2, 0.0]}}},
         0.0),
        ("ur5_servicer/inspect", {"scale_mass": {"forearm_link": 2.0}}, 2.275),
        ("ets_vii/line", {"payload": {"mass": 50, "inertia": [2, 2, 2], "com": [0.2, 0, 0]}}, 50.0),
    ],
    ids=["another mount", "a mass doubled", "a payload of 50 kg"],
)  # fmt: skip
def test_another_robot_gets_another_plan_that_holds(
    name: str, robot: dict[str, Any], mass: float
) -> None:
    """Its motion is another one, drifts right, follows the path and keeps margin and limits."""
    scenario, before = changed(name, SAMPLES, **robot), usual(name)
    found = planned(scenario)
    if found.needed_stretch is not None:  # a heavy hand turns the spacecraft faster than it may
        found = planned(scenario, 1.01 * found.needed_stretch)
    assert found.feasible, found.reason
    assert found.chosen is not None
    assert before.chosen is not None
    motion = found.chosen.motion
    grown = motion.problem.model.total_mass - before.problem.model.total_mass
    assert np.isclose(grown, mass, rtol=0, atol=1e-9)
    assert (
        abs(found.chosen.closest_approach.value / before.chosen.closest_approach.value - 1.0) > 1e-3
    )
    residuals = motion.residuals()
    assert residuals.end_effector_position < 1e-7
    assert residuals.momentum < 1e-6
    assert found.problem.margin.is_kept(found.chosen.closest_approach.value)
    limits = scenario.limits()
    assert limits is not None
    findings = check_limits(motion, limits)
    assert len(findings) == 5
    assert all(one.kept for one in findings)
    wrench = findings[-1].base_wrench
    assert wrench is not None
    assert wrench < 1e-6


def test_seven_joints_do_what_six_of_them_cannot() -> None:
    """With its elbow stuck the arm cannot change how far its hand is from its shoulder."""
    stuck = planned(changed("panda_servicer/line", 64, held={"panda_joint4": -1.0}))
    assert stuck.problem.model.dof == 6
    assert not stuck.feasible
    assert stuck.chosen is None
    whole = planned(changed("panda_servicer/line", 16))
    assert whole.problem.model.dof == 7
    assert whole.feasible
    assert all(one.kept for one in whole.limit_results)
