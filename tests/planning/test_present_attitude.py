"""The attitude that the spacecraft has, and thin feasible sets, are never missed by a plan.

Witnesses are simulated motions; limits are closed down to just outside them.
"""

from dataclasses import replace

import numpy as np
import pytest
import yaml

import freefloat as ff
from freefloat.motion.extrema import joint_extents
from freefloat.motion.motion import Motion
from freefloat.paths.curves import PolynomialCurve
from freefloat.planning.plan import Plan
from freefloat.so3 import angle_between, heading_quaternion
from tests.motions import SEVEN, Z, bundled, chain, from_here
from tests.plans import IDENTITY

DECK_ARM = chain(
    ("continuous", Z, (0.2, 0.0, 0.06), 1.2, (0.15, 0.0, 0.0), (0.004, 0.01, 0.01)),
    ("continuous", Z, (0.3, 0.0, 0.0), 1.1, (0.15, 0.0, 0.0), (0.004, 0.01, 0.01)),
    ("continuous", Z, (0.3, 0.0, 0.0), 0.9, (0.1, 0.0, 0.0), (0.004, 0.006, 0.006)),
    base=(50.0, 2.0, 0.01),
    tool=(0.2, 0.0, 0.0),
)
"""Its joints turn about z, 0.06 m above the spacecraft's centre of mass."""


pytestmark = [pytest.mark.usefixtures("smaller"), pytest.mark.slow]


def deck_problem() -> ff.Problem:
    """A line of the deck arm, whose start it reaches from turns about two axes alone."""
    model = ff.FreeFloatingModel.from_urdf(DECK_ARM, "tool")
    start = np.array([0.4912300103105926, 0.5515122660565797, 0.05639097744360902])
    line = PolynomialCurve.line(start, start + np.array([-0.05, 0.05, 0.0]))
    path = ff.TimedPath(ff.EndEffectorPath(line), ff.Timing(40.0))
    measure = ff.singularity_measure(model, ff.Task.POSITION, "gjm")
    return ff.Problem(model, path, ff.Task.POSITION, np.zeros(3), ff.Margin(measure, 3.8e-7))


def require_kept(plan: Plan) -> None:
    assert plan.feasible
    assert all(result.kept for result in plan.limit_results)


def worst(motion: Motion, limits: ff.Limits, name: str) -> float:
    return next(r.worst for r in ff.check_limits(motion, limits) if r.limit == name)


def cone(problem: ff.Problem, motion: Motion, axis: np.ndarray, spare: float) -> ff.Limits:
    """A cone, midway between the ends of an axis of the spacecraft, just wider than it moves."""
    body = next(name for name, (number, _) in problem.model.link_places.items() if not number)
    ends = motion.initial.attitude, motion.final.attitude
    direction = sum(ff.rotations.rotation_matrix(attitude) @ axis for attitude in ends)

    def limits(angle: float) -> ff.Limits:
        return ff.Limits(pointing=(ff.PointingLimit(body, axis, angle, direction=direction),))

    return limits(worst(motion, limits(3.0), "pointing") * spare)


def with_ranges(text: str, motion: Motion, spare: float) -> str:
    """A robot whose joint ranges are just wider than a motion."""
    extents = joint_extents(motion)
    for number, (low, high) in enumerate(zip(extents.low, extents.high, strict=True)):
        limit = f'<limit lower="{low - spare}" upper="{high + spare}" effort="9" velocity="9"/>'
        head, tail = text.split(f'name="q{number + 1}" type="continuous"')
        tail = tail.replace("</joint>", f"{limit}</joint>", 1)
        text = f'{head}name="q{number + 1}" type="revolute"{tail}'
    return text


@pytest.mark.parametrize("objective", ["nearest", "robust", "margin"])
def test_feasible_sets_without_volume_contain_the_present_attitude(objective: str) -> None:
    """No sample reaches the start; the present attitude follows the path, and check agrees."""
    plan = ff.plan(deck_problem(), ff.Search(objective, IDENTITY, 64))
    assert plan.map.feasible_fraction == 0.0
    require_kept(plan)
    if objective == "nearest":
        assert plan.deviation == 0.0
        assert ff.check(plan).passed


