"""Counts of maps, connected regions of the feasible set, and its boundary."""

import numpy as np
import pytest

import freefloat as ff
from freefloat.attitude_grids import attitude_grid, grid_spacing
from freefloat.ensemble.endings import SINGULAR
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.space.attitude_map import AttitudeMap, find_regions
from freefloat.planning.space.map_sampling import (
    boundary_points,
    sample_attitudes,
    tangent_boundary,
)
from freefloat.so3 import angle_between
from tests.maps import branch_results

CENTRES = np.array([[0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0]])
RADII = (0.9, 0.6)


def made(
    problem: ff.Problem,
    attitudes: np.ndarray,
    margins: np.ndarray,
    endings: np.ndarray | None = None,
) -> AttitudeMap:
    """A map with minimum margins of some arm branches; by default all motions complete."""
    stated = {} if endings is None else {"endings": endings}
    return AttitudeMap(problem, branch_results(attitudes, margins, **stated))


def balls(attitudes: np.ndarray) -> np.ndarray:
    """Which attitudes lie in two balls with centres an angle of pi apart, shape (2, N)."""
    return np.array([
        angle_between(attitudes, centre) < radius
        for centre, radius in zip(CENTRES, RADII, strict=True)
    ])  # fmt: skip


def test_counts_of_singular_missing_and_feasible_motions(margin_30: ff.Problem) -> None:
    margins = np.array([[31.0, 0.0], [50.0, 29.0], [0.0, 10.0], [30.0, 60.0]])
    endings = np.array([[0, -1], [SINGULAR, 0], [-1, 0], [0, 0]], dtype=np.int8)
    result = made(margin_30, attitude_grid(8)[:4], margins, endings)
    np.testing.assert_array_equal(result.margins, [[31, 0], [0, 29], [0, 10], [30, 60]])
    np.testing.assert_array_equal(result.feasible, [[1, 0], [0, 0], [0, 0], [1, 1]])
    assert result.motions == 6
    assert result.feasible_fraction == 0.5
    assert result.feasible_fraction_error == pytest.approx(0.25)
    assert result.motion_fraction == 0.5


def test_two_balls_are_two_regions(margin_30: ff.Problem) -> None:
    """Their sizes, centres and depths; the signs of quaternions do not matter."""
    N = 4096
    attitudes = attitude_grid(N, 2) * np.random.default_rng(9).choice([-1.0, 1.0], (N, 1))
    inside, margins = balls(attitudes), np.zeros((N, 8))
    margins[:, 2] = np.where(inside.any(axis=0), 40.0, 29.0)
    regions = find_regions(made(margin_30, attitudes, margins))
    assert [region.branch for region in regions] == [2, 2]
    for region, members, centre, radius in zip(regions, inside, CENTRES, RADII, strict=True):
        fraction = members.mean()
        assert region.fraction == pytest.approx(fraction)
        assert region.error == pytest.approx(np.sqrt(fraction * (1 - fraction) / N))
        assert angle_between(region.centre, centre) < grid_spacing(N)
        assert region.depth == pytest.approx(radius, abs=grid_spacing(N))
        outside = attitudes[~inside.any(axis=0)]
        assert region.depth == pytest.approx(angle_between(outside, region.centre).min())


def test_a_ring_is_one_region(margin_30: ff.Problem) -> None:
    """Rotations about one axis form a closed line through SO(3) that returns with -q."""
    attitudes, margins = attitude_grid(4096), np.zeros((4096, 8))
    about_z = np.hypot(attitudes[:, 0], attitudes[:, 1]) < np.sin(0.2)
    margins[:, 0] = 40.0 * about_z
    (region,) = find_regions(made(margin_30, attitudes, margins))
    assert region.fraction == about_z.mean()


@pytest.fixture(scope="module")
def evaluator(margin_30: ff.Problem) -> FeasibilityEvaluator:
    return FeasibilityEvaluator(margin_30, 1)


@pytest.mark.slow
def test_precise_motions_from_the_boundary_just_keep_the_margin(evaluator, margin_30):
    points = boundary_points(evaluator, sample_attitudes(evaluator, 512), 3)
    assert [point.branch for point in points] == [b for b in (0, 2, 4, 6) for _ in range(3)]
    for point in points[::2]:
        assert point.gap is None
        chosen = ff.simulate(margin_30, point.attitude, branch=point.branch).chosen
        assert chosen.motion.completed
        assert chosen.closest_approach.value == pytest.approx(30.0, rel=1e-3)


@pytest.mark.slow
def test_touch_points_lie_where_bisection_finds_the_boundary(evaluator, margin_30):
    """To a tenth of a degree; precise motions from there just keep the margin."""
    points = tangent_boundary(evaluator, 6)
    assert len(points) == 6
    assert max(point.gap for point in points) < np.radians(0.1)
    assert min(point.gap for point in points) >= 0.0
    for point in points[:3]:
        chosen = ff.simulate(margin_30, point.attitude, branch=point.branch).chosen
        assert chosen.motion.completed
        assert chosen.closest_approach.value == pytest.approx(30.0, rel=2e-4)
