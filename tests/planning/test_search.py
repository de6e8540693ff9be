"""The best, the nearest and the deepest attitude, on landscapes known exactly and in Example 2."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.kernels.integration import COMPLETED
from freefloat.io.scenario import load_scenario
from freefloat.motion.problem import Margin, Problem
from freefloat.planning import search as attitude_search
from freefloat.planning.attitude_map import AttitudeMap, Candidate
from freefloat.planning.mapping import sample_attitudes
from freefloat.planning.robustness import deepest, safe_radius
from freefloat.planning.search import (
    largest_margins,
    nearest_feasible,
)
from freefloat.so3 import (
    angle_between,
    attitude_grid,
    attitudes_within,
    grid_spacing,
    rotated,
    rotation_vector_to,
)

MARGIN = 30.0
SURPLUS = attitude_search._CERTAIN
"""Share by which compiled motions must exceed a margin to be trusted."""
BAD = np.array([0.1, 0.5, 0.2, -0.8367]) / np.linalg.norm([0.1, 0.5, 0.2, -0.8367])
HERE, THERE = np.array([0.0, 0.0, 0.0, 1.0]), np.array([0.8, 0.0, 0.6, 0.0])

Margins = Callable[[np.ndarray], np.ndarray]


@pytest.fixture(scope="module")
def problem() -> Problem:
    """Example 2 with a margin that two fifths of the attitudes break."""
    easy = load_scenario("spatial_6dof/line").problem()
    return replace(easy, margin=Margin(easy.margin.measure, MARGIN))


class Landscape:
    """An evaluator whose margins are functions of the attitude, by branch."""

    sample_reduction = 1

    def __init__(self, problem: Problem, **branches: Margins) -> None:
        self.problem = problem
        self.branches = {int(name[1:]): margins for name, margins in branches.items()}

    def margins(self, attitudes: np.ndarray, branch: int) -> np.ndarray:
        if branch not in self.branches:
            return np.zeros(len(attitudes))
        return np.maximum(self.branches[branch](attitudes), 0.0)

    def keeps(self, attitudes: np.ndarray, branch: int) -> np.ndarray:
        return self.margins(attitudes, branch) >= MARGIN

    regular = keeps

    def map(self, samples: int, seed: int = 0) -> AttitudeMap:
        attitudes, least = attitude_grid(samples, seed), np.zeros((samples, 8))
        for branch, margins in self.branches.items():
            least[:, branch] = np.maximum(margins(attitudes), 0.0)
        endings = np.full(least.shape, COMPLETED, dtype=np.int8)
        return AttitudeMap(self.problem, 0, attitudes, least, np.ones(least.shape), endings)


def ball(center: np.ndarray, radius: float) -> Margins:
    """Margins that are kept in a ball, highest in its middle."""
    return lambda some: MARGIN + 20.0 * (radius - angle_between(some, center))


def either(*margins: Margins) -> Margins:
    return lambda some: np.max([one(some) for one in margins], axis=0)


def both(*margins: Margins) -> Margins:
    return lambda some: np.min([one(some) for one in margins], axis=0)


def without(center: np.ndarray, radius: float) -> Margins:
    return lambda some: MARGIN + 20.0 * (angle_between(some, center) - radius)


def near_ring(width: float) -> Margins:
    """Kept by attitudes not farther than a width from a turn about z."""
    return lambda some: (
        MARGIN + 20.0 * (width - 2.0 * np.arcsin(np.minimum(np.hypot(some[:, 0], some[:, 1]), 1.0)))
    )


# landscapes known exactly


def test_the_highest_peak_is_climbed_though_samples_tell_of_another(problem: Problem) -> None:
    """A narrow peak between the samples beats a broad one on them."""
    grid = attitude_grid(512)
    narrow, broad = rotated(grid[7], [0.12, -0.1, 0.05])[0], grid[300]

    def peaks(some: np.ndarray) -> np.ndarray:
        high = 50.0 * np.exp(-4.0 * angle_between(some, narrow) ** 2)
        return np.maximum(high, 47.0 * np.exp(-(angle_between(some, broad) ** 2)))

    land = Landscape(problem, b2=peaks)
    found = land.map(512)
    assert np.argmax(found.margins[:, 2]) == 300
    best, *others = largest_margins(land, found)
    assert best.branch == 2
    assert best.score == pytest.approx(50.0, abs=1e-4)
    assert angle_between(best.attitude, narrow) < 1e-3
    assert all(one.score <= best.score for one in others)
    assert any(one.score == pytest.approx(47.0, abs=1e-2) for one in others)


def test_every_branch_has_its_own_peak(problem: Problem) -> None:
    land = Landscape(problem, b0=ball(HERE, 0.5), b4=ball(THERE, 0.6))
    best = largest_margins(land, land.map(256))[0]
    assert best.branch == 4
    assert angle_between(best.attitude, THERE) < 1e-3
    np.testing.assert_allclose(land.margins(best.attitude[None], 4), best.score)


def test_without_any_margin_there_is_no_peak(problem: Problem) -> None:
    land = Landscape(problem, b0=lambda some: np.zeros(len(some)))
    assert largest_margins(land, land.map(64)) == []


@pytest.mark.parametrize("now", [THERE, -THERE, rotated(HERE, [0.5, 0.4, -0.6])[0]])
def test_the_nearest_attitude_of_a_ball_is_on_the_way_to_its_centre(
    problem: Problem, now: np.ndarray
) -> None:
    """But for the small share by which compiled motions must keep more than the margin."""
    land, radius = Landscape(problem, b0=ball(HERE, 0.7)), 0.7 - SURPLUS * MARGIN / 20.0
    found = land.map(512)
    best, *others = nearest_feasible(land, found, now)
    assert best.score == pytest.approx(angle_between(now, HERE) - radius, rel=1e-3)
    assert best.score == pytest.approx(angle_between(now, best.attitude), abs=1e-9)
    assert land.margins(best.attitude[None], 0)[0] == pytest.approx(
        MARGIN * (1.0 + SURPLUS), abs=2e-3
    )
    assert all(land.keeps(one.attitude[None], one.branch)[0] for one in others)
    merits = [one.score for one in (best, *others)]
    assert merits == sorted(merits)


def test_the_nearest_of_two_parts_and_two_branches_is_taken(problem: Problem) -> None:
    """Of a near small ball, a far large one, and another branch's in between."""
    now = rotated(HERE, [0.0, 0.0, 1.3])[0]
    far = rotated(now, [0.0, 2.2, 0.0])[0]
    third = rotated(now, [1.5, 0.0, 0.0])[0]
    land = Landscape(problem, b0=either(ball(HERE, 0.5), ball(far, 1.0)), b6=ball(third, 0.6))
    candidates = nearest_feasible(land, land.map(2048), now)
    short = SURPLUS * MARGIN / 20.0
    assert candidates[0].branch == 0
    assert candidates[0].score == pytest.approx(0.8 + short, abs=1e-3)
    other = next(one for one in candidates if one.branch == 6)
    assert other.score == pytest.approx(0.9 + short, abs=1e-3)


