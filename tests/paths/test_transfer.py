"""Paths from a moving end-effector to a rest."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from freefloat.paths import transfer
from freefloat.so3 import Pose
from tests.differences import twist_of

START = Pose(np.array([0.3, -0.2, 0.9]), Rotation.from_rotvec([0.4, 0.1, -0.7]).as_matrix())
END = Pose(np.array([0.7, 0.4, 1.1]), Rotation.from_rotvec([-0.6, 0.8, 1.1]).as_matrix())
TWIST = np.array([0.03, -0.01, 0.02, 0.05, -0.04, 0.01])
DRIFT = np.array([0.01, 0.0, -0.02])


@pytest.mark.parametrize("drift", [np.zeros(3), DRIFT])
def test_a_transfer_begins_with_pose_and_twist_and_ends_at_rest(drift: np.ndarray) -> None:
    path = transfer(START, TWIST, END, 12.0, drift)
    for t, pose in ((0.0, START), (12.0, END)):
        end, found = t * drift, path.pose(t)
        np.testing.assert_allclose(found.position + end, pose.position, atol=1e-12)
        np.testing.assert_allclose(found.rotation, pose.rotation, atol=1e-12)
    still = np.concatenate([drift, np.zeros(3)])
    np.testing.assert_allclose(path.twist(0.0) + still, TWIST, atol=1e-12)
    np.testing.assert_allclose(path.twist(12.0) + still, 0.0, atol=1e-12)


@pytest.mark.parametrize("t", [0.5, 4.0, 9.0])
def test_the_twist_is_that_of_differences(t: float) -> None:
    path = transfer(START, TWIST, END, 12.0, np.zeros(3))
    np.testing.assert_allclose(path.twist(t), twist_of(path.pose, t), atol=1e-8)
