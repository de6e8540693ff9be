"""Joint ranges and clearances of loops, required where a loop violates them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.limits.pairs import CollisionPairs
from freefloat.planning.joints.loop_bounds import LoopBounds, Places
from freefloat.planning.joints.loop_search import LoopSearch

BENT = np.array([0.0, 0.8, -1.2, 0.0, 0.6, 0.0])
CLEARANCE = 0.05


@pytest.fixture(scope="module")
def search() -> LoopSearch:
    model = ff.FreeFloatingModel.from_urdf("spatial_6dof")
    pairs = CollisionPairs(model, CLEARANCE)
    return LoopSearch(model, BENT, np.ones(6), 2, 1.0, pairs, CLEARANCE)


def clearances(search: LoopSearch, coefficients: np.ndarray) -> np.ndarray:
    """Smallest distance of each pair along a loop, finely sampled."""
    every = np.arange(len(search.pairs.pairs))
    loop = search.loops(coefficients, 1)
    joints = loop.at(np.linspace(0.0, 1.0, 601))
    return np.array([search.pairs.distances(q, every) for q in joints]).min(axis=0)


@pytest.mark.slow
def test_a_loop_is_bounded_where_it_collides_and_keeps_the_clearance_then(search) -> None:
    rotation = Rotation.from_rotvec([0.0, 0.25, 0.2])
    free = search.unbounded(rotation, search.random(np.random.default_rng(3)))
    assert clearances(search, free).min() < CLEARANCE
    found = search.shortest(rotation, free)
    assert clearances(search, found).min() >= CLEARANCE
    assert search.mean_square(found) > search.mean_square(free)
    assert np.linalg.norm(search._error(found, rotation)) < 1e-9


def test_violated_bounds_are_those_of_a_finely_sampled_loop(search) -> None:
    bounds, large = search.bounds, 1.5 * search.random(np.random.default_rng(1))
    found = bounds.violated(large)
    pairs = found.bounds[found.bounds >= 12] - 12
    nearest = clearances(search, large)
    assert set(np.flatnonzero(nearest < CLEARANCE - 5e-3)) <= set(pairs)
    assert (nearest[pairs] < CLEARANCE + 5e-3).all()
    assert (bounds.values(large, found) < 0.0).all()


def test_gradients_are_differences_of_values(search) -> None:
    """Of distances where the shapes do not overlap: a penetration depth is not as smooth."""
    bounds: LoopBounds = search.bounds
    rng, step = np.random.default_rng(2), 1e-3
    coefficients = 0.3 * search.random(rng)
    places = Places(rng.uniform(0.0, 6.28, 24), rng.integers(0, 12 + len(search.pairs.pairs), 24))
    apart = bounds.values(coefficients, places) > -CLEARANCE
    places = Places(places.phases[apart], places.bounds[apart])
    gradients = bounds.gradients(coefficients, places)
    for direction in rng.normal(size=(4, len(coefficients))):
        ends = [bounds.values(coefficients + side * step * direction, places) for side in (1, -1)]
        slope = (ends[0] - ends[1]) / (2.0 * step)
        np.testing.assert_allclose(gradients @ direction, slope, atol=1e-2)
