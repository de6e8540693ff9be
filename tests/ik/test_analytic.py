"""Inverse kinematics of many poses: completeness, branch names, kinematics of chains."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.ik.branches import arm_branches, many_arm_branches, search_arm_branches
from freefloat.so3 import Pose
from tests.motions import gaps, virtual_jacobian
from tests.robots import random_robot


def random_poses(
    model: ff.FreeFloatingModel, count: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions and rotations that an arm reaches, and the joint values they came from."""
    q = rng.uniform(-np.pi, np.pi, (count, model.dof))
    p, R, _, _ = VirtualManipulator.of(model).kinematics(q)
    return p, R, q


def brute_force(
    model: ff.FreeFloatingModel, position: np.ndarray, rotation: np.ndarray, starts: np.ndarray
) -> list[np.ndarray]:
    """Plain Newton steps of at most half a radian by least squares: few starts arrive."""
    virtual, q = VirtualManipulator.of(model), starts.copy()
    for _ in range(60):
        p, R, _, _ = virtual.kinematics(q)
        vector = Rotation.from_matrix(rotation @ R.transpose(0, 2, 1)).as_rotvec()
        e = np.hstack([position - p, vector])
        step = (np.linalg.pinv(virtual_jacobian(virtual, q), rcond=1e-4) @ e[:, :, None])[:, :, 0]
        q = q + step / np.maximum(1.0, 2.0 * np.abs(step).max(axis=1, keepdims=True))
    distinct: list[np.ndarray] = []
    for joints in q[np.abs(e).max(axis=1) < 1e-10]:
        if all(gaps(joints, other) > 1e-4 for other in distinct):
            distinct.append(joints)
    return distinct


@pytest.mark.parametrize(
    ("robot", "task"),
    [("spatial_6dof", ff.Task.POSE), ("ur5", ff.Task.POSE), ("ur5", ff.Task.POSITION),
     ("planar_3dof", ff.Task.PLANAR_POSE), ("planar_3dof", ff.Task.PLANAR_POSITION)],
)  # fmt: skip
def test_branches_of_many_poses_are_those_of_each_pose(robot, task, request, rng):
    """To the last bit: closed forms, searches, redundant arms; unreachable poses included."""
    model = request.getfixturevalue(robot)
    positions, rotations, _ = random_poses(model, 75, rng)
    positions[::7] *= 1.5
    sets = many_arm_branches(model, positions, rotations, task)
    assert len(sets) == 75
    assert sets.exist.any(axis=1).sum() > 0
    for k in range(0, 75, 5):
        alone = arm_branches(model, Pose(positions[k], rotations[k]), task)
        assert [b.index for b in alone] == np.flatnonzero(sets.exist[k]).tolist()
        assert [b.label for b in alone] == [b.label for b in sets[k]]
        for branch in alone:
            np.testing.assert_array_equal(branch.joints, sets.joints[k, branch.index])


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["spatial_6dof", "ur5"])
def test_a_search_finds_what_brute_force_finds(robot, request, rng):
    model = request.getfixturevalue(robot)
    positions, rotations, _ = random_poses(model, 3, rng)
    sets = search_arm_branches(model, positions, rotations, ff.Task.POSE)
    total = 0
    for k in range(3):
        brute = brute_force(model, positions[k], rotations[k], rng.uniform(-np.pi, np.pi, (150, 6)))
        known = sets.joints[k, sets.exist[k]]
        assert all(gaps(known, joints).min() < 1e-5 for joints in brute)
        total += len(brute)
    assert total > 0.9 * sets.exist.sum()


def test_signs_identify_the_branches_of_the_ur5(ur5, rng):
    """Nearly everywhere each name is used once; a name's sign of the determinant is its signs'."""
    positions, rotations, _ = random_poses(ur5, 200, rng)
    sets = many_arm_branches(ur5, positions, rotations, ff.Task.POSE)
    assert sets.exist[:, 8:].any(axis=1).mean() <= 0.005
    J = virtual_jacobian(VirtualManipulator.of(ur5), sets.joints[sets.exist])
    names = sets.names[sets.exist]
    signs = [(-1.0) ** bin(name).count("1") for name in names]
    np.testing.assert_array_equal(np.sign(np.linalg.det(J)), signs)


def test_branches_of_equal_signs_have_distinct_labels(rng: np.random.Generator) -> None:
    """A random arm: the second stands at place 8 or beyond, called b."""
    model = random_robot(rng, "RRRRRR").model()
    positions, rotations, _ = random_poses(model, 60, rng)
    sets = many_arm_branches(model, positions, rotations, ff.Task.POSE)
    assert sets.exist[:, 8:].any()
    first = sets.names[:, :8]
    assert np.isin(first - np.arange(8), [0, *range(-8, 0)]).all()
    np.testing.assert_array_equal(first[first >= 0], np.nonzero(first >= 0)[1])
    for k in np.flatnonzero(sets.exist[:, 8:].any(axis=1)):
        labels = [branch.label for branch in sets[k]]
        assert len(set(labels)) == len(labels)
        second = next(branch for branch in sets[k] if branch.index == 8)
        assert second.label.endswith(" b")
        assert second.label[:-2] in labels
