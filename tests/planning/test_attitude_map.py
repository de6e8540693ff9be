"""All of SO(3): what a map says of an attitude is what becomes of it, what it counts is there."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.kernels.integration import COMPLETED, SINGULAR, UNREACHED
from freefloat.errors import InputError
from freefloat.io.scenario import load_scenario
from freefloat.motion.problem import Margin, Problem, is_kept
from freefloat.planning import mapping
from freefloat.planning.attitude_map import AttitudeMap
from freefloat.planning.mapping import sample_attitudes
from freefloat.planning.regions import depths, find_regions
from freefloat.planning.simulation import simulate
from freefloat.so3 import angle_between, attitude_grid, attitudes_within, grid_spacing

SAMPLES = 512


@cache
def bundled(name: str, value: float | None = None) -> Problem:
    problem = load_scenario(name).problem()
    if value is None:
        return problem
    return replace(problem, margin=Margin(problem.margin.measure, value))


@pytest.fixture(scope="module")
def problem() -> Problem:
    """Example 2 with a margin that two fifths of the attitudes break."""
    return bundled("spatial_6dof/line", 30.0)


@pytest.fixture(scope="module")
def outlook(problem: Problem) -> FeasibilityEvaluator:
    return FeasibilityEvaluator(problem, 1)


@pytest.fixture(scope="module")
def found(outlook: FeasibilityEvaluator) -> AttitudeMap:
    return sample_attitudes(outlook, SAMPLES)


def drawn(
    problem: Problem, attitudes: np.ndarray, least: np.ndarray, endings: np.ndarray | None = None
) -> AttitudeMap:
    """A map made by hand; everything completes unless told otherwise."""
    least = np.atleast_2d(least.T).T.astype(float)
    if endings is None:
        endings = np.full(least.shape, COMPLETED, dtype=np.int8)
    return AttitudeMap(problem, 0, attitudes, least, np.ones(least.shape), endings)


def test_a_map_is_a_grid_and_its_prospects(
    found: AttitudeMap, outlook: FeasibilityEvaluator
) -> None:
    prospects = outlook.evaluate(attitude_grid(SAMPLES))
    np.testing.assert_array_equal(found.attitudes, prospects.attitudes)
    np.testing.assert_array_equal(found.minimum_margins, prospects.motions.minimum)
    np.testing.assert_array_equal(found.endings, prospects.motions.endings)
    np.testing.assert_array_equal(found.margins, prospects.margins)
    for values in (found.attitudes, found.minimum_margins, found.endings):
        assert not values.flags.writeable


def test_entries_of_a_map_are_those_of_simulations(found: AttitudeMap) -> None:
    for k in (3, 101, 300, 487):
        simulation = simulate(found.problem, found.attitudes[k])
        numbers = [one.branch.index for one in simulation.branches]
        assert np.flatnonzero(found.endings[k] != UNREACHED).tolist() == numbers
        for one in simulation.branches:
            completed = found.endings[k, one.branch.index] == COMPLETED
            assert completed == one.motion.completed
            least = one.closest_approach.value if completed else 0.0
            assert found.margins[k, one.branch.index] == pytest.approx(least, rel=1e-3)
            keeps = completed and is_kept(one.closest_approach.value, 30.0)
            assert found.feasible[k, one.branch.index] == keeps


def test_shares_are_those_of_attitudes_drawn_at_random(
    found: AttitudeMap, outlook: FeasibilityEvaluator
) -> None:
    """Within four standard errors of both, for any branch and for all motions."""
    count = 2000
    drawn_at_random = Rotation.random(count, rng=np.random.default_rng(12)).as_quat()
    prospects = outlook.evaluate(drawn_at_random)
    keeps = prospects.margins >= 30.0
    share = keeps.any(axis=1).mean()
    error = np.hypot(found.feasible_fraction_error, np.sqrt(share * (1.0 - share) / count))
    assert abs(found.feasible_fraction - share) < 4.0 * error
    assert 0.4 < share < 0.8
    assert found.motion_fraction == pytest.approx(keeps.mean(), abs=0.05)
    assert found.motions == (found.endings != UNREACHED).sum() == 8 * SAMPLES


def test_counts_of_a_map_made_by_hand(problem: Problem) -> None:
    """Four attitudes, two branches: singular, missing, broken and kept margins."""
    least = np.array([[31.0, 0.0], [50.0, 29.0], [0.0, 10.0], [30.0, 60.0]])
    endings = np.array([[0, -1], [SINGULAR, 0], [-1, 0], [0, 0]], dtype=np.int8)
    one = drawn(problem, attitude_grid(8)[:4], least, endings)
    np.testing.assert_array_equal(one.margins, [[31.0, 0.0], [0.0, 29.0], [0.0, 10.0], [30, 60]])
    np.testing.assert_array_equal(one.feasible, [[1, 0], [0, 0], [0, 0], [1, 1]])
    assert one.motions == 6
    assert one.feasible_fraction == 0.5
    assert one.feasible_fraction_error == pytest.approx(0.25)
    assert one.motion_fraction == 0.5


def test_fractions_of_a_map_without_motions_are_zero(problem: Problem) -> None:
    endings = np.full((8, 8), UNREACHED, dtype=np.int8)
    none = drawn(problem, attitude_grid(8), np.zeros((8, 8)), endings)
    assert none.motions == none.motion_fraction == none.feasible_fraction == 0.0
    assert none.branch_margins() == []
    assert find_regions(none) == ()


@pytest.mark.parametrize("samples", [48, 101])
def test_blocks_leave_no_seam(
    outlook: FeasibilityEvaluator, monkeypatch: pytest.MonkeyPatch, samples: int
) -> None:
    """A block at a time or at once, to the bit; the last one may be smaller."""
    whole = sample_attitudes(outlook, samples)
    monkeypatch.setattr(mapping, "_BLOCK", 16)
    shares: list[float] = []
    blocks = sample_attitudes(outlook, samples, progress=shares.append)
    for name in ("attitudes", "minimum_margins", "endings"):
        np.testing.assert_array_equal(getattr(blocks, name), getattr(whole, name))
    assert blocks.details["joints"].shape == whole.details["joints"].shape
    assert shares == sorted(shares)
    assert shares[0] > 0.0
    assert shares[-1] == pytest.approx(1.0)


def test_a_seed_turns_the_grid(outlook: FeasibilityEvaluator) -> None:
    """The same seed gives the same map to the bit."""
    one, same, other = (sample_attitudes(outlook, 32, seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(one.attitudes, attitude_grid(32, 5))
    np.testing.assert_array_equal(one.attitudes, same.attitudes)
    np.testing.assert_array_equal(one.minimum_margins, same.minimum_margins)
    np.testing.assert_array_equal(one.endings, same.endings)
    assert (one.seed, other.seed) == (5, 6)
    assert np.abs(one.attitudes - other.attitudes).max() > 0.01
    assert np.abs(one.minimum_margins - other.minimum_margins).max() > 0.01


def test_threads_do_not_matter(problem: Problem, outlook: FeasibilityEvaluator) -> None:
    one, two = (
        sample_attitudes(outlook, 128, 1),
        sample_attitudes(FeasibilityEvaluator(problem, 2), 128, 1),
    )
    np.testing.assert_array_equal(one.minimum_margins, two.minimum_margins)
    np.testing.assert_array_equal(one.endings, two.endings)


def test_planar_tasks_and_few_samples_are_refused(outlook: FeasibilityEvaluator) -> None:
    with pytest.raises(InputError) as caught:
        sample_attitudes(FeasibilityEvaluator(bundled("planar_3dof/parabola"), 1), 64)
    assert caught.value.key == "task"
    for samples in (7, 0, -3):
        with pytest.raises(InputError) as caught:
            sample_attitudes(outlook, samples)
        assert caught.value.key == "samples"
    assert len(sample_attitudes(outlook, 8).attitudes) == 8


def test_depths_are_angles_to_the_nearest_outside() -> None:
    """Whatever the signs of the quaternions."""
    rng = np.random.default_rng(4)
    attitudes = attitude_grid(200) * rng.choice([-1.0, 1.0], (200, 1))
    inside = angle_between(attitudes, attitudes[0]) < 1.6
    expected = np.zeros(200)
    for k in np.flatnonzero(inside):
        expected[k] = angle_between(attitudes[k], attitudes[~inside]).min()
    np.testing.assert_allclose(depths(attitudes, inside), expected, atol=1e-9)
    assert (depths(attitudes, np.full(200, True)) == np.pi).all()
    assert (depths(attitudes, np.full(200, False)) == 0.0).all()


CENTERS = np.array([[0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0]])
RADII = (0.9, 0.6)


def balls(attitudes: np.ndarray) -> np.ndarray:
    """Which attitudes lie in the two balls, a half turn apart; shape (2, N)."""
    return np.array([
        angle_between(attitudes, center) < radius
        for center, radius in zip(CENTERS, RADII, strict=True)
    ])  # fmt: skip


def test_two_balls_are_two_regions(problem: Problem) -> None:
    """Their sizes, centres and depths; the signs of quaternions cut nothing."""
    N = 4096
    attitudes = attitude_grid(N, 2) * np.random.default_rng(9).choice([-1.0, 1.0], (N, 1))
    held = balls(attitudes)
    least = np.zeros((N, 8))
    least[:, 2] = np.where(held.any(axis=0), 40.0, 29.0)
    parts = find_regions(drawn(problem, attitudes, least))
    assert [part.branch for part in parts] == [2, 2]
    for part, mine, center, radius in zip(parts, held, CENTERS, RADII, strict=True):
        assert part.fraction == pytest.approx(mine.mean())
        assert part.error == pytest.approx(np.sqrt(mine.mean() * (1 - mine.mean()) / N))
        assert angle_between(part.centre, center) < grid_spacing(N)
        assert part.depth == pytest.approx(radius, abs=grid_spacing(N))
        assert not part.centre.flags.writeable
        outside = attitudes[~held.any(axis=0)]
        assert part.depth == pytest.approx(angle_between(outside, part.centre).min())


def test_balls_of_different_branches_are_not_joined(problem: Problem) -> None:
    """Though they are the same attitudes; a twin, an odd branch, is not told again."""
    N = 1024
    attitudes = attitude_grid(N)
    least = np.zeros((N, 8))
    least[:, [0, 1, 4]] = np.where(balls(attitudes)[0], 40.0, 0.0)[:, None]
    parts = find_regions(drawn(problem, attitudes, least))
    assert [part.branch for part in parts] == [0, 4]
    assert parts[0].fraction == parts[1].fraction == balls(attitudes)[0].mean()


def test_a_ring_hangs_together(problem: Problem) -> None:
    """All attitudes about one axis, a closed line through SO(3) that comes back with -q."""
    N = 4096
    attitudes = attitude_grid(N)
    about_z = np.hypot(attitudes[:, 0], attitudes[:, 1]) < np.sin(0.2)
    least = np.zeros((N, 8))
    least[:, 0] = 40.0 * about_z
    (part,) = find_regions(drawn(problem, attitudes, least))
    assert part.fraction == about_z.mean()


def test_one_sample_is_a_region_and_all_of_so3_is_one(problem: Problem) -> None:
    attitudes = attitude_grid(64)
    least = np.zeros((64, 8))
    least[17, 0] = 40.0
    least[:, 2] = 40.0
    whole, single = find_regions(drawn(problem, attitudes, least))
    assert (whole.branch, whole.fraction, whole.depth) == (2, 1.0, np.pi)
    assert (single.branch, single.fraction) == (0, 1 / 64)
    np.testing.assert_array_equal(single.centre, attitudes[17])


def test_regions_of_the_example_make_up_its_branches(found: AttitudeMap) -> None:
    """Their fractions add up to the branch's share, and the largest comes first."""
    parts = find_regions(found)
    fractions = [part.fraction for part in parts]
    assert fractions == sorted(fractions, reverse=True)
    families = dict(found.branch_margins())
    assert list(families) == [0, 2, 4, 6]
    for branch, margins in families.items():
        np.testing.assert_array_equal(margins, found.margins[:, branch])
        mine = [part for part in parts if part.branch == branch]
        keeps = margins >= 30.0 * (1.0 - 1e-6)
        assert sum(part.fraction for part in mine) == pytest.approx(keeps.mean())
        outside = found.attitudes[~keeps]
        for part in mine:
            nearest = angle_between(outside, part.centre).min()
            assert part.depth == pytest.approx(nearest, abs=1e-9)


