"""Searches near the present attitude, and from the present joints of the arm."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import freefloat as ff
from freefloat.attitude_grids import attitude_grid
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.evaluator import evaluator_for
from freefloat.planning.plane.heading_search import sample_headings
from freefloat.planning.plane.search import searched_ranges
from freefloat.planning.space.mapping import sample_attitudes
from freefloat.so3 import angle_between, heading_of, heading_quaternion
from tests.errors import error_key
from tests.motions import bundled

PRESENT = np.array([0.1, 0.5, 0.2, -0.8367]) / np.linalg.norm([0.1, 0.5, 0.2, -0.8367])
JOINTS = [0.4, -1.0, 1.2, -2.9, 1.0, 3.0]


def near(angle: float, **options: object) -> ff.Search:
    return ff.Search(from_attitude=PRESENT, within=np.radians(angle), **options)


# --- attitudes ------------------------------------------------------------------------------------


def test_attitudes_of_a_ball_represent_equal_parts_of_it() -> None:
    domain = near(60.0).domain
    every = attitude_grid(20_000)
    assert domain.contains(every).mean() == pytest.approx(domain.fraction, rel=0.02)
    attitudes = domain.attitudes(4_000, 3)
    assert domain.contains(attitudes).all()
    angles = angle_between(attitudes, PRESENT)
    half = near(30.0).domain.fraction / domain.fraction
    assert (angles < np.radians(30.0)).mean() == pytest.approx(half, abs=0.005)
    spacing = domain.spacing(4_000)
    assert 4_000 * spacing**3 == pytest.approx(8.0 * np.pi**2 * domain.fraction)
    assert ff.Search(within=np.pi, from_attitude=PRESENT).domain.spacing(9) == pytest.approx(
        ff.Search().domain.spacing(9)
    )


@pytest.mark.slow
@pytest.mark.usefixtures("smaller")
def test_a_map_of_a_ball_agrees_with_the_samples_of_a_whole_map_inside(
    margin_30: ff.Problem, evaluator: FeasibilityEvaluator
) -> None:
    search = near(60.0)
    whole = sample_attitudes(evaluator, 2048)
    inside = search.domain.contains(whole.attitudes)
    ball = ff.attitude_map(margin_30, 256, search=search, boundary=2, threads=1)
    fraction = whole.feasible[inside].any(axis=1).mean()
    assert ball.feasible_fraction == pytest.approx(fraction, abs=0.06)
    assert ball.best is not None
    assert ball.best.minimum_margin >= whole.margins[inside].max()
    assert ball.robust is not None
    candidates = [ball.best, ball.robust, *(ball.boundary or ())]
    assert search.domain.contains([entry.attitude for entry in candidates]).all()
    volumes = [region.to_dict()["volume_rad3"] for region in ball.regions]
    assert max(volumes) <= 8.0 * np.pi**2 * search.domain.fraction


# --- headings -------------------------------------------------------------------------------------


@pytest.mark.slow
def test_ranges_of_headings_are_intersected() -> None:
    problem = bundled("planar_2dof/line")
    every = ff.plan(problem)
    centre, width = np.radians(40.0), np.radians(50.0)
    search = ff.Search(from_attitude=heading_quaternion(centre), within=width)
    plan = ff.plan(problem, search)
    for entry, whole in zip(plan.ranges, every.ranges, strict=True):
        for heading in np.linspace(0.0, 2.0 * np.pi, 500):
            offset = abs((heading - centre + np.pi) % (2.0 * np.pi) - np.pi)
            gap = min(abs(offset - width), *(abs(p.depth(heading)) for p in whole.ranges))
            stated = any(part.depth(heading) > 0.0 for part in entry.ranges)
            known = offset < width and any(p.depth(heading) > 0.0 for p in whole.ranges)
            assert stated == known or gap < 1e-6
    causes = {cause for entry in plan.ranges for part in entry.ranges for cause in part.causes}
    assert "search" in causes
    assert plan.heading is not None
    assert plan.deviation is not None
    assert plan.deviation <= width + 1e-9
    searched = searched_ranges(FeasibilityEvaluator(problem), 48, None, search.domain)
    for entry, exact in zip(searched, plan.ranges, strict=True):
        ends = [(part.low, part.high) for part in entry.ranges]
        np.testing.assert_allclose(ends, [(p.low, p.high) for p in exact.ranges], atol=1e-5)


def test_maps_over_headings_of_an_arc() -> None:
    problem = bundled("planar_3dof/parabola")
    search = ff.Search(from_attitude=heading_quaternion(0.1), within=0.5)
    result = sample_headings(evaluator_for(problem), 40, search)
    assert np.diff(result.headings) == pytest.approx(1.0 / 40)
    offsets = (result.headings - 0.1 + np.pi) % (2.0 * np.pi) - np.pi
    assert np.abs(offsets).max() == pytest.approx(0.5 - 0.5 / 40)
    sizes = dict.fromkeys(result.branches, 0.0)
    for region in result.regions:
        sizes[region.branch] += np.radians(region.size)
    for number, branch in enumerate(result.branches):
        assert sizes[branch] == pytest.approx(result.feasible[:, number].mean())


# --- joints ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["spatial_6dof/line", "planar_3dof/parabola", "ur5_servicer/arc"])
def test_the_closest_branch_is_that_of_brute_force(name: str) -> None:
    """Of all branches, shifted by all full rotations that the joint ranges allow."""
    problem = bundled(name)
    joints = np.array(JOINTS[: problem.model.dof])
    present = replace(problem, start_joints=joints)
    attitudes = attitude_grid(24)
    if problem.task.planar:
        attitudes = heading_quaternion(np.linspace(0.0, 6.0, 24))
    lower, upper = problem.model.joint_ranges
    for attitude, chosen in zip(attitudes, present.many_branches(attitudes), strict=True):
        best = {}
        for branch in problem.branches(attitude):
            values = []
            for q, low, high, value in zip(branch.joints, lower, upper, joints, strict=True):
                shifted = q + 2.0 * np.pi * np.arange(-2, 3)
                inside = shifted[(shifted >= low) & (shifted <= high)]
                values.append(np.abs((inside if len(inside) else [q]) - value).min())
            best[branch.index] = max(values)
        assert len(chosen) == bool(best)
        for branch in chosen:
            assert best[branch.index] == pytest.approx(min(best.values()))
            assert np.abs(branch.joints - joints).max() == pytest.approx(min(best.values()))


@pytest.mark.slow
def test_a_redundant_arm_starts_from_its_present_joints() -> None:
    problem = bundled("panda_servicer/line")
    attitude = next(a for a in attitude_grid(64) if problem.branches(a))
    joints = problem.branches(attitude)[3].joints
    names = dict(zip(problem.model.joint_names, joints.tolist(), strict=True))
    search = ff.Search(from_attitude=attitude, joints=names, within=0.1)
    (start,) = search.applied_to(problem).branches(attitude)
    assert np.abs(start.joints - joints).max() < 1e-9
    evaluator = FeasibilityEvaluator(search.applied_to(problem), 1)
    result = sample_attitudes(evaluator, 16, search=search)
    assert result.margins.shape == (16, 1)
    starts = result.results.joints[:, 0]
    assert np.nanmax(np.abs(starts - joints)) < 0.6  # close to the present ones everywhere
    again = next(a for a in attitude_grid(64)[::-1] if problem.branches(a))
    (far,) = replace(problem, start_joints=joints).branches(again)
    pose = problem.model.end_effector_pose(again, far.joints)
    assert np.abs(pose.position - problem.path.pose(0.0).position).max() < 1e-8


@pytest.mark.slow
def test_planar_ranges_of_the_closest_branch() -> None:
    problem = bundled("planar_2dof/line")
    plan = ff.plan(problem, ff.Search(joints=[0.4, 1.0]))
    assert all(ff.check(plan).checks[0:1])
    evaluator = FeasibilityEvaluator(plan.problem)
    for heading in np.linspace(0.01, 6.2, 60):
        attitude = heading_quaternion(heading)
        keeps = [evaluator.keeps(attitude[None], branch)[0] for branch in (0, 1)]
        depths = [max(part.depth(heading) for part in entry.ranges) if entry.ranges else -1.0
                  for entry in plan.ranges]  # fmt: skip
        for kept, depth in zip(keeps, depths, strict=True):
            assert kept == (depth > 0.0) or abs(depth) < 1e-3
    assert plan.chosen is not None
    (start,) = plan.problem.branches(plan.chosen.motion.initial.attitude)
    assert start.index == plan.chosen.branch.index


# --- records --------------------------------------------------------------------------------------


@pytest.mark.slow
def test_joints_and_angle_survive_files(tmp_path: Path) -> None:
    problem = bundled("planar_2dof/line")
    search = ff.Search("nearest", heading_quaternion(0.5), joints=[0.4, 1.0], within=0.6)
    plan = ff.plan(problem, search)
    ff.save(plan, tmp_path / "plan.h5")
    again = ff.load(tmp_path / "plan.h5")
    stored, known = again.search.to_dict(), plan.search.to_dict()
    assert stored.pop("from_attitude") == pytest.approx(known.pop("from_attitude"))
    assert stored == known
    np.testing.assert_array_equal(again.problem.start_joints, [0.4, 1.0])
    assert again.ranges[0].ranges[0].causes == plan.ranges[0].ranges[0].causes
    assert ff.check(again).passed
    headings = ff.attitude_map(problem, 24, search=search)
    ff.save(headings, tmp_path / "map.h5")
    stored, known = ff.load(tmp_path / "map.h5").to_dict(), headings.to_dict()
    assert stored["search"].pop("from_attitude") == pytest.approx(
        known["search"].pop("from_attitude")
    )
    assert stored == known
    assert heading_of(search.domain.centre) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("options", "key"),
    [
        ({"within": 0.2}, "search.from_attitude"),
        ({"within": 4.0, "from_attitude": PRESENT}, "search.within"),
        ({"joints": [10.0, 0.0, 90.0]}, "search.joints"),  # degrees
    ],
)
def test_unusable_searches(options: dict, key: str) -> None:
    problem = bundled("planar_3dof/parabola")
    assert error_key(lambda: ff.plan(problem, ff.Search(**options))) == key
