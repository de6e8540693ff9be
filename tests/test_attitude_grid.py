"""Grids of SO(3), and attitudes in its balls."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from freefloat.attitude_grids import attitude_grid, attitudes_within, grid_spacing
from freefloat.so3 import angle_between, rotated, rotation_vector_to


def random_attitudes(count: int, seed: int) -> np.ndarray:
    return Rotation.random(count, rng=np.random.default_rng(seed)).as_quat()


def angles_to_nearest(attitudes: np.ndarray, others: np.ndarray, rank: int = 1) -> np.ndarray:
    """Angles [rad] from attitudes to the nearest of others, or to the second nearest."""
    chords, _ = cKDTree(np.vstack([others, -others])).query(attitudes, k=[rank])
    return 4.0 * np.arcsin(chords[:, 0] / 2.0)


@pytest.mark.parametrize(("count", "seed"), [(1, 0), (2, 3), (7, 0), (1000, 3)])
def test_grids_consist_of_distinct_unit_quaternions(count: int, seed: int) -> None:
    grid = attitude_grid(count, seed)
    assert grid.shape == (count, 4)
    np.testing.assert_allclose(np.linalg.norm(grid, axis=1), 1.0, atol=1e-14)
    if count > 1:
        assert angles_to_nearest(grid, grid, 2).min() > 0.2 * grid_spacing(count)


@pytest.mark.parametrize("count", [256, 5000])
def test_grid_is_more_even_than_random_attitudes(count: int) -> None:
    grid, spacing = attitude_grid(count), grid_spacing(count)
    gap = angles_to_nearest(random_attitudes(20_000, 1), grid)
    assert gap.max() < 1.15 * spacing
    assert angles_to_nearest(grid, grid, 2).min() > 0.4 * spacing
    drawn = random_attitudes(count, 2)
    assert angles_to_nearest(random_attitudes(20_000, 1), drawn).max() > 1.25 * spacing


def test_seed_rotates_the_whole_grid() -> None:
    """Every attitude by the same rotation; the same at every call."""
    plain, other = attitude_grid(300), attitude_grid(300, 7)
    np.testing.assert_array_equal(other, attitude_grid(300, 7))
    np.testing.assert_array_equal(plain, attitude_grid(300, 0))
    vectors = rotation_vector_to(plain, other)
    np.testing.assert_allclose(vectors, np.broadcast_to(vectors[0], vectors.shape), atol=1e-12)
    assert np.linalg.norm(vectors[0]) > 0.1
    np.testing.assert_allclose(
        angle_between(plain[:, None], plain), angle_between(other[:, None], other), atol=1e-7
    )
    assert angle_between(other[0], attitude_grid(300, 8)[0]) > 0.01


@pytest.mark.parametrize("radius", [1e-4, 0.3, 2.0, np.pi])
def test_ball_is_sampled_evenly(radius: float) -> None:
    """By the volume theta - sin theta of smaller balls, and in all directions."""
    centre = np.array([0.1, 0.5, 0.2, -0.8367])
    centre /= np.linalg.norm(centre)
    cloud = attitudes_within(centre, radius, 4000, 5)
    np.testing.assert_allclose(np.linalg.norm(cloud, axis=1), 1.0, atol=1e-12)
    angles = angle_between(cloud, centre)
    assert angles.max() <= radius * (1.0 + 1e-9)
    for fraction in (0.25, 0.5, 0.8):
        inner = fraction * radius
        volume = (
            (inner - np.sin(inner)) / (radius - np.sin(radius)) if radius > 0.01 else fraction**3
        )
        assert (angles < inner).mean() == pytest.approx(volume, abs=4e-3)
    directions = rotation_vector_to(centre, cloud) / angles[:, None]
    for axis in np.vstack([np.eye(3), [[0.6, 0.0, -0.8]]]):
        assert (directions @ axis > 0.0).mean() == pytest.approx(0.5, abs=0.01)
        assert (directions @ axis > 0.5).mean() == pytest.approx(0.25, abs=0.01)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 0.7, 3.0, np.pi - 1e-6, np.pi])
def test_angle_between_attitudes(angle: float) -> None:
    """Whatever the signs of the quaternions, up to pi."""
    start = random_attitudes(20, 6)
    axis = np.array([0.48, -0.6, 0.64])
    end = (Rotation.from_rotvec(angle * axis) * Rotation.from_quat(start)).as_quat()
    for sign in (1.0, -1.0):
        np.testing.assert_allclose(angle_between(start, sign * end), angle, atol=1e-7, rtol=1e-7)
        np.testing.assert_allclose(angle_between(-sign * end, start), angle, atol=1e-7, rtol=1e-7)
        vectors = rotation_vector_to(start, sign * end)
        np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), angle, atol=1e-9)
        np.testing.assert_allclose(angle_between(rotated(start, vectors), end), 0.0, atol=1e-7)