def test_an_arm_without_twins_has_all_its_branches() -> None:
    """Those that some attitude reaches."""
    found = sample_attitudes(FeasibilityEvaluator(bundled("ur5_servicer/arc"), 1), 64)
    numbers = [branch for branch, _ in found.branch_margins()]
    reached = np.flatnonzero((found.endings != UNREACHED).any(axis=0))
    assert numbers == reached.tolist()
    assert any(number % 2 for number in numbers)
    assert 0.0 < found.feasible_fraction < 1.0


def test_a_redundant_arm_has_one_family() -> None:
    """The best of its configurations, whatever their numbers."""
    found = sample_attitudes(FeasibilityEvaluator(bundled("panda_servicer/line"), 1), 12)
    ((branch, margins),) = found.branch_margins()
    assert branch is None
    np.testing.assert_array_equal(margins, found.margins.max(axis=1))
    assert all(part.branch is None for part in find_regions(found))
    assert sum(part.fraction for part in find_regions(found)) == pytest.approx(
        found.feasible_fraction
    )


def test_attitudes_of_a_ball_are_where_their_map_says(problem: Problem) -> None:
    """A map need not be a grid: components follow from the angles alone."""
    near = attitudes_within([0.0, 0.0, 0.0, 1.0], 0.05, 60)
    far = attitudes_within([0.0, 1.0, 0.0, 0.0], 0.05, 40)
    least = np.zeros((100, 8))
    least[:, 0] = 40.0
    parts = find_regions(drawn(problem, np.vstack([near, far]), least))
    assert [part.fraction for part in parts] == [0.6, 0.4]