def test_feasible_sets_without_volume_are_searched_from_the_present_attitude() -> None:
    """From a present attitude that is turned about the joints' axes, the start is out of reach."""
    problem = deck_problem()
    present = heading_quaternion(2.75)
    assert not problem.branches(present)
    plan = ff.plan(problem, ff.Search("nearest", present, 64))
    require_kept(plan)
    assert plan.deviation > 0.0


def test_a_plan_that_tolerates_no_other_momentum_is_verified() -> None:
    """The planned one alone keeps the cone."""
    problem = bundled("ets_vii/line").replace(momentum=[0.15, -0.18, 0.18])
    motion = ff.simulate(problem, IDENTITY, limits=ff.Limits()).motion
    limits = cone(problem, motion, np.array([0.48, 0.6, 0.64]), 1.001)
    plan = ff.plan(problem, ff.Search("nearest", IDENTITY, 64), limits)
    require_kept(plan)
    assert (plan.deviation, plan.tolerance.momentum) == (0.0, 0.0)
    assert ff.check(plan).passed


def test_violations_lead_to_narrow_cones_from_anywhere() -> None:
    """Without a present attitude no sample is feasible."""
    problem = bundled("ets_vii/line")
    motion = ff.simulate(problem, IDENTITY, limits=ff.Limits()).motion
    limits = cone(problem, motion, np.array([0.48, 0.6, 0.64]), 1.2)
    plan = ff.plan(problem, ff.Search(samples=64), limits)
    assert plan.map.feasible_fraction == 0.0
    require_kept(plan)


def test_violations_lead_the_search_of_redundant_arms() -> None:
    """Where the spacecraft may turn by 2.46 degrees, no one of 128 samples is feasible."""
    problem = bundled("panda_servicer/line")
    limits = ff.Limits(base_turn=np.radians(2.46))
    plan = ff.plan(problem, ff.Search("still", IDENTITY, 128), limits)
    require_kept(plan)


@pytest.mark.parametrize(("objective", "measure"), [("nearest", "gjm"), ("margin", "system")])
def test_narrow_ranges_of_headings_contain_the_present_one(objective: str, measure: str) -> None:
    """Joints that are given and a cone leave less than half a degree between two samples."""
    problem = bundled("planar_2dof/line")
    margin = ff.Margin(ff.singularity_measure(problem.model, problem.task, measure), 0.01)
    problem = problem.replace(margin=margin)
    heading = np.radians(20.43)
    present = heading_quaternion(heading)
    motion = ff.simulate(problem, present).motion
    limits = cone(problem, motion, np.array([1.0, 0.0, 0.0]), 1.0 + 1e-3)
    search = ff.Search(objective, present, joints=motion.initial.joints)
    plan = ff.plan(problem, search, limits)
    require_kept(plan)
    assert plan.feasible_fraction < 0.02
    assert max(entry.depth(heading) for entry in plan.ranges) >= 0.0
    assert ff.check(plan).passed


def test_a_narrow_range_away_from_the_present_heading_is_verified() -> None:
    """It is found by searching on, half a degree away, where no sample is feasible."""
    problem = bundled("planar_2dof/line")
    margin = ff.Margin(ff.singularity_measure(problem.model, problem.task, "gjm"), 0.01)
    problem = problem.replace(margin=margin)
    motion = ff.simulate(problem, heading_quaternion(np.radians(20.43))).motion
    limits = cone(problem, motion, np.array([1.0, 0.0, 0.0]), 1.0 + 1e-3)
    plan = ff.plan(problem, ff.Search("nearest", heading_quaternion(np.radians(21.0))), limits)
    require_kept(plan)
    assert 0.4 < np.degrees(plan.deviation) < 0.6
    assert ff.check(plan).passed


