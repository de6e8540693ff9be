"""Conventions of quaternions, headings, poses and axes; rotations; grids of SO(3)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from scipy.stats import qmc

import freefloat as ff
from freefloat.attitude_grids import attitude_grid, attitudes_within, grid_spacing, low_discrepancy
from freefloat.rotations import Rotation as OwnRotation
from freefloat.rotations import rotation_matrix
from freefloat.so3 import (
    Array,
    Pose,
    angle_between,
    axes_rotation,
    heading_of,
    heading_quaternion,
    rotated,
    rotation_vector_between,
    rotation_vector_to,
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
def test_rotation_vector_between_two_rotations(start, axis, angle):
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
def test_low_discrepancy_points_are_more_even_than_random_ones(dimension, rng):
    """By the discrepancy; every call gives the same points."""
    points = low_discrepancy(2048, dimension)
    assert points.shape == (2048, dimension)
    assert points.min() >= 0.0
    assert points.max() < 1.0
    chance = qmc.discrepancy(rng.random(points.shape))
    assert qmc.discrepancy(points) < 0.5 * chance
    np.testing.assert_array_equal(points, low_discrepancy(2048, dimension))
    np.testing.assert_array_equal(points[:10], low_discrepancy(10, dimension))


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
    start = random_attitudes(20, 6)
    axis = np.array([0.48, -0.6, 0.64])
    end = (Rotation.from_rotvec(angle * axis) * Rotation.from_quat(start)).as_quat()
    for sign in (1.0, -1.0):
        np.testing.assert_allclose(angle_between(start, sign * end), angle, atol=1e-7, rtol=1e-7)
        np.testing.assert_allclose(angle_between(-sign * end, start), angle, atol=1e-7, rtol=1e-7)
        vectors = rotation_vector_to(start, sign * end)
        np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), angle, atol=1e-9)
        np.testing.assert_allclose(angle_between(rotated(start, vectors), end), 0.0, atol=1e-7)


RNG = np.random.default_rng(4)
VECTORS = RNG.normal(size=(600, 3)) * RNG.choice([0.0, 1e-9, 1e-3, 1.0, 3.0], size=(600, 1))
QUATERNIONS = RNG.normal(size=(600, 4))


@pytest.mark.parametrize("many", [slice(None), 3])
def test_every_conversion_is_scipys(many: slice | int) -> None:
    ours, theirs = OwnRotation.from_rotvec(VECTORS[many]), Rotation.from_rotvec(VECTORS[many])
    R = theirs.as_matrix()
    assert_allclose(ours.as_matrix(), R, atol=1e-14)
    assert_allclose(ours.as_rotvec(), theirs.as_rotvec(), atol=1e-14)
    assert_allclose(
        same_sign(OwnRotation.from_matrix(R).as_quat()), same_sign(theirs.as_quat()), atol=1e-14
    )
    assert_allclose(ours.as_rpy(), theirs.as_euler("xyz"), atol=1e-13)
    angles = theirs.as_euler("xyz")
    assert_allclose(OwnRotation.from_rpy(angles).as_matrix(), R, atol=1e-14)


def test_products_broadcast_as_scipys() -> None:
    ours, theirs = OwnRotation.from_quat(QUATERNIONS), Rotation.from_quat(QUATERNIONS)
    assert_allclose((ours[0] * ours).as_matrix(), (theirs[0] * theirs).as_matrix(), atol=1e-14)
    assert_allclose(ours.inv().apply(VECTORS), theirs.inv().apply(VECTORS), atol=1e-14)


def test_half_turns_about_all_axes_have_matrices_and_back() -> None:
    half = Rotation.from_rotvec(np.pi * np.vstack([np.eye(3), np.ones(3) / np.sqrt(3.0)]))
    found = OwnRotation.from_matrix(half.as_matrix())
    assert_allclose(found.as_matrix(), half.as_matrix(), atol=1e-14)
    assert_allclose(np.linalg.norm(found.as_rotvec(), axis=1), np.pi, rtol=1e-14)


def test_pitch_of_a_right_angle_has_no_roll() -> None:
    upright = OwnRotation.from_rpy([0.3, np.pi / 2.0, 0.2])
    assert_allclose(
        OwnRotation.from_rpy(upright.as_rpy()).as_matrix(), upright.as_matrix(), atol=1e-7
    )
    assert upright.as_rpy()[0] == 0.0


def same_sign(quaternions: Array) -> Array:
    return np.asarray(quaternions * np.where(quaternions[..., 3:] < 0.0, -1.0, 1.0))
