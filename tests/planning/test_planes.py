"""Plans of planar arms about any direction: those of the same arm about z."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.planning.plan import Plan
from freefloat.so3 import Pose
from tests.planes import planar_problem, turn_to

ARMS = {
    "two joints": ("+-", "planar-position", "gjm"),
    "exact ranges": ("+-+", "planar-pose", "system"),
    "redundant": ("+-+", "planar-position", "gjm"),
    "prismatic": ("p+-", "planar-pose", "system"),
}


def planned(direction: str, arm: str) -> Iterator[tuple[ff.Problem, Plan]]:
    """The problem about z and about a direction, and their plans."""
    joints, task, measure = ARMS[arm]
    for turn in (np.eye(3), turn_to(direction)):
        problem = planar_problem(1, joints, turn, task, measure)
        yield problem, ff.plan(problem)


def headings(plan: Plan) -> list[list[float]]:
    return [end for entry in plan.ranges for end in entry.degrees]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("direction", "arm"),
    [
        ("x", "prismatic"),
        ("y", "redundant"),
        ("oblique", "two joints"),
        ("oblique", "exact ranges"),
    ],
)
def test_plans_are_those_of_the_arm_about_z(direction: str, arm: str, tmp_path: Path) -> None:
    """Ranges, chosen heading, margin and tolerance; files of them are verified."""
    (_, level), (_, plan) = planned(direction, arm)
    assert plan.feasible
    np.testing.assert_allclose(headings(plan), headings(level), atol=1e-6)
    assert plan.heading == pytest.approx(level.heading, abs=1e-6)
    assert plan.robust_radius == pytest.approx(level.robust_radius, abs=1e-8)
    approach, other = plan.chosen.closest_approach, level.chosen.closest_approach
    assert approach.value == pytest.approx(other.value, rel=1e-6)
    turn = turn_to(direction)
    chosen = plan.chosen.motion.initial.attitude
    expected = Rotation.from_rotvec(plan.heading * turn[:, 2])
    assert (expected.inv() * Rotation.from_quat(chosen)).magnitude() < 1e-9
    ff.save(plan, tmp_path / "plan.h5")
    assert ff.check(ff.load(tmp_path / "plan.h5")).passed


@pytest.mark.parametrize("direction", ["x", "oblique"])
def test_regions_are_those_of_the_arm_about_z(direction: str) -> None:
    regions = [
        ff.workspace_regions(planar_problem(2, "+-", turn, "planar-position", "system"))
        for turn in (np.eye(3), turn_to(direction))
    ]
    for name in ("reach", "path_dependent", "path_independent"):
        first, second = (getattr(entry, name) for entry in regions)
        np.testing.assert_allclose(first, second, atol=1e-9)
    np.testing.assert_allclose(*(entry.largest_s for entry in regions), rtol=1e-9)
    (first, _), (second, _) = regions[0].path[0], regions[1].path[0]
    np.testing.assert_allclose(first, second, atol=2e-3)


def test_what_leaves_the_plane_is_refused() -> None:
    turn = turn_to("oblique")
    problem = planar_problem(1, "+-+", turn, "planar-pose", "system")
    outside = 0.01 * turn[:, 0]
    beside = problem.path.path.curve.moved(Pose(0.01 * turn[:, 2], np.eye(3)))
    path = ff.TimedPath(
        ff.EndEffectorPath(beside, problem.path.path.orientation), problem.path.timing
    )
    for key, changes in (
        ("path", {"path": path}),
        ("momentum", {"momentum": outside}),
        ("wheels.momentum", {"wheel_momentum": outside}),
        ("drift", {"path": problem.path.with_drift(0.01 * turn[:, 2])}),
    ):
        with pytest.raises(ff.InputError) as caught:
            problem.replace(**changes)
        assert caught.value.key == key
    with pytest.raises(ff.InputError) as caught:
        problem.attitude(Rotation.from_rotvec(outside).as_quat())
    assert caught.value.key == "attitude"
    normal = problem.plane.normal
    kept = problem.attitude(Rotation.from_rotvec(0.3 * normal).as_quat())
    assert problem.plane.heading(kept) == pytest.approx(0.3, abs=1e-12)


def test_axes_of_rounded_right_angles_are_accepted() -> None:
    """The roll of 1.5708 in a file is 3.7e-6 rad too large: headings about y, paths in x and z."""
    turn = Rotation.from_euler("xyz", [-1.5708, 0.0, 0.0]).as_matrix()
    problem = planar_problem(1, "+-+", turn, "planar-pose", "system")
    curve = problem.path.path.curve
    ends = [curve(s) * [1.0, 0.0, 1.0] for s in (0.0, 1.0)]
    line = ff.paths.PolynomialCurve.line(*ends)
    exact = ff.TimedPath(
        ff.EndEffectorPath(line, problem.path.path.orientation), problem.path.timing
    )
    rounded = problem.replace(path=exact, momentum=[0.0, 0.3, 0.0])
    attitude = rounded.attitude([0.0, np.sin(0.2), 0.0, np.cos(0.2)])
    assert rounded.plane.heading(attitude) == pytest.approx(0.4, abs=1e-9)


@pytest.mark.slow
def test_ranges_within_pointing_limits_are_those_of_the_arm_about_z() -> None:
    """An axis of the spacecraft stays in a cone, one of the end-effector outside another."""
    found = []
    for turn in (np.eye(3), turn_to("oblique")):
        problem = planar_problem(1, "+-+", turn, "planar-pose", "system")
        middle = turn @ [np.cos(np.radians(347.8)), np.sin(np.radians(347.8)), 0.0]
        ahead = ff.PointingLimit("bus", turn[:, 0], np.radians(36.9), direction=middle)
        away = -problem.path.pose(20.0).rotation[:, 0]
        beside = ff.PointingLimit("tool", [1.0, 0.0, 0.0], 0.3, keep="outside", direction=away)
        limits = ff.Limits(pointing=(ahead, beside), base_turn=3.0)
        plan = ff.plan(problem, limits=limits)
        ratios = [result.ratio for result in plan.limit_results]
        found.append([*np.ravel(headings(plan)), np.degrees(plan.heading), *ratios])
        causes = [part.causes for entry in plan.ranges for part in entry.ranges]
        assert causes == [("pointing", "pointing")]
    np.testing.assert_allclose(found[1], found[0], atol=1e-6)


@pytest.mark.slow
def test_goals_and_rounded_momenta_are_planned_in_any_plane() -> None:
    turn = turn_to("oblique")
    problem = planar_problem(1, "+-+", turn, "planar-pose", "system")
    momentum = turn @ [1e-17, 0.0, 0.05]
    system = problem.replace(momentum=momentum).system
    present = [0.0, 0.0, 0.0, 1.0], [0.4, 0.5, -0.3]
    limits = ff.Limits(joint_rate=np.full(3, 0.1))
    found = ff.move(system, present, ff.Goal(joints=[0.5, 0.3, -0.2]), limits)
    assert found.feasible
    turned = Rotation.from_quat(found.motion.final.attitude).as_rotvec()
    assert np.abs(turn[:, :2].T @ turned).max() < 1e-9
