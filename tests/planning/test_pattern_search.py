"""Pattern searches in sets and on merits known exactly."""

from __future__ import annotations

import numpy as np
import pytest

from freefloat.planning.searches.pattern_search import (
    Clouds,
    Searches,
    pattern_search,
    shortest,
    spread,
)
from freefloat.so3 import angle_between, rotated


def test_the_shortest_vector_of_a_ball_points_to_its_centre() -> None:
    """Two searches of one set and one of another ask together."""
    centres = np.array([[1.0, 0.2, 0.0], [0.0, 0.0, -2.0]])
    groups = np.array([0, 0, 1])
    calls = 0

    def member(vectors: np.ndarray, searched: np.ndarray) -> np.ndarray:
        nonlocal calls
        calls += 1
        return np.linalg.norm(vectors - centres[groups[searched]], axis=1) <= 0.5

    starts = centres[groups] + np.array([[0.3, 0.3, 0.0], [0.0, -0.3, 0.3], [0.3, 0.0, 0.2]])
    lengths = np.linalg.norm(shortest(member, starts, 0.4, groups), axis=1)
    exact = np.linalg.norm(centres, axis=1) - 0.5
    assert lengths[:2].min() == pytest.approx(exact[0], rel=1e-3)
    assert lengths[2] == pytest.approx(exact[1], rel=1e-3)
    assert (lengths >= exact[groups] * (1.0 - 1e-12)).all()
    assert calls <= 14


def test_a_narrow_ridge_is_climbed() -> None:
    """Five times as steep across as along."""
    top = np.array([0.0, 0.0, 0.0, 1.0])

    def merit(attitudes: np.ndarray, _: np.ndarray) -> np.ndarray:
        x, y, z = 2.0 * (attitudes[:, :3] * np.sign(attitudes[:, 3:])).T
        return 1.0 - np.abs(x + y) - 5.0 * np.abs(x - y) - 5.0 * np.abs(z)

    start = rotated(top, [0.1, 0.1, 0.0])
    first = Searches(start, merit(start, np.zeros(1)), np.zeros(1, np.int64))
    last = pattern_search(Clouds(), merit, first, 0.2, 1e-5)
    assert last.merits[0] > 1.0 - 0.5 * (1.0 - first.merits[0])
    assert angle_between(last.points[0], top) < 0.07


def test_vectors_spread_in_directions_begin_with_the_shortest() -> None:
    vectors = np.vstack([np.eye(3), 0.9 * np.array([[1.0, 0.1, 0.0], [1.0, 0.0, 0.0]])])
    np.testing.assert_allclose(spread(vectors, 3)[0], [0.9, 0.0, 0.0])
    assert len(spread(vectors, 3)) == 3
    assert abs(spread(vectors, 3)[1:] @ [1.0, 0.0, 0.0]).max() < 1e-12
