"""The best, the nearest and the deepest attitude of exactly known margins."""

from collections.abc import Callable

import numpy as np
import pytest

import freefloat as ff
from freefloat.attitude_grids import attitude_grid
from freefloat.planning.space import climbing as attitude_search
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.choices import nearest_with_spare
from freefloat.planning.space.climbing import nearest_feasible
from freefloat.planning.space.deepest_ball import deepest
from freefloat.planning.space.tolerated_deviations import robust_radius
from freefloat.so3 import angle_between, rotated
from tests.maps import branch_results

MARGIN = 30.0
SURPLUS = attitude_search._CERTAIN
"""Fraction by which compiled motions must exceed a margin."""
HERE, THERE = np.array([0.0, 0.0, 0.0, 1.0]), np.array([0.8, 0.0, 0.6, 0.0])

Margins = Callable[[np.ndarray], np.ndarray]


class Landscape:
    """An evaluator whose margins are functions of the attitude, by branch."""

    sample_reduction, threads = 1, 1

    def __init__(self, problem: ff.Problem, **branches: Margins) -> None:
        self.problem = problem
        self.branches = {int(name[1:]): margins for name, margins in branches.items()}

    def margins(self, attitudes: np.ndarray, branch: int | np.ndarray) -> np.ndarray:
        numbers, result = np.broadcast_to(branch, len(attitudes)), np.zeros(len(attitudes))
        for number, margins in self.branches.items():
            chosen = numbers == number
            result[chosen] = np.maximum(margins(attitudes[chosen]), 0.0)
        return result

    def keeps(
        self, attitudes: np.ndarray, branch: int | np.ndarray, excess: float = 0.0
    ) -> np.ndarray:
        return self.margins(attitudes, branch) >= MARGIN * (1.0 + excess)

    regular = keeps

    def regularity(self, attitudes: np.ndarray, branch: int | np.ndarray) -> np.ndarray:
        return np.repeat(self.margins(attitudes, branch)[:, None] / MARGIN, 2, axis=1)

    def map(self, samples: int, seed: int = 0) -> AttitudeMap:
        attitudes, minimum = attitude_grid(samples, seed), np.zeros((samples, 8))
        for branch, margins in self.branches.items():
            minimum[:, branch] = np.maximum(margins(attitudes), 0.0)
        return AttitudeMap(self.problem, branch_results(attitudes, minimum))


def ball(centre: np.ndarray, radius: float) -> Margins:
    """Margins that are kept in a ball, highest in its middle."""
    return lambda q: MARGIN + 20.0 * (radius - angle_between(q, centre))


def either(*margins: Margins) -> Margins:
    return lambda q: np.max([margin(q) for margin in margins], axis=0)


def test_the_nearest_of_two_parts_and_two_branches_is_taken(margin_30: ff.Problem) -> None:
    """Of a near small ball, a far large one, and another branch's in between."""
    present = rotated(HERE, [0.0, 0.0, 1.3])[0]
    far, third = rotated(present, [0.0, 2.2, 0.0])[0], rotated(present, [1.5, 0.0, 0.0])[0]
    landscape = Landscape(
        margin_30, b0=either(ball(HERE, 0.5), ball(far, 1.0)), b6=ball(third, 0.6)
    )
    candidates = nearest_feasible(landscape, landscape.map(2048), present)
    short = SURPLUS * MARGIN / 20.0
    assert candidates[0].branch == 0
    assert candidates[0].deviation == pytest.approx(0.8 + short, abs=1e-3)
    other = next(entry for entry in candidates if entry.branch == 6)
    assert other.deviation == pytest.approx(0.9 + short, abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("present", "spare"), [(THERE, 0.02), (rotated(HERE, [0.5, 0.4, -0.6])[0], 0.1)]
)
def test_with_spare_the_nearest_of_a_ball_is_that_deep_inside(margin_30, present, spare):
    landscape = Landscape(margin_30, b0=ball(HERE, 0.7))
    (best,) = nearest_with_spare(landscape, landscape.map(512), present, spare)
    depth = 0.7 - angle_between(best.attitude, HERE)
    assert spare <= depth < 1.15 * spare
    assert best.deviation < angle_between(present, HERE) - 0.7 + 1.15 * spare


@pytest.mark.parametrize("samples", [256, 2048])
def test_the_deepest_attitude_of_two_balls_is_the_middle_of_the_larger(margin_30, samples):
    landscape = Landscape(
        margin_30, b0=ball(HERE, 0.6), b2=either(ball(THERE, 0.8), ball(HERE, 0.5))
    )
    best = deepest(landscape, landscape.map(samples))
    assert best is not None
    assert best.branch == 2
    assert 0.95 * 0.8 < best.radius <= 0.8
    assert angle_between(best.attitude, THERE) < 0.05 * 0.8


@pytest.mark.parametrize(("off", "spacing"), [(0.0, 0.1), (0.3, 0.5), (0.65, 0.5)])
def test_the_robust_radius_in_a_ball_is_the_way_to_its_rim(margin_30, off, spacing):
    """Whether the rim is nearer than the first look around, or far beyond it."""
    landscape = Landscape(margin_30, b0=ball(HERE, 0.7))
    attitude = rotated(HERE, [0.0, off, 0.0])[0]
    radius = robust_radius(landscape, attitude, 0, spacing)
    assert 0.94 * (0.7 - off) < radius <= 0.7 - off
