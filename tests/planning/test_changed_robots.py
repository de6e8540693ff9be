"""The same task with another robot: mount, masses, payload and joints change the plan."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import yaml

import freefloat as ff
from freefloat.io.scenario.scenario import Scenario, parse_scenario
from freefloat.planning.evaluator import evaluator_for
from freefloat.planning.limits.keeping import keep_limits
from freefloat.planning.plan import Plan
from freefloat.planning.space import climbing as search
from freefloat.planning.spatial_planner import plan_in_space
from freefloat.robot.names import models_folder

pytestmark = [pytest.mark.usefixtures("kernels"), pytest.mark.slow]

SPACECRAFT = {"mass": 200, "inertia": [35, 35, 35], "size": [1, 1, 1]}
SAMPLES = 32


@pytest.fixture(autouse=True, scope="module")
def fewer() -> Iterator[None]:
    """Fewer samples from which margins are refined."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search, "_CLIMBS", 4)
        patch.setattr(search, "_FINISHED", 1)
        yield


def changed(name: str, samples: int = SAMPLES, **robot: Any) -> Scenario:
    """A bundled scenario with fewer samples and other keys of ``robot``."""
    file = models_folder() / f"{name}.yaml"
    content = yaml.safe_load(file.read_text())
    content["search"]["samples"] = samples
    content["robot"].update(robot)
    return parse_scenario(yaml.safe_dump(content), file)


def planned(scenario: Scenario, stretch: float = 1.0) -> Plan:
    """The plan without its tolerances and certificate."""
    limits = scenario.limits()
    assert limits is not None
    evaluator = evaluator_for(scenario.problem().stretched(stretch))
    return keep_limits(evaluator, plan_in_space(evaluator, scenario.search()), limits)


@pytest.mark.parametrize(
    ("name", "robot", "mass"),
    [
        ("ur5_servicer/inspect",
         {"spacecraft": {**SPACECRAFT, "mount": {"xyz": [0.5, 0.3, 0.2], "rpy": [0.0, 1.2, 0.0]}}},
         0.0),
        ("ets_vii/line", {"payload": {"mass": 50, "inertia": [2, 2, 2], "com": [0.2, 0, 0]}}, 50.0),
    ],
    ids=["another mount", "a payload of 50 kg"],
)  # fmt: skip
def test_another_robot_has_another_feasible_plan(
    name: str, robot: dict[str, Any], mass: float
) -> None:
    """Its motion follows the path and keeps momentum, margin and limits."""
    scenario, usual = changed(name, **robot), changed(name).problem()
    result = planned(scenario)
    if result.needed_stretch is not None:  # a heavy payload rotates the spacecraft too fast
        result = planned(scenario, 1.01 * result.needed_stretch)
    assert result.feasible, result.reason
    assert result.chosen is not None
    motion = result.chosen.motion
    added = motion.problem.model.total_mass - usual.model.total_mass
    assert np.isclose(added, mass, rtol=0, atol=1e-9)
    q = motion.initial.joints
    assert abs(result.problem.margin.measure(q) / usual.margin.measure(q) - 1.0) > 1e-3
    residuals = motion.residuals()
    assert residuals.end_effector_position < 1e-7
    assert residuals.momentum < 1e-6
    assert result.problem.margin.keeps(result.chosen.closest_approach.value)
    limits = scenario.limits()
    assert limits is not None
    results = ff.check_limits(motion, limits)
    assert len(results) == 5
    assert all(entry.kept for entry in results)
    assert results[-1].base_wrench is not None
    assert results[-1].base_wrench < 1e-6


def test_with_a_fixed_elbow_no_plan_is_feasible() -> None:
    """The arm then cannot change the distance of its end-effector from its shoulder.

    With seven joints there is a plan, see ``tests/robot/test_bundled_models.py``.
    """
    fixed = planned(changed("panda_servicer/line", held={"panda_joint4": -1.0}))
    assert fixed.problem.model.dof == 6
    assert not fixed.feasible
    assert fixed.chosen is None