def test_around_a_corner_the_nearest_is_the_corner_of_the_set(problem: Problem) -> None:
    """Where two balls overlap in a lens: the closest place by brute force."""
    a, b = rotated(HERE, [0.0, 0.4, 0.0])[0], rotated(HERE, [0.0, -0.4, 0.0])[0]
    now = rotated(HERE, [1.5, 0.2, 0.3])[0]
    land = Landscape(problem, b2=both(ball(a, 0.8), ball(b, 0.8)))
    best = nearest_feasible(land, land.map(1024), now)[0]
    cloud = attitudes_within(now, best.score, 50_000)
    held = land.margins(cloud, 2) >= MARGIN * (1.0 + SURPLUS)
    nearest = angle_between(cloud[held], now).min(initial=best.score)
    assert best.score - nearest < np.radians(0.05)


def test_where_the_margin_is_kept_already_nothing_is_nearer(problem: Problem) -> None:
    """In one branch; the other still tells its own."""
    land = Landscape(problem, b0=ball(HERE, 0.7), b2=ball(THERE, 0.7))
    now = rotated(HERE, [0.3, 0.0, 0.0])[0]
    best, *others = nearest_feasible(land, land.map(512), now)
    assert (best.branch, best.score) == (0, 0.0)
    np.testing.assert_array_equal(best.attitude, now)
    assert {one.branch for one in others} == {2}


