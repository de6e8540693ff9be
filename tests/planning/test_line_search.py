"""Functions of one variable are sampled until no gap between kept samples can hide."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from freefloat.planning.searches.line_search import Samples, resolved

SPACING = 0.1


def searched(slack: Callable[[np.ndarray], np.ndarray], widest: float = 1.0) -> Samples:
    """Samples of a function on [0, 10), at first in steps of 0.1."""

    def function(points: np.ndarray, _: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values = slack(points)
        return np.maximum(values, -1.0)[:, None], values >= 0.0

    points = np.arange(0.0, 10.0, SPACING)
    first = Samples(points, *function(points, np.zeros(len(points))))
    (line,) = resolved(function, [first], widest, 1e-5, 1e-8, 8)
    assert (np.diff(line.points) >= 0.0).all()
    return line


def ends(line: Samples) -> np.ndarray:
    """Where kept samples begin or end."""
    (index,) = np.nonzero(line.kept[:-1] != line.kept[1:])
    assert np.diff(line.points)[index].max(initial=0.0) <= 1e-8
    return line.points[index]


@pytest.mark.parametrize("depth", [1e-2, 1e-5])
@pytest.mark.parametrize("place", [3.03, 4.871])
def test_a_gap_narrower_than_the_spacing_is_found(place: float, depth: float) -> None:
    """At the bottom of a parabola, down to 0.3 percent of the spacing."""
    line = searched(lambda x: (x - place) ** 2 * 3.0 - depth)
    half = np.sqrt(depth / 3.0)
    assert ends(line) == pytest.approx([place - half, place + half], abs=1e-7)


def test_a_gap_in_a_sharp_valley_on_a_slope_is_found() -> None:
    """No sample is a local minimum there."""

    def slack(x: np.ndarray) -> np.ndarray:
        return 0.3 * x - 1.4 * np.maximum(0.0, 1.0 - np.abs(x - 4.043) / 0.11)

    assert slack(np.array([4.0, 4.1])).min() > 0.0
    assert slack(np.array([4.043]))[0] < 0.0
    assert len(ends(searched(slack))) >= 2


def test_a_gap_next_to_the_end_of_a_range_is_found() -> None:
    """Between the end and the first sample inside."""
    line = searched(lambda x: np.minimum(x - 2.02, (x - 2.06) ** 2 * 40.0 - 1e-3))
    assert ends(line)[-1] == pytest.approx(2.06 + np.sqrt(1e-3 / 40.0), abs=1e-7)


def test_smooth_functions_far_from_zero_need_few_samples() -> None:
    line = searched(lambda x: 5.0 + np.sin(x))
    assert line.kept.all()
    assert len(line.points) < 150


def test_kept_neighbours_are_no_farther_apart_than_the_widest() -> None:
    line = searched(lambda x: np.full(x.shape, 7.0), widest=0.03)
    assert np.diff(line.points).max() <= 0.03
