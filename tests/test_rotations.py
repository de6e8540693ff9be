"""Rotations beside SciPy's."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation as SciPyRotation

from freefloat.rotations import Rotation
from freefloat.so3 import Array

RNG = np.random.default_rng(4)
VECTORS = RNG.normal(size=(600, 3)) * RNG.choice([0.0, 1e-9, 1e-3, 1.0, 3.0], size=(600, 1))
QUATERNIONS = RNG.normal(size=(600, 4))


@pytest.mark.parametrize("many", [slice(None), 3])
def test_every_conversion_is_scipys(many: slice | int) -> None:
    ours, theirs = Rotation.from_rotvec(VECTORS[many]), SciPyRotation.from_rotvec(VECTORS[many])
    R = theirs.as_matrix()
    assert_allclose(ours.as_matrix(), R, atol=1e-14)
    assert_allclose(ours.as_rotvec(), theirs.as_rotvec(), atol=1e-14)
    assert_allclose(
        same_sign(Rotation.from_matrix(R).as_quat()), same_sign(theirs.as_quat()), atol=1e-14
    )
    assert_allclose(ours.as_rpy(), theirs.as_euler("xyz"), atol=1e-13)
    angles = theirs.as_euler("xyz")
    assert_allclose(Rotation.from_rpy(angles).as_matrix(), R, atol=1e-14)


def test_products_broadcast_as_scipys() -> None:
    ours, theirs = Rotation.from_quat(QUATERNIONS), SciPyRotation.from_quat(QUATERNIONS)
    assert_allclose((ours[0] * ours).as_matrix(), (theirs[0] * theirs).as_matrix(), atol=1e-14)
    assert_allclose(ours.inv().apply(VECTORS), theirs.inv().apply(VECTORS), atol=1e-14)


def test_half_turns_about_all_axes_have_matrices_and_back() -> None:
    half = SciPyRotation.from_rotvec(np.pi * np.vstack([np.eye(3), np.ones(3) / np.sqrt(3.0)]))
    found = Rotation.from_matrix(half.as_matrix())
    assert_allclose(found.as_matrix(), half.as_matrix(), atol=1e-14)
    assert_allclose(np.linalg.norm(found.as_rotvec(), axis=1), np.pi, rtol=1e-14)


def test_pitch_of_a_right_angle_has_no_roll() -> None:
    upright = Rotation.from_rpy([0.3, np.pi / 2.0, 0.2])
    assert_allclose(Rotation.from_rpy(upright.as_rpy()).as_matrix(), upright.as_matrix(), atol=1e-7)
    assert upright.as_rpy()[0] == 0.0


def same_sign(quaternions: Array) -> Array:
    return np.asarray(quaternions * np.where(quaternions[..., 3:] < 0.0, -1.0, 1.0))
