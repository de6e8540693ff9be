"""Searches near the present attitude, and from the present joints of the arm."""

from dataclasses import replace

import numpy as np
import pytest

import freefloat as ff
from freefloat.attitude_grids import attitude_grid
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.plane.search import searched_ranges
from freefloat.so3 import heading_quaternion
from tests.errors import error_key
from tests.motions import bundled

PRESENT = np.array([0.1, 0.5, 0.2, -0.8367]) / np.linalg.norm([0.1, 0.5, 0.2, -0.8367])
JOINTS = [0.4, -1.0, 1.2, -2.9, 1.0, 3.0]


def near(angle: float, **options: object) -> ff.Search:
    return ff.Search(from_attitude=PRESENT, within=np.radians(angle), **options)


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


@pytest.mark.parametrize("name", ["spatial_6dof/line", "planar_3dof/parabola", "ur5_servicer/arc"])
def test_the_closest_branch_is_that_of_brute_force(name: str) -> None:
    """Of all branches, shifted by all full rotations that the joint ranges allow."""
    problem = bundled(name)
    joints = np.array(JOINTS[: problem.model.dof])
    present, attitudes = replace(problem, start_joints=joints), attitude_grid(24)
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


@pytest.mark.parametrize(("options", "key"), [
    ({"within": 0.2}, "search.from_attitude"),
    ({"within": 4.0, "from_attitude": PRESENT}, "search.within"),
    ({"joints": [10.0, 0.0, 90.0]}, "search.joints"),  # degrees
])  # fmt: skip
def test_unusable_searches(options: dict, key: str) -> None:
    problem = bundled("planar_3dof/parabola")
    assert error_key(lambda: ff.plan(problem, ff.Search(**options))) == key