def test_a_present_attitude_is_returned_where_others_have_no_spare_either() -> None:
    """One branch keeps the rates there alone, the other in a degree 6 degrees away."""
    rate = 0.2609
    problem = bundled("planar_2dof/line").replace(momentum=[0.0, 0.0, -0.3])
    problem = problem.replace(margin=replace(problem.margin, threshold=4.98456))
    present = heading_quaternion(np.radians(51.25))
    limits = ff.Limits(joint_rate=[rate, rate], clearance="off")
    simulations = [ff.simulate(problem, present, branch=k, limits=limits) for k in (0, 1)]
    assert sorted(simulation.feasible for simulation in simulations) == [False, True]
    plan = ff.plan(problem, ff.Search("nearest", present), limits)
    require_kept(plan)
    assert plan.deviation == 0.0


def test_ranges_without_width_contain_the_present_heading() -> None:
    """The margin is the largest minimum of any heading: another one does not keep it."""
    problem = bundled("planar_2dof/line")
    best = ff.plan(problem)
    margin = replace(problem.margin, threshold=best.chosen.minimum_margin)
    present = best.motion.initial.attitude
    plan = ff.plan(problem.replace(margin=margin), ff.Search("nearest", present))
    require_kept(plan)
    assert plan.deviation == pytest.approx(0.0, abs=1e-12)
    assert max(entry.depth(best.heading) for entry in plan.ranges) == pytest.approx(0.0, abs=1e-3)
    assert ff.check(plan).passed


def test_further_searches_stay_in_the_domain() -> None:
    """Where clearance leaves a thousandth of it, next to which feasible headings lie outside."""
    scenario = yaml.safe_load(ff.load_scenario("planar_2dof/line").text)
    present = heading_quaternion(5.3299)
    scenario |= {"margin": {"measure": "det A", "fraction": 0.5}, "limits": {"clearance": 0}}
    scenario["search"] = {"from_attitude": present.tolist(), "within_deg": 2.5}
    scenario["search"]["objective"] = "nearest"
    plan = ff.load_scenario(scenario).plan()
    require_kept(plan)
    assert np.degrees(plan.deviation) < 2.5
    assert ff.check(plan).passed


@pytest.mark.parametrize("objective", ["margin", "nearest"])
def test_given_joints_that_keep_their_ranges_are_not_missed(objective: str) -> None:
    """Of a redundant arm whose ranges leave 0.02 rad around the motion from its present state."""
    text, joints = SEVEN, np.array([0.3, -0.5, 1.1, 0.4, 0.9, -0.2, 0.3])
    first = _lines(text, joints)
    motion = ff.simulate(first, IDENTITY, joints=joints).motion
    assert motion.completed
    problem = _lines(with_ranges(text, motion, 0.02), joints)
    plan = ff.plan(problem, ff.Search(objective, IDENTITY, 64, joints=joints), ff.Limits())
    require_kept(plan)


def _lines(text: str, joints: np.ndarray) -> ff.Problem:
    model = ff.FreeFloatingModel.from_urdf(text, "tool")
    timing, step = ff.Timing(20.0), np.array([-0.1, -0.1, 0.1])
    return from_here(
        model, ff.Task.POSE, np.zeros(3), np.array(IDENTITY), joints, step, np.zeros(3), timing
    )


def test_joints_without_an_attitude_are_given_in_inertial_axes() -> None:
    """A path in the spacecraft's frame then begins in the attitude whose axes are inertial."""
    problem = bundled("ets_vii/line")
    simulation = ff.simulate(problem, IDENTITY, limits=ff.Limits())
    limits = cone(problem, simulation.motion, np.array([0.48, 0.6, 0.64]), 1.001)
    plan = ff.plan(problem, ff.Search(samples=64, joints=simulation.motion.initial.joints), limits)
    require_kept(plan)
    assert angle_between(plan.motion.initial.attitude, np.array(IDENTITY)) < 0.5
