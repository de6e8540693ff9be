"""Adversarial searches find narrow violations in balls of deviations."""

from __future__ import annotations

import numpy as np
import pytest

from freefloat.planning.candidates import SearchEffort
from freefloat.planning.searches.adversary import confirmed_radius, violations

EFFORT = SearchEffort(samples=512, descents=12)


def hidden(direction: np.ndarray, width: float, *, column: int = 0) -> object:
    """Regularity with a valley along a direction, too narrow for samples, beyond length 1."""

    def regularity(vectors: np.ndarray) -> np.ndarray:
        lengths = np.linalg.norm(vectors, axis=1)
        across = np.linalg.norm(np.cross(vectors, direction), axis=1)
        behind = vectors @ direction < 0.0
        valley = np.hypot(across, 0.02) / width + 1.0 - lengths + 3.0 * behind
        values = np.full((len(vectors), 2), 2.0)
        values[:, column] = 1.0 + valley
        return values

    return regularity


@pytest.mark.parametrize("column", [0, 1])
@pytest.mark.parametrize("number", range(2))
def test_a_violation_between_the_samples_is_found(number: int, column: int) -> None:
    """The violating cap is a thousandth of the sphere; the other requirement hides nothing."""
    direction = np.random.default_rng(number).normal(size=3)
    direction /= np.linalg.norm(direction)
    regularity = hidden(direction, 0.5, column=column)
    found = violations(regularity, 1.08, EFFORT)
    assert len(found)
    assert (regularity(found).min(axis=1) < 1.0).all()
    assert np.linalg.norm(found, axis=1).max() <= 1.08 * (1.0 + 1e-12)


def test_the_confirmed_radius_is_just_below_the_closest_violation() -> None:
    direction = np.array([0.6, 0.0, 0.8])
    radius = confirmed_radius(hidden(direction, 0.5), 2.0, EFFORT, 1e-5)
    assert 0.97 * 1.04 < radius < 1.04


@pytest.mark.parametrize("seed", [4, 6, 7])
def test_a_thin_sheet_of_violations_is_followed_to_where_it_is_closest(seed: int) -> None:
    """It is a plane at distance 1 from the centre; samples meet it far from there."""
    normal = np.random.default_rng(seed).normal(size=3)
    normal /= np.linalg.norm(normal)

    def regularity(vectors: np.ndarray) -> np.ndarray:
        values = 0.5 + np.abs(vectors @ normal - 1.0) / 1e-3
        return np.column_stack([np.minimum(values, 3.0), np.full(len(vectors), 3.0)])

    assert 0.97 < confirmed_radius(regularity, 1.6, EFFORT, 1e-5) < 1.01
