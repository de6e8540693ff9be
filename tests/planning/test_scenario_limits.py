"""Scenarios as a whole: what they plan, simulate and map, and the limits that problems carry."""

from typing import Any

import numpy as np
import pytest
import yaml

import freefloat as ff
from tests.errors import error_key

pytestmark = pytest.mark.usefixtures("folder")

LINE = "planar_2dof/line"
"""Has limits of joint rates."""
ROBOT = {"robot": {"urdf": "planar_2dof", "end_effector": "end_effector"}}
ATTITUDE = [0.0, 0.0, 0.0, 1.0]


@pytest.fixture
def line() -> ff.Problem:
    return ff.load_scenario(LINE).problem()


def scenario(**sections: Any) -> Any:
    return ff.load_scenario(yaml.safe_load(ff.load_scenario(LINE).text) | ROBOT | sections)


def names(results: Any) -> set[str]:
    return {result.limit for result in results}


@pytest.mark.slow
def test_a_scenario_plans_whatever_it_asks() -> None:
    assert scenario().plan().kind == "plan"
    rest = {"goal": {"joints": [0.2, -0.4], "duration": 30.0}}
    manoeuvre = scenario(phases=[rest]).plan()
    assert [phase.kind for phase in manoeuvre.phases] == ["path", "goal"]
    assert manoeuvre.path.limits.joint_rate is not None
    present = {"from_attitude": ATTITUDE, "joints": [0.6, 0.2]}
    goal = {"search": present, "goal": {"joints": [0.2, -0.4]}, "limits": {"joint_rate": 0.1}}
    moved = ff.load_scenario(ROBOT | goal).plan()
    assert (moved.kind, moved.feasible) == ("goal", True)
    assert error_key(scenario(phases=[rest]).plan, stretch=True) == "stretch"


def test_functions_use_the_limits_of_a_problem_unless_others_are_given(line: ff.Problem) -> None:
    motion = ff.simulate(line, ATTITUDE)
    assert "joint_rate" in names(motion.limit_results)
    assert "joint_rate" in names(ff.check_limits(motion.motion))
    other = ff.simulate(line, ATTITUDE, limits=ff.Limits(base_rate=1.0))
    assert names(other.limit_results) >= {"base_rate"}
    assert "joint_rate" not in names(other.limit_results)
    for none in (ff.simulate(line, ATTITUDE, limits=ff.Limits()),
                 ff.simulate(line.replace(limits=None), ATTITUDE)):  # fmt: skip
        assert "joint_rate" not in names(none.limit_results)
    assert error_key(line.replace, limits=0.2) == "limits"


@pytest.mark.slow
def test_plans_and_maps_use_the_limits_of_a_problem(line: ff.Problem) -> None:
    strict = line.replace(limits=ff.Limits(joint_rate=[1e-4, 1e-4]))
    assert ff.plan(line, limits=ff.Limits()).feasible
    assert not ff.plan(strict).feasible
    manoeuvre = ff.plan_manoeuvre(strict)
    assert (manoeuvre.feasible, manoeuvre.path.feasible) == (False, False)
    seen = ff.PointingLimit("spacecraft", [1, 0, 0], 0.01, direction=[0, 1, 0])
    away = line.replace(limits=ff.Limits(pointing=(seen,)))
    assert ff.attitude_map(away, 24).feasible_fraction < ff.attitude_map(line, 24).feasible_fraction


@pytest.mark.slow
def test_a_later_phase_sees_a_point_from_its_own_centre_of_mass() -> None:
    """With drift the frame of a later phase begins elsewhere."""
    point, drift = np.array([0.0, 0.0, 5.0]), np.array([0.01, -0.02, 0.0])
    cone = {"body": "spacecraft", "axis": [1, 0, 0], "target": {"point": point.tolist()},
            "keep": "outside", "angle_deg": 1}  # fmt: skip
    rest = {"goal": {"joints": [0.2, -0.4], "duration": 30.0}}
    loaded = scenario(limits={"pointing": [cone]}, drift=drift.tolist(), phases=[rest])
    first, second = (phase.motion.setting for phase in loaded.plan().phases)
    (before,), (after,) = first.limits.pointing, second.limits.pointing
    assert before.point == pytest.approx(point)
    assert after.point == pytest.approx(point - first.path.duration * drift)
