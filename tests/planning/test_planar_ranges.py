"""Exact ranges of heading, with drift and limits of attitude: compared with other motions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

import freefloat as ff
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.paths.timing import Stop
from freefloat.planning.plane.arcs import MARGIN, REACH
from freefloat.planning.plane.ranges import find_range_limits, heading_ranges, reach_limits
from freefloat.so3 import angle_between, heading_quaternion
from tests.commands import document, run
from tests.motions import Z, along, bundled, chain
from tests.redundant import redundant


@pytest.fixture(scope="module")
def ranges(planar):
    span = (0.0, 100.0)
    return heading_ranges(planar, find_range_limits(planar, span), span, 0.0)


def is_feasible(problem, heading, branch):
    attitude = heading_quaternion(heading)
    for start in problem.branches(attitude):
        if start.index == branch:
            motion = ff.integrate_motion(problem, attitude, start.joints, tolerance=1e-9)
            approach = ff.closest_approach(motion, problem.margin.measure)
            return motion.completed and problem.margin.keeps(approach.value)
    return False


@pytest.mark.slow
def test_limits_are_exact_to_a_ten_thousandth_of_a_degree(planar, ranges):
    off = np.radians(1e-4)
    for entry in ranges:
        for part in entry.ranges:
            assert is_feasible(planar, part.low + off, entry.branch)
            assert is_feasible(planar, part.high - off, entry.branch)
            assert not is_feasible(planar, part.low - off, entry.branch)
            assert not is_feasible(planar, part.high + off, entry.branch)


@pytest.mark.slow
def test_ranges_end_by_the_margin_or_by_the_reach(planar):
    """Far from the centre the arm reaches the path from some headings only."""
    span = (69.73, 100.0)
    entries = heading_ranges(planar, find_range_limits(planar, span), span, 100.0)
    causes = {cause for entry in entries for part in entry.ranges for cause in part.causes}
    assert causes == {MARGIN, REACH}


@pytest.mark.parametrize("radius", [0.5, 1.5])
def test_the_arm_reaches_the_path_from_one_side_of_a_reach_limit(radius):
    """Arm branches appear or disappear there: the arm is folded near the centre, or stretched."""
    joint, other = ("continuous", Z, (0.4, 0.3, 0)), ("continuous", Z, (1.0, 0.2, 0))
    body = 4.0, (0.5, 0, 0), (0.01, 0.333, 0.333)
    text = chain((*joint, *body), (*other, *body), base=(40.0, 7.4, 0.0), tool=(0.6, 0, 0))
    model = ff.FreeFloatingModel.from_urdf(text, "tool")
    problem = along(model, ff.Task.PLANAR_POSITION, [radius, 0, 0], [radius, 0.1, 0], np.eye(3))
    limits = list(reach_limits(problem, 0.0))
    assert len(limits) == 2
    for heading in limits:
        sides = (heading_quaternion(heading + offset) for offset in (-1e-6, 1e-6))
        assert {bool(problem.branches(side, 0.0)) for side in sides} == {True, False}


ROOT = ff.PointingLimit("spacecraft", [0.0, 1.0, 0.0], 1.4, "outside", direction=[1.0, 0.5, 0.3])
LINK = ff.PointingLimit("link_1", [1.0, 0.0, 0.2], 1.6, point=[1.0, 4.0, 0.5])


def keeps(motion, limits: ff.Limits) -> bool:
    _, attitudes, joints = motion.evaluate(np.linspace(0.0, motion.panels, 500))
    model = motion.problem.model
    for limit in limits.pointing:
        pairs = [limit.vectors(model, a, q) for a, q in zip(attitudes, joints, strict=True)]
        angles = np.arccos([axis @ target for axis, target in pairs])
        inside = limit.keep == "inside"
        if not (angles <= limit.angle if inside else angles >= limit.angle).all():
            return False
    turn = angle_between(attitudes, attitudes[0]).max()
    return bool(limits.base_turn is None or turn <= limits.base_turn)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "limits", "cause", "measure"), [
    ("planar_3dof/parabola", ff.Limits(pointing=(ROOT,)), "pointing", "det A"),
    ("planar_3dof/parabola", ff.Limits(pointing=(LINK,)), "pointing", "det A"),
    ("planar_2dof/line", ff.Limits(base_turn=0.6), "base_turn", "det A"),
    ("planar_2dof/line", ff.Limits(base_turn=0.6), "base_turn", "det S*"),
])  # fmt: skip
def test_ranges_end_where_a_limit_is_just_kept(name, limits, cause, measure):
    problem = ff.load_scenario(name).problem()
    if measure == "det S*":
        other = ff.singularity_measure(problem.model, problem.task, measure)
        problem = problem.replace(margin=ff.Margin(other, 0.01))
    free, plan = ff.plan(problem), ff.plan(problem, limits=limits)
    found = 0
    for before, entry in zip(free.ranges, plan.ranges, strict=True):
        headings = np.radians(np.arange(0.5, 360.0, 30.0))
        ends = [
            end
            for part in entry.ranges
            for end in zip((part.low, part.high), part.causes, strict=False)
        ]
        probes = [end + d for end, why in ends if why == cause for d in (-1.7e-4, 1.7e-4)]
        found += len(probes)
        for heading in [*headings, *probes]:
            if before.depth(heading) <= 0.0 or abs(entry.depth(heading)) < 1e-6:
                assert entry.depth(heading) <= 1e-6
                continue
            attitude = heading_quaternion(heading)
            joints = next(b.joints for b in problem.branches(attitude) if b.index == entry.branch)
            motion = ff.integrate_motion(problem, attitude, joints)
            assert keeps(motion, limits) is bool(entry.depth(heading) > 0.0), np.degrees(heading)
    assert found


def test_no_heading_within_limits() -> None:
    plan = ff.plan(ff.load_scenario("planar_2dof/line").problem(), limits=ff.Limits(base_turn=0.01))
    assert not plan.feasible
    assert not any(entry.ranges for entry in plan.ranges)


@pytest.mark.slow
def test_the_starts_of_a_redundant_arm_are_followed_through_samples() -> None:
    """A limit ends its ranges; the tolerance is that of the chosen start; a map has one branch."""
    start = redundant("3", ff.Task.PLANAR_POSITION, None, seed=1)
    measure, limits = start.problem.margin.measure, ff.Limits(base_turn=0.12)
    problem = start.problem.replace(margin=ff.Margin(measure, 0.3 * measure(start.joints)))
    plan, samples = ff.plan(problem, limits=limits), ff.attitude_map(problem, 90, limits=limits)
    assert [part.causes for part in plan.ranges[0].ranges] == [("margin", "base_turn")]
    near = problem.replace(start_joints=plan.motion.initial.joints)
    for turn, kept in ((0.99, True), (4.0, False)):
        headings = plan.heading + turn * plan.robust_radius * np.array([-1.0, 1.0])
        motions = [ff.simulate(near, heading=heading).motion for heading in headings]
        assert all(keeps(motion, limits) for motion in motions) is kept
    assert {region.branch for region in (*samples.regions, samples.best)} == {None}
    easy = redundant("4", ff.Task.PLANAR_POSE, None, seed=3).problem  # with a margin of zero
    assert ff.plan(easy, tolerances=False).to_dict()["feasible_fraction"] == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 4])
@pytest.mark.parametrize("name", ["planar_2dof/line", "planar_3dof/parabola"])
def test_exact_ranges_agree_with_a_sweep_while_the_centre_of_mass_drifts(name, seed):
    """Also with stops, at which the end-effector moves relative to the centre of mass."""
    rng = np.random.default_rng(seed)
    duration = bundled(name).path.duration
    velocity = [*rng.uniform(-0.4, 0.4, 2) / duration, 0.0]
    momentum = [0.0, 0.0, seed % 2 * float(rng.uniform(-15.0, 15.0)) / duration]
    path = replace(bundled(name).path, drift=velocity)
    problem = bundled(name).replace(path=path, momentum=momentum)
    if name == "planar_2dof/line" and seed > 2:
        timing = replace(problem.path.timing, stops=[Stop(0.3, 0.4 * duration)])
        problem = replace(problem, path=replace(problem.path, timing=timing))
    result = ff.plan(problem, limits=ff.Limits())
    headings = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False) + 0.0007
    motions = FeasibilityEvaluator(problem).evaluate(heading_quaternion(headings)).motions
    feasible = motions.keeps(problem.margin.threshold)
    assert result.feasible
    for entry in result.ranges:
        inside = np.array([entry.depth(heading) > 0.0 for heading in headings])
        np.testing.assert_array_equal(inside, feasible[:, entry.branch])


@pytest.fixture
def scenario(folder: Path) -> dict:
    return yaml.safe_load(run("models", "planar_2dof/line").stdout)


def test_a_path_that_the_drift_leads_out_of_reach_is_refused(scenario: dict) -> None:
    Path("mine.yaml").write_text(yaml.safe_dump(scenario | {"drift": [1.0, 0.0, 0.0]}))
    result = document("plan", "mine.yaml", code=1)
    assert result["reason"]


@pytest.mark.parametrize("name", ["still", "margin"])
def test_a_spacecraft_may_turn_by_more_than_half_a_revolution(name: str) -> None:
    """Where its turn is measured or limited to half a revolution, no heading is excluded."""
    problem = bundled("planar_2dof/line").replace(momentum=[0.0, 0.0, -0.79])
    turns = ff.Limits(clearance=False, base_turn=np.pi if name == "margin" else None)
    free = ff.plan(problem, ff.Search("margin"), ff.Limits(clearance=False))
    ranges = ff.plan(problem, ff.Search(name), turns).ranges
    for one, other in zip(free.ranges, ranges, strict=True):
        assert max(part.width for part in one.ranges) > 1.5
        for part, same in zip(one.ranges, other.ranges, strict=True):
            assert (same.low, same.high) == pytest.approx((part.low, part.high), abs=1e-9)