def test_no_feasible_sample_means_no_nearest_attitude(problem: Problem) -> None:
    land = Landscape(problem, b0=ball(HERE, -0.1))
    assert nearest_feasible(land, land.map(64), THERE) == []


@pytest.mark.parametrize("samples", [256, 2048])
def test_the_deepest_attitude_of_two_balls_is_the_middle_of_the_larger(
    problem: Problem, samples: int
) -> None:
    land = Landscape(problem, b0=ball(HERE, 0.6), b2=either(ball(THERE, 0.8), ball(HERE, 0.5)))
    best = deepest(land, land.map(samples))
    assert best is not None
    assert best.branch == 2
    assert 0.95 * 0.8 < best.score <= 0.8
    assert angle_between(best.attitude, THERE) < 0.05 * 0.8


def test_a_hole_in_the_middle_is_kept_clear_of(problem: Problem) -> None:
    """A shell: balls that fit are half as wide as it is thick."""
    land = Landscape(problem, b0=both(ball(HERE, 1.4), without(HERE, 0.2)))
    best = deepest(land, land.map(512))
    assert best is not None
    assert 0.95 * 0.6 < best.score <= 0.6
    assert angle_between(best.attitude, HERE) == pytest.approx(0.8, abs=0.04)


def test_a_ring_is_as_deep_as_it_is_wide(problem: Problem) -> None:
    land = Landscape(problem, b4=near_ring(0.7))
    best = deepest(land, land.map(512))
    assert best is not None
    assert 0.95 * 0.7 < best.score <= 0.7
    assert np.hypot(*best.attitude[:2]) < np.sin(0.02)


def test_where_everything_serves_any_ball_does(problem: Problem) -> None:
    land = Landscape(problem, b0=lambda some: np.full(len(some), 40.0))
    best = deepest(land, land.map(64))
    assert best is not None
    assert best.score == pytest.approx(np.pi, rel=0.02)


def test_the_deepest_of_a_tiny_set_lies_inside(problem: Problem) -> None:
    """A single sample serves, hardly anything around it."""
    land = Landscape(problem, b0=ball(attitude_grid(64)[5], 0.01))
    best = deepest(land, land.map(64))
    assert best is not None
    assert land.keeps(best.attitude[None], 0)[0]


def test_where_nothing_serves_there_is_no_deepest(problem: Problem) -> None:
    land = Landscape(problem, b0=ball(HERE, -1.0))
    assert deepest(land, land.map(64)) is None


@pytest.mark.parametrize("off", [0.0, 0.3, 0.65])
@pytest.mark.parametrize("spacing", [0.1, 0.5])
def test_the_safe_radius_in_a_ball_is_the_way_to_its_rim(
    problem: Problem, off: float, spacing: float
) -> None:
    """Whether the rim is nearer than the first look around, or far beyond it."""
    land = Landscape(problem, b0=ball(HERE, 0.7))
    attitude = rotated(HERE, [0.0, off, 0.0])[0]
    radius = safe_radius(land, attitude, 0, spacing)
    assert 0.94 * (0.7 - off) < radius <= 0.7 - off


def test_a_small_hole_nearby_limits_the_safe_radius(problem: Problem) -> None:
    hole = rotated(HERE, [0.35, 0.0, 0.0])[0]
    land = Landscape(problem, b0=both(ball(HERE, 0.9), without(hole, 0.1)))
    assert 0.94 * 0.25 < safe_radius(land, HERE, 0, 0.4) <= 0.25


# Example 2


@pytest.fixture(scope="module")
def outlook(problem: Problem) -> FeasibilityEvaluator:
    return FeasibilityEvaluator(problem, 1)


@pytest.fixture(scope="module")
def found(outlook: FeasibilityEvaluator) -> AttitudeMap:
    return sample_attitudes(outlook, 512)


@pytest.fixture(scope="module")
def peaks(outlook: FeasibilityEvaluator, found: AttitudeMap) -> list[Candidate]:
    return largest_margins(outlook, found)


