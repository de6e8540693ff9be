"""The boundary of the feasible attitudes: bisection finds it, touch points lie on it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.errors import InputError
from freefloat.io.scenario import load_scenario
from freefloat.motion.problem import Margin, Problem
from freefloat.planning.attitude_map import AttitudeMap
from freefloat.planning.mapping import boundary_points, sample_attitudes, tangent_boundary
from freefloat.planning.search import EXACT, ROUGH, Inside, bisect, edge
from freefloat.planning.simulation import simulate
from freefloat.so3 import angle_between, attitude_grid, grid_spacing, rotated

MARGIN = 30.0


@pytest.fixture(scope="module")
def problem() -> Problem:
    """Example 2 with a margin that two fifths of the attitudes break."""
    easy = load_scenario("spatial_6dof/line").problem()
    return replace(easy, margin=Margin(easy.margin.measure, MARGIN))


@pytest.fixture(scope="module")
def outlook(problem: Problem) -> FeasibilityEvaluator:
    return FeasibilityEvaluator(problem, 1)


@pytest.fixture(scope="module")
def found(outlook: FeasibilityEvaluator) -> AttitudeMap:
    return sample_attitudes(outlook, 256)


@pytest.mark.parametrize(("rounds", "share"), [(ROUGH, 8.0**-3), (EXACT, 8.0**-6), (1, 1 / 8)])
def test_bisection_ends_just_inside(rounds: int, share: float) -> None:
    """On the way from the first attitude to the second, where the set is left for the first time.

    The set is a ball around the identity.
    """
    center, radius = np.array([0.0, 0.0, 0.0, 1.0]), 0.7
    rng = np.random.default_rng(3)
    axes = rng.normal(size=(50, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    within = rotated(center, rng.uniform(0.0, 0.69, (50, 1)) * axes)
    beyond = rotated(center, rng.uniform(0.71, 2.3, (50, 1)) * axes)
    whole = angle_between(within, beyond)
    edges = bisect(lambda some: angle_between(some, center) < radius, within, beyond, rounds)
    short = radius - angle_between(edges, center)
    assert (short > 0.0).all()
    assert (short <= share * whole * (1.0 + 1e-9)).all()
    np.testing.assert_allclose(
        angle_between(within, edges) + angle_between(edges, beyond), whole, atol=1e-7
    )


def test_bisection_goes_to_the_first_exit() -> None:
    """A gap in the set ends it, though the set is entered again behind it."""
    center = np.array([0.0, 0.0, 0.0, 1.0])

    def inside(some: np.ndarray) -> np.ndarray:
        angle = angle_between(some, center)
        return (angle < 0.5) | ((angle > 1.1) & (angle < 1.6))

    (end,) = bisect(inside, center[None], rotated(center, [2.0, 0.0, 0.0]))
    assert angle_between(end, center) == pytest.approx(0.5, abs=1e-5)


def test_bisection_takes_the_short_way_round_whatever_the_signs() -> None:
    center = np.array([0.0, 0.0, 0.0, 1.0])
    beyond = -rotated(center, [0.0, 0.0, 3.0])
    (end,) = bisect(lambda some: angle_between(some, center) < 1.0, center[None], beyond)
    np.testing.assert_allclose(Rotation.from_quat(end).as_rotvec(), [0.0, 0.0, 1.0], atol=2e-5)


def test_the_margin_is_just_kept_on_the_boundary(
    outlook: FeasibilityEvaluator, found: AttitudeMap, problem: Problem
) -> None:
    """Precise motions from its points have the margin as their smallest S; one of each branch."""
    points = boundary_points(outlook, found, 6)
    assert [point.branch for point in points] == [b for b in (0, 2, 4, 6) for _ in range(6)]
    for point in points[::3]:
        assert point.gap is None
        chosen = simulate(problem, point.attitude, branch=point.branch).chosen
        assert chosen.motion.completed
        assert chosen.closest_approach.value == pytest.approx(MARGIN, rel=1e-3)


def serving(outlook: FeasibilityEvaluator, branch: int) -> Inside:
    return lambda attitudes: outlook.keeps(attitudes, branch)


def test_points_of_an_edge_lie_between_neighbours(
    outlook: FeasibilityEvaluator, found: AttitudeMap
) -> None:
    """Kept themselves, near a sample outside; never more than asked for."""
    attitudes, keeps = found.attitudes, found.feasible[:, 2]
    points = edge(serving(outlook, 2), attitudes, keeps, 20, EXACT)
    assert len(points) == 20
    assert outlook.keeps(points, 2).all()
    near = 1.5 * grid_spacing(len(attitudes))
    for point in points:
        assert angle_between(attitudes[~keeps], point).min() < near
        assert angle_between(attitudes[keeps], point).min() < near
    apart = angle_between(points[:, None], points) + np.pi * np.eye(len(points))
    assert apart.min() > 1e-3
    margins = outlook.margins(points, 2)
    rough = outlook.margins(edge(serving(outlook, 2), attitudes, keeps, 20, ROUGH), 2)
    assert margins == pytest.approx(MARGIN, rel=1e-3)
    assert np.abs(rough - MARGIN).max() > np.abs(margins - MARGIN).max()


def test_all_or_nothing_has_no_edge(outlook: FeasibilityEvaluator, found: AttitudeMap) -> None:
    for everywhere in (True, False):
        feasible = np.full(len(found.attitudes), everywhere)
        assert edge(serving(outlook, 0), found.attitudes, feasible, 5, ROUGH).shape == (0, 4)


@pytest.fixture(scope="module")
def touched(outlook: FeasibilityEvaluator) -> list:
    shares: list[float] = []
    points = tangent_boundary(outlook, 12, progress=shares.append)
    assert shares == [(k + 1) / 12 for k in range(12)]
    return points


def test_touch_points_lie_where_bisection_finds_the_boundary(touched: list) -> None:
    """To a tenth of a degree."""
    assert len(touched) == 12
    assert max(point.gap for point in touched) < np.radians(0.1)
    assert min(point.gap for point in touched) >= 0.0


def test_motions_from_touched_attitudes_just_keep_the_margin(
    touched: list, problem: Problem
) -> None:
    for point in touched[:3]:
        chosen = simulate(problem, point.attitude, branch=point.branch).chosen
        assert chosen.motion.completed
        assert chosen.closest_approach.value == pytest.approx(MARGIN, rel=2e-4)


def test_other_arms_have_no_touch_points() -> None:
    """Arms without a spherical wrist, tasks in the plane."""
    for name, key in (("ur5_servicer/arc", "robot"), ("planar_3dof/parabola", "task")):
        with pytest.raises(InputError) as caught:
            tangent_boundary(FeasibilityEvaluator(load_scenario(name).problem(), 1), 3)
        assert caught.value.key == key


def test_a_margin_of_zero_has_no_touch_points(problem: Problem) -> None:
    none = replace(problem, margin=Margin(problem.margin.measure, 0.0))
    with pytest.raises(InputError) as caught:
        tangent_boundary(FeasibilityEvaluator(none, 1), 3)
    assert caught.value.key == "margin.value"


def test_boundary_is_the_same_for_any_grid_sign(
    outlook: FeasibilityEvaluator, found: AttitudeMap
) -> None:
    """A sample and its negative are one attitude."""
    signs = np.random.default_rng(2).choice([-1.0, 1.0], (len(found.attitudes), 1))
    keeps = found.feasible[:, 0]
    points = edge(serving(outlook, 0), found.attitudes, keeps, 8, ROUGH)
    other = edge(serving(outlook, 0), found.attitudes * signs, keeps, 8, ROUGH)
    np.testing.assert_allclose(angle_between(points, other), 0.0, atol=1e-6)
    np.testing.assert_array_equal(found.attitudes, attitude_grid(256))
