"""Conventions of quaternions, headings, poses and axes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import qmc

import freefloat as ff
from freefloat.attitude_grids import low_discrepancy
from freefloat.rotations import rotation_matrix
from freefloat.so3 import (
    Pose,
    axes_rotation,
    heading_of,
    heading_quaternion,
    rotation_vector_between,
    unit_quaternion,
    unit_vector,
)
from tests.robots import attitudes

X, Y, Z = np.eye(3)


@given(attitude=attitudes, x=st.floats(-3, 3), y=st.floats(-3, 3))
def test_quaternion_follows_from_its_definition(attitude: np.ndarray, x: float, y: float) -> None:
    """R v = v + 2 n (eps x v) + 2 eps x (eps x v)."""
    attitude = attitude / np.linalg.norm(attitude)
    eps, n, v = attitude[:3], attitude[3], np.array([x, y, 0.7])
    expected = v + 2.0 * n * np.cross(eps, v) + 2.0 * np.cross(eps, np.cross(eps, v))
    np.testing.assert_allclose(rotation_matrix(attitude) @ v, expected, atol=1e-13)


@given(heading=st.one_of(st.sampled_from([-1e-17, -1e-300, 2.0 * np.pi]), st.floats(-20.0, 20.0)))
def test_heading_of_its_quaternion(heading: float) -> None:
    """In [0, 2 pi), also for tiny negative angles."""
    attitude = heading_quaternion(heading)
    for sign in (1.0, -1.0):
        back = heading_of(sign * attitude)
        assert abs(np.exp(1j * back) - np.exp(1j * heading)) < 1e-13
        assert 0.0 <= back < 2.0 * np.pi
    np.testing.assert_allclose(
        rotation_matrix(attitude) @ X, [np.cos(heading), np.sin(heading), 0.0], atol=1e-13
    )


def test_pose_seen_from_a_rotated_frame() -> None:
    R0 = Rotation.from_euler("xyz", [0.3, -1.1, 2.0]).as_matrix()
    pose = Pose([1.0, 2.0, 3.0], Rotation.from_euler("zyx", [0.5, 0.6, 0.7]).as_matrix())
    seen = pose.seen_from(R0)
    point = np.array([0.2, -0.4, 0.9])
    world = pose.position + pose.rotation @ point
    np.testing.assert_allclose(R0 @ (seen.position + seen.rotation @ point), world, atol=1e-14)


@given(
    start=attitudes,
    axis=st.sampled_from([X, Y, Z, np.array([0.6, 0.0, 0.8])]),
    angle=st.one_of(st.sampled_from([0.0, 1e-12, 1e-9, 1e-4, np.pi - 1e-6]), st.floats(0.0, 3.1)),
)
def test_rotation_vector_between_two_rotations(
    start: np.ndarray, axis: np.ndarray, angle: float
) -> None:
    """In inertial axes, also for tiny angles."""
    before = rotation_matrix(start / np.linalg.norm(start))
    after = Rotation.from_rotvec(angle * axis).as_matrix() @ before
    np.testing.assert_allclose(rotation_vector_between(before, after), angle * axis, atol=1e-9)


@pytest.mark.parametrize(("exact", "other"), ["xy", "zx", "yy"])
def test_first_axis_is_exact_and_second_is_projected(exact: str, other: str) -> None:
    first, second = np.array([0.4683, 1.1683, -0.7]), np.array([1.5, -0.8, -0.33])
    if exact == other:
        with pytest.raises(ff.InputError):
            axes_rotation("attitude", (exact, first), (other, second))
        return
    R = axes_rotation("attitude", (exact, first), (other, second))
    i, j = "xyz".index(exact), "xyz".index(other)
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-15)
    assert np.linalg.det(R) == pytest.approx(1.0)
    np.testing.assert_allclose(R[:, i], first / np.linalg.norm(first), atol=1e-15)
    assert R[:, j] @ second > 0.0
    assert abs(np.cross(first, second) @ R[:, j]) < 1e-14


def test_directions_are_normalized_and_zero_refused() -> None:
    for size in (1e-300, 1e-9, 1.0, 1e300):
        given_vector = [0, 3 * size, 4 * size]
        np.testing.assert_allclose(unit_vector("axis", given_vector), [0, 0.6, 0.8], atol=1e-15)
    with pytest.raises(ff.InputError, match="axis"):
        unit_vector("axis", [0, 0, 0])


def test_quaternions_with_printed_digits_are_normalized() -> None:
    """Four digits are accepted; a norm off by more than one percent is not."""
    printed = [0.46, 0.0935, 0.7352, -0.489]
    accepted = unit_quaternion("attitude", printed)
    assert np.linalg.norm(accepted) == pytest.approx(1.0, abs=1e-15)
    np.testing.assert_allclose(accepted, printed, atol=2e-3)
    for wrong in ([0, 0, 0, 0], [1, 0, 0, 1], [0, 0, 0, 1.02]):
        with pytest.raises(ff.InputError, match="attitude"):
            unit_quaternion("attitude", wrong)


@pytest.mark.parametrize("dimension", [2, 3, 6, 7])
def test_low_discrepancy_points_are_more_even_than_random_ones(
    dimension: int, rng: np.random.Generator
) -> None:
    """By the discrepancy; every call gives the same points."""
    points = low_discrepancy(2048, dimension)
    assert points.shape == (2048, dimension)
    assert points.min() >= 0.0
    assert points.max() < 1.0
    chance = qmc.discrepancy(rng.random(points.shape))
    assert qmc.discrepancy(points) < 0.5 * chance
    np.testing.assert_array_equal(points, low_discrepancy(2048, dimension))
    np.testing.assert_array_equal(points[:10], low_discrepancy(10, dimension))