def test_refined_margins_beat_every_sample(
    outlook: FeasibilityEvaluator, found: AttitudeMap, peaks: list[Candidate]
) -> None:
    assert peaks[0].score >= found.margins.max()
    assert [one.score for one in peaks[:4]] == sorted((p.score for p in peaks[:4]), reverse=True)
    for one in peaks[:4]:
        again = outlook.margins(one.attitude[None], one.branch)
        assert again[0] == pytest.approx(one.score, rel=1e-12)


def test_the_largest_margin_is_a_local_maximum(
    outlook: FeasibilityEvaluator, peaks: list[Candidate]
) -> None:
    """Nothing around it is better, near or far."""
    best = peaks[0]
    for radius in (1e-4, 1e-3, 1e-2, 0.1, 0.5):
        around = attitudes_within(best.attitude, radius, 200, 17)
        assert outlook.margins(around, best.branch).max() < best.score * (1.0 + 1e-4)


NOWS = [BAD, *Rotation.random(60, rng=np.random.default_rng(77)).as_quat()]


@pytest.fixture(scope="module")
def infeasible(outlook: FeasibilityEvaluator) -> list[np.ndarray]:
    """The paper's bad attitude and two more."""
    keeps = outlook.keeps(np.array(NOWS), None)
    assert not keeps[0]
    return [np.array(NOWS[k]) for k in np.flatnonzero(~keeps)[:3]]


def test_the_nearest_feasible_attitude_lies_on_the_boundary(
    outlook: FeasibilityEvaluator, found: AttitudeMap, infeasible: list[np.ndarray]
) -> None:
    """Nearer than any sample; a little nearer on the same way the margin is broken."""
    for now in infeasible:
        best, *others = nearest_feasible(outlook, found, now)
        samples = angle_between(found.attitudes[found.feasible.any(axis=1)], now)
        assert 0.0 < best.score <= samples.min()
        assert best.score == pytest.approx(angle_between(best.attitude, now))
        assert [one.score for one in others] == sorted(one.score for one in others)
        for one in (best, *others):
            assert outlook.keeps(one.attitude[None], one.branch)[0]
        back = rotation_vector_to(best.attitude, now) / best.score
        for degrees in (0.1, 0.3, 1.0):
            nearer = rotated(best.attitude, np.radians(degrees) * back)
            assert not outlook.keeps(nearer, best.branch)[0]


def test_no_random_attitude_is_feasible_and_nearer(
    outlook: FeasibilityEvaluator, found: AttitudeMap, infeasible: list[np.ndarray]
) -> None:
    """By more than a twentieth of a degree, among 20,000 in the ball that would hold it."""
    now = infeasible[0]
    best = nearest_feasible(outlook, found, now)[0]
    cloud = attitudes_within(now, best.score, 20_000, 3)
    keeps = outlook.keeps(cloud, best.branch)
    nearest = angle_between(cloud[keeps], now).min(initial=best.score)
    assert best.score - nearest < np.radians(0.05)


def test_the_nearest_to_a_feasible_attitude_is_itself(
    outlook: FeasibilityEvaluator, found: AttitudeMap
) -> None:
    k = int(np.argmax(found.margins.max(axis=1)))
    best = nearest_feasible(outlook, found, found.attitudes[k])[0]
    assert best.score == 0.0
    np.testing.assert_array_equal(best.attitude, found.attitudes[k])


def test_the_safe_radius_is_that_of_the_nearest_failure(
    outlook: FeasibilityEvaluator, found: AttitudeMap, peaks: list[Candidate]
) -> None:
    """Along 500 directions nothing fails within; a tenth farther out something does."""
    best = peaks[0]
    radius = safe_radius(outlook, best.attitude, best.branch, grid_spacing(len(found.attitudes)))
    directions = np.random.default_rng(8).normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    for share in (0.3, 0.6, 0.8, 0.9, 0.95, 1.0):
        within = rotated(best.attitude, share * radius * directions)
        assert outlook.regular(within, best.branch).all(), share
    beyond = rotated(best.attitude, 1.1 * radius * directions)
    assert not outlook.regular(beyond, best.branch).all()
