"""Plans within limits: what is chosen keeps them, what is refused says why."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from freefloat.io.scenario import load_scenario, parse_scenario
from freefloat.limits.check import LimitChecker, check_limits
from freefloat.limits.limits import LimitKind, Limits
from freefloat.motion.problem import Problem
from freefloat.planning.heading_map import evaluator_for
from freefloat.planning.limit_keeping import keep_limits
from freefloat.planning.plan import Objective, Plan, Search
from freefloat.planning.planner import plan
from freefloat.so3 import heading_quaternion

PLANAR = load_scenario("planar_3dof/parabola")
LINE = load_scenario("spatial_6dof/line")


@pytest.fixture(scope="module")
def planar() -> Problem:
    return PLANAR.problem()


@pytest.fixture(scope="module")
def headings(planar: Problem) -> Plan:
    """The plan that minds the margin alone."""
    return plan(planar, Search())


@pytest.fixture(scope="module")
def line() -> Problem:
    return LINE.problem()


@pytest.fixture(scope="module")
def attitudes(line: Problem) -> Plan:
    """The plan in space that minds the margin alone."""
    return plan(line, Search(samples=256))


def kept(problem: Problem, limits: Limits, search: Search) -> Plan:
    """Plan, and look at the chosen motion's limits again."""
    return looked_at(plan(problem, search, limits=limits), limits)


def looked_at(found: Plan, limits: Limits) -> Plan:
    """A plan that keeps what it says it keeps."""
    assert found.feasible, found.reason
    assert found.chosen is not None
    assert found.problem.margin.is_kept(found.chosen.closest_approach.value)
    again = check_limits(found.chosen.motion, limits)
    assert all(one.kept for one in again)
    assert [one.limit for one in again] == [one.limit for one in found.limit_results]
    return found


def test_a_limit_that_the_best_breaks_leads_to_another_that_keeps_it(attitudes: Plan) -> None:
    assert attitudes.chosen is not None
    wide = LimitChecker(attitudes.problem, Limits(joint_rate=np.ones(6)))
    (fastest,) = wide.results(attitudes.chosen.motion)
    limits = Limits(joint_rate=np.full(6, 0.9 * abs(fastest.worst)))
    found = looked_at(plan(attitudes.problem, attitudes.search, limits), limits)
    assert found.excluded[LimitKind.JOINT_RATE] > 0
    assert found.tolerance is not None


def test_what_collides_everywhere_is_refused_by_name(attitudes: Plan) -> None:
    """The path of Example 2 leads through its own spacecraft."""
    found = keep_limits(evaluator_for(attitudes.problem), attitudes, Limits(clearance=0.0))
    assert not found.feasible
    assert set(found.excluded) == {LimitKind.CLEARANCE}
    assert "at spacecraft - " in found.reason
    assert found.needed_stretch is None


@pytest.mark.parametrize(
    ("limits", "name"),
    [
        (Limits(joint_rate=np.full(3, 0.02)), "joint_rate"),
        (Limits(base_rate=0.002), "base_rate"),
        (Limits(joint_torque=np.full(3, 1e-3)), "joint_torque"),
    ],
)
def test_each_limit_alone_can_make_a_plan_infeasible(
    headings: Plan, limits: Limits, name: str
) -> None:
    found = keep_limits(evaluator_for(headings.problem), headings, limits)
    assert not found.feasible
    assert found.chosen is None
    assert name in found.reason
    assert set(found.excluded) == {LimitKind(name)}
    assert found.needed_stretch is not None
    assert f"{found.needed_stretch:.4g} times the duration would do" in found.reason


def test_joint_ranges_count_without_any_other_limit(planar: Problem, tmp_path: Path) -> None:
    text = planar.model.description.text.replace(
        'type="continuous">',
        'type="revolute"><limit lower="-0.01" upper="0.01" effort="1" velocity="1"/>',
    )
    (tmp_path / "narrow.urdf").write_text(text)
    scenario = parse_scenario(
        PLANAR.text.replace("planar_3dof.urdf", "narrow.urdf"), tmp_path / "s.yaml"
    )
    found = plan(scenario.problem(), Search(), limits=Limits())
    assert not found.feasible
    assert set(found.excluded) == {LimitKind.JOINT_RANGE}
    assert found.needed_stretch is None


def test_the_stretched_scenario_keeps_what_was_too_fast() -> None:
    limits = Limits(joint_rate=np.full(3, 0.05))
    calm = replace(PLANAR, content=PLANAR.content.model_copy(update={"momentum": (0.0, 0.0, 0.0)}))
    problem = calm.problem()
    found = plan(problem, Search(), limits=limits)
    assert found.needed_stretch is not None
    slower = problem.stretched(1.00001 * found.needed_stretch)
    timing = slower.path.timing
    assert timing.duration == pytest.approx(100.0 * 1.00001 * found.needed_stretch)
    assert timing.stops[0].t == pytest.approx(69.73 * 1.00001 * found.needed_stretch)
    kept(slower, limits, Search())


def test_the_duration_told_is_enough_where_only_a_few_headings_keep_the_rates() -> None:
    """Then a heading next to one that just breaks them is the answer."""
    line = load_scenario("planar_2dof/line")
    limits = Limits(joint_rate=np.full(2, 0.001))
    found = plan(line.problem(), Search(), limits=limits)
    assert found.needed_stretch is not None
    for factor in (1.00001, 1.001):
        kept(line.problem().stretched(factor * found.needed_stretch), limits, Search())


def test_the_nearest_is_drawn_toward_the_present_attitude(planar: Problem) -> None:
    """From 40 degrees the spacecraft turns at up to 0.114 rad/s, from smaller headings slower."""
    search = Search(Objective.NEAREST, from_attitude=heading_quaternion(np.deg2rad(40.0)))
    limits = Limits(base_rate=0.08)
    found = kept(planar, limits, search)
    assert found.chosen is not None
    base = check_limits(found.chosen.motion, limits)[-1]
    assert base.ratio > 0.98  # on the limit: nearer would break it
    assert found.deviation is not None
    assert np.degrees(found.deviation) == pytest.approx(19.6, abs=1.5)
