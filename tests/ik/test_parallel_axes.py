"""Arms whose second to fourth axes are parallel: nothing missed, nothing made up."""

import numpy as np
import pytest

import freefloat as ff
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.ik.branches import BranchSets, many_arm_branches, search_arm_branches
from freefloat.so3 import Array
from tests.motions import chain, gaps

MEETS = 1e-8


def parallel_arm(rng: np.random.Generator, signs: tuple[float, float]) -> ff.FreeFloatingModel:
    """An arm of random make, but for its axes 3 and 4: along axis 2 or against it."""
    lift = rng.normal(size=3)
    lift /= np.linalg.norm(lift)
    axes = [rng.normal(size=3), lift, signs[0] * lift, signs[1] * lift, *rng.normal(size=(2, 3))]
    bodies = []
    for k, axis in enumerate(axes):
        offset = rng.normal(0.0, 0.2, 3) + (rng.normal(0.0, 0.5, 3) if k in (2, 3) else 0.0)
        centre, axis = rng.normal(0.0, 0.1, 3), axis / np.linalg.norm(axis)
        bodies.append(("continuous", axis, offset, rng.uniform(1.0, 20.0), centre, (0.5, 0.5, 0.5)))
    base = rng.uniform(50.0, 500.0), 50.0, 0.0
    text = chain(*bodies, base=base, tool=rng.normal(0.0, 0.1, 3))
    return ff.FreeFloatingModel.from_urdf(text, "tool")


def assert_the_same(closed: BranchSets, searched: BranchSets) -> None:
    np.testing.assert_array_equal(closed.names, searched.names)
    off = gaps(closed.joints[closed.exist], searched.joints[searched.exist])
    assert off.max(initial=0.0) < 1e-6
    assert closed.labels == searched.labels


def assert_meets(model: ff.FreeFloatingModel, sets: BranchSets, p: Array, R: Array) -> None:
    k, _ = np.nonzero(sets.exist)
    position, rotation, _, _ = VirtualManipulator.of(model).kinematics(sets.joints[sets.exist])
    assert np.abs(position - p[k]).max() < MEETS
    assert np.abs(rotation - R[k]).max() < MEETS


@pytest.mark.parametrize("signs", [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)])
def test_random_arms_have_the_branches_that_a_search_finds(signs, rng):
    for _ in range(2):
        model = parallel_arm(rng, signs)
        virtual = VirtualManipulator.of(model)
        assert virtual.has_three_parallel_axes
        assert not virtual.has_elbow_and_spherical_wrist
        q = rng.uniform(-np.pi, np.pi, (40, 6))
        p, R, _, _ = virtual.kinematics(q)
        p[::10] *= 1.3
        closed = many_arm_branches(model, p, R, ff.Task.POSE)
        assert_the_same(closed, search_arm_branches(model, p, R, ff.Task.POSE))
        assert_meets(model, closed, p, R)
        reached = np.arange(40) % 10 > 0
        assert np.nanmin(gaps(closed.joints[reached], q[reached, None]), axis=1).max() < 1e-6
        assert (closed.exist.sum(axis=1) % 2 == 0).all()
        assert closed.exist.sum(axis=1).max() >= 4


@pytest.mark.parametrize(("joint", "angle"), [(2, 0.0), (4, 1e-6), (2, 1e-4), (4, np.pi)])
def test_no_pose_is_lost_near_a_singular_one(ur5, joint, angle, rng):
    virtual = VirtualManipulator.of(ur5)
    q = rng.uniform(-np.pi, np.pi, (12, 6))
    q[:, joint] = angle
    p, R, _, _ = virtual.kinematics(q)
    closed = many_arm_branches(ur5, p, R, ff.Task.POSE)
    assert_meets(ur5, closed, p, R)
    searched = search_arm_branches(ur5, p, R, ff.Task.POSE)
    assert (closed.exist.sum(axis=1) >= searched.exist.sum(axis=1)).all()
    if angle >= 1e-4 and angle < 3.0:
        assert np.nanmin(gaps(closed.joints, q[:, None]), axis=1).max() < 1e-6
