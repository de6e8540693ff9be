"""Arm branches at a pose: closed forms, Newton's method, branch numbers."""

import re
from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.ik.branches import ArmBranch, arm_branches, many_arm_branches, search_arm_branches
from freefloat.so3 import Pose, axes_rotation, rotation_vector_between
from tests.motions import bundled, chain, gaps, virtual_jacobian
from tests.robots import joint_values, planar_robot, random_robot

START = Pose(
    [1.0, 0, 0], axes_rotation("", ("x", [0.4683, 1.1683, -0.7]), ("z", [1.5, -0.8, -0.33]))
)
"""Where the end-effector begins in the paper's Example 2, inertial frame."""


def holds(known: Iterable[np.ndarray], q: np.ndarray, tolerance: float = 1e-6) -> bool:
    return any(gaps(joints, q) < tolerance for joints in known)


def joints_of(branches: Iterable[ArmBranch]) -> list[np.ndarray]:
    return [branch.joints for branch in branches]


def searched(model: ff.FreeFloatingModel, target: Pose, task: ff.Task) -> list[np.ndarray]:
    """What Newton's method finds, closed form or not."""
    sets = search_arm_branches(model, target.position[None], target.rotation[None], task)
    return joints_of(sets[0])


def missed(virtual: VirtualManipulator, target: Pose, joints: np.ndarray) -> float:
    """How far off the pose a configuration is [m or rad]."""
    pose = virtual.pose(joints)
    vector = rotation_vector_between(pose.rotation, target.rotation)
    return float(max(np.abs(pose.position - target.position).max(), np.abs(vector).max()))


def elbow_arm(rng: np.random.Generator) -> ff.FreeFloatingModel:
    """Random offsets, masses and axes; the elbow parallel to the lift, the wrist in a point."""

    def direction() -> np.ndarray:
        vector = rng.normal(size=3)
        return vector / np.linalg.norm(vector)

    lift = direction()
    axes = [direction(), lift, lift, direction(), direction(), direction()]
    bodies = []
    for i, axis in enumerate(axes):
        at = rng.uniform(-0.7, 0.7, 3) if i < 4 else np.zeros(3)
        centre = rng.uniform(-0.3, 0.3, 3) if i not in (3, 4) else np.zeros(3)
        bodies.append(("continuous", axis, at, 10.0, centre, (1.0, 1.0, 1.0)))
    text = chain(*bodies, base=(200.0, 40.0, 0.0), tool=rng.uniform(-0.3, 0.3, 3))
    return ff.FreeFloatingModel.from_urdf(text, "tool")


@given(q=joint_values(6))
def test_closed_form_finds_the_configuration_a_pose_came_from(spatial_6dof, q):
    """Wherever the wrist is bent: forwards and back, stretched and folded arms included."""
    if abs(np.sin(q[4])) < 1e-4:
        q = q + np.array([0, 0, 0, 0, 0.4, 0])
    virtual = VirtualManipulator.of(spatial_6dof)
    target = virtual.pose(q)
    branches = arm_branches(spatial_6dof, target, ff.Task.POSE)
    assert [branch.index for branch in branches] == list(range(8))
    x, y, _ = virtual.kinematics(q)[2][4, 0]
    if np.hypot(x, y) > 1e-2:  # else the wrist is on the first axis, whose angle is free
        # a stretched arm pinches two branches into one, known to half the digits
        assert holds(joints_of(branches), q, 1e-6 if abs(np.sin(q[2])) > 1e-2 else 1e-3)
    assert max(missed(virtual, target, branch.joints) for branch in branches) < 1e-8


def with_wrist_axis(model: ff.FreeFloatingModel, joint: str, axis: str) -> ff.FreeFloatingModel:
    """The same arm with another axis for one joint."""
    first, rest = model.description.text.split(f'<joint name="{joint}"')
    changed = re.sub("<axis [^>]*>", f'<axis xyz="{axis}"/>', rest, count=1)
    return ff.FreeFloatingModel.from_urdf(f'{first}<joint name="{joint}"{changed}', "end_effector")


@pytest.mark.parametrize(
    ("wrist_angle", "axis"),
    [(wrist_angle, "0 -1 0") for wrist_angle in (0.0, 1e-8, 1e-7, np.pi)]
    # square to eight digits, as where a URDF says rpy="1.5707963 0 0"
    + [(wrist_angle, "1e-8 -1 0") for wrist_angle in (0.0, -3e-8)],
)
def test_singular_wrists_keep_all_branches(spatial_6dof, rng, wrist_angle, axis):
    """With axes 4 and 6 in line any part of the roll will do, but one must be given."""
    model = with_wrist_axis(spatial_6dof, "q5", axis)
    virtual = VirtualManipulator.of(model)
    assert virtual.has_elbow_and_spherical_wrist
    for q in rng.uniform(-np.pi, np.pi, (20, 6)):
        q[4] = wrist_angle
        target = virtual.pose(q)
        branches = arm_branches(model, target, ff.Task.POSE)
        assert [branch.index for branch in branches] == list(range(8))
        assert holds([joints[:3] for joints in joints_of(branches)], q[:3])
        assert max(missed(virtual, target, branch.joints) for branch in branches) < 1e-8


def test_branch_numbers_keep_their_meaning_at_every_attitude(spatial_6dof, rng):
    """Sign of the elbow, of the wrist, and whether the arm reaches forwards or over its back."""
    virtual = VirtualManipulator.of(spatial_6dof)
    forwards = {"+": set(), "-": set()}
    for attitude in Rotation.random(60, rng=rng):
        target = START.seen_from(attitude.as_matrix())
        for branch in arm_branches(spatial_6dof, target, ff.Task.POSE):
            shoulder, elbow, wrist = (word[-1] for word in branch.label.split())
            q = branch.joints
            assert np.sign(np.sin(q[2])) == float(elbow + "1")
            assert np.sign(np.sin(q[4])) == float(wrist + "1")
            x, y, _ = virtual.kinematics(q)[2][4, 0]  # of the wrist
            forwards[shoulder].add(np.sign(x * np.cos(q[0]) + y * np.sin(q[0])))
    assert {frozenset(signs) for signs in forwards.values()} == {frozenset([1]), frozenset([-1])}


def test_closed_form_and_newton_agree(rng: np.random.Generator) -> None:
    """Random elbow arms with spherical wrists, no two axes square: the same configurations."""
    counts = []
    for _ in range(6):
        model = elbow_arm(rng)
        virtual = VirtualManipulator.of(model)
        assert virtual.has_elbow_and_spherical_wrist
        q = rng.uniform(-np.pi, np.pi, 6)
        target = virtual.pose(q)
        closed = joints_of(arm_branches(model, target, ff.Task.POSE))
        newton = searched(model, target, ff.Task.POSE)
        assert holds(closed, q)
        assert all(holds(newton, joints, 1e-5) for joints in closed)
        assert all(holds(closed, joints, 1e-5) for joints in newton)
        assert max(missed(virtual, target, joints) for joints in closed) < 1e-8
        counts.append(len(closed))
    assert set(counts) <= {2, 4, 6, 8}
    assert max(counts) == 8


@pytest.mark.parametrize(("structure", "task"), [
    ("RRRRRR", ff.Task.POSE),
    ("RRPRRR", ff.Task.POSE),
    ("RRR", ff.Task.POSITION),
    ("RPR", ff.Task.POSITION),
    ("PPP", ff.Task.POSITION),
])  # fmt: skip
def test_newton_finds_the_configuration_a_pose_came_from(structure, task, rng):
    """Arms without a closed form; their solutions come in pairs, born where the arm is singular."""
    for _ in range(4):
        model = random_robot(rng, structure).model()
        virtual = VirtualManipulator.of(model)
        q = rng.uniform(-np.pi, np.pi, model.dof)
        target = virtual.pose(q)
        branches = arm_branches(model, target, task)
        assert holds(joints_of(branches), q)
        for branch in branches:
            if structure != "RRRRRR":
                J = virtual_jacobian(virtual, branch.joints)[0][list(task.rows)]
                assert branch.index % 2 == (np.linalg.det(J) < 0.0)
            pose = virtual.pose(branch.joints)
            assert np.abs(pose.position - target.position).max() < 1e-8
            if task.prescribes_orientation:
                assert missed(virtual, target, branch.joints) < 1e-8
        assert len(branches) == 1 if structure == "PPP" else len(branches) % 2 == 0


@given(seed=st.integers(0, 2**32 - 1), q=st.integers(2, 3).flatmap(joint_values))
def test_planar_arms_have_two_elbows(seed: int, q: np.ndarray) -> None:
    """Elbow + and -, both at the pose; a stretched arm has both in one."""
    rng, n = np.random.default_rng(seed), len(q)
    m, before, after = np.exp(rng.normal(size=n + 1)), rng.random(n), rng.random(n + 1)
    model = ff.FreeFloatingModel.from_urdf(planar_robot(m, np.ones(n + 1), before, after))
    task = {2: ff.Task.PLANAR_POSITION, 3: ff.Task.PLANAR_POSE}[n]
    virtual = VirtualManipulator.of(model)
    target = virtual.pose(q)
    branches = arm_branches(model, target, task)
    assert [(b.index, b.label) for b in branches] == [(0, "elbow+"), (1, "elbow-")]
    sharp = abs(np.sin(q[1])) > 1e-2
    assert holds(joints_of(branches), q, 1e-6 if sharp else 1e-3)
    for sign, branch in zip((1, -1), branches, strict=True):
        pose = virtual.pose(branch.joints)
        assert np.abs(pose.position - target.position).max() < 1e-8
        if sharp:
            assert np.sign(np.sin(branch.joints[1])) == sign
        if task.prescribes_orientation:
            assert missed(virtual, target, branch.joints) < 1e-8


def test_out_of_reach_there_are_none(spatial_6dof, planar_3dof, ur5):
    """Beyond the reach, and in the hole that long links cannot fold into: no branch."""
    far = Pose([0.0, 30.0, 0.0], np.eye(3))
    assert arm_branches(spatial_6dof, far, ff.Task.POSE) == ()
    assert arm_branches(planar_3dof, far, ff.Task.PLANAR_POSE) == ()
    assert arm_branches(planar_3dof, far, ff.Task.PLANAR_POSITION) == ()
    assert arm_branches(ur5, far, ff.Task.POSE) == ()
    # b - c = 0.817 m around the first joint at (a, 0), seen from the end d = 0.400 m before it
    hole = Pose([0.424628 + 0.399575 + 0.7, 0.0, 0.0], np.eye(3))
    assert arm_branches(planar_3dof, hole, ff.Task.PLANAR_POSE) == ()
    rim = Pose([0.424628 + 0.399575 + 0.9, 0.0, 0.0], np.eye(3))
    assert len(arm_branches(planar_3dof, rim, ff.Task.PLANAR_POSE)) == 2


@pytest.mark.parametrize(
    ("structure", "task"), [("RRRRRRR", ff.Task.POSE), ("RRRRR", ff.Task.POSITION)]
)
def test_branches_of_redundant_arms_are_reproducible_and_spread(structure, task, rng):
    """Sixteen of infinitely many, far from each other, the same at every call."""
    robot = random_robot(rng, structure)
    model = robot.model()
    virtual = VirtualManipulator.of(model)
    target = virtual.pose(np.full(model.dof, 0.4))
    branches = arm_branches(model, target, task)
    assert [branch.index for branch in branches] == list(range(16))
    for branch in branches:
        pose = virtual.pose(branch.joints)
        assert np.abs(pose.position - target.position).max() < 1e-8
        if task.prescribes_orientation:
            assert missed(virtual, target, branch.joints) < 1e-8
        others = [other for other in branches if other is not branch]
        assert not holds(joints_of(others), branch.joints, 0.1)
    again = robot.model()
    for branch, other in zip(branches, arm_branches(again, target, task), strict=True):
        np.testing.assert_array_equal(branch.joints, other.joints)


def assert_rounding_changes_no_branch(axes: str, task: ff.Task, q: np.ndarray) -> None:
    """Sets of branches of an arm of equal links, at the poses of configurations (K, n)."""
    place = (0.0, 0.0, 0.3), 5.0, (0.0, 0.0, 0.15), (1.0, 1.0, 0.2)
    joints = [("continuous", np.eye(3)["xyz".index(axis)], *place) for axis in axes]
    model = ff.FreeFloatingModel.from_urdf(chain(*joints, tool=(0.0, 0.0, 0.1)), "tool")
    p, R = VirtualManipulator.of(model).kinematics(q)[:2]
    one, other = (
        many_arm_branches(model, p * (1.0 + shift), R * (1.0 - shift), task)
        for shift in (0.0, 2e-16)
    )
    assert one.exist.any(axis=1).mean() > 0.9
    np.testing.assert_array_equal(one.names, other.names)
    np.testing.assert_allclose(np.exp(1j * one.joints), np.exp(1j * other.joints), atol=1e-5)


@pytest.mark.parametrize(("axes", "task"), [
    ("zyzyzyz", ff.Task.POSE), ("zyyzyyz", ff.Task.POSE), ("zyzy", ff.Task.POSITION),
    ("zyzyzy", ff.Task.POINTING),
])  # fmt: skip
def test_rounding_does_not_order_the_branches_of_symmetric_redundant_arms(axes, task, rng):
    """Starts in pairs are equally far from others, and many joints are 0 or 180 degrees."""
    q = rng.uniform(-2.0, 2.0, (60, len(axes)))
    q[::3] = np.pi / 2.0 * rng.integers(-1, 2, q[::3].shape)
    q[1::3, ::2] = 0.0
    assert_rounding_changes_no_branch(axes, task, q)


def test_rounding_does_not_name_branches_of_arms_without_an_elbow(rng: np.random.Generator) -> None:
    """The third joint turns the upper arm about its length."""
    assert_rounding_changes_no_branch("zyzyzy", ff.Task.POSE, rng.uniform(-2.0, 2.0, (60, 6)))


def test_redundant_arms_have_configurations_within_their_ranges(rng: np.random.Generator) -> None:
    """At most poses that are reached with joints near the ends of their ranges."""
    robot, wide = random_robot(rng, "RRRRRRR"), 'lower="-4.0" upper="4.0"'
    narrow = robot.text.replace(wide, wide.replace("4.0", "1.5"))
    model = ff.FreeFloatingModel.from_urdf(narrow, robot.end_effector)
    virtual, found = VirtualManipulator.of(model), 0
    for q in 0.99 * 1.5 * rng.choice([-1.0, 1.0], (20, 7)):
        joints = np.array(joints_of(arm_branches(model, virtual.pose(q), ff.Task.POSE)))
        inside = (np.abs(joints) <= 1.5).all(axis=1)
        assert inside.all() or not inside.any()
        found += inside.any()
    assert found > 12


@given(
    q=joint_values(3),
    ranges=st.lists(
        st.lists(st.floats(-6 * np.pi, 6 * np.pi), min_size=2, max_size=2, unique=True).map(sorted),
        min_size=3,
        max_size=3,
    ),
)
def test_joints_are_wrapped_into_their_range(q: np.ndarray, ranges: list[list[float]]) -> None:
    """By multiples of 2 pi, as near to zero as that allows; outside where none is inside."""
    unlimited = ff.FreeFloatingModel.from_urdf(
        planar_robot([4, 3, 2, 1], [1] * 4, [1] * 3, [1] * 4)
    )
    text = unlimited.description.text
    for lower, upper in ranges:
        limit = f'<limit effort="1" velocity="1" lower="{lower!r}" upper="{upper!r}"/>'
        text = text.replace('type="continuous">', f'type="revolute">{limit}', 1)
    target = VirtualManipulator.of(unlimited).pose(q)
    free = arm_branches(unlimited, target, ff.Task.PLANAR_POSE)
    model = ff.FreeFloatingModel.from_urdf(text)
    assert model.bodies[3].upper == ranges[2][1]
    ranged = arm_branches(model, target, ff.Task.PLANAR_POSE)
    for wrapped, plain in zip(ranged, free, strict=True):
        assert gaps(wrapped.joints, plain.joints) < 1e-12
        assert np.abs(plain.joints).max() <= np.pi
        for value, angle, (lower, upper) in zip(wrapped.joints, plain.joints, ranges, strict=True):
            shifted = angle + 2.0 * np.pi * np.arange(-4, 5)
            inside = shifted[(shifted >= lower) & (shifted <= upper)]
            nearest = inside[np.argmin(np.abs(inside))] if len(inside) else angle
            assert abs(value) == pytest.approx(abs(nearest), abs=1e-12)
            assert not len(inside) or lower <= value <= upper


def test_of_branches_with_one_shoulder_far_from_the_joints_the_nearer_elbow_counts():
    """The distance is the shoulder's for both; rounding does not decide."""
    problem = bundled("ur5_servicer/table").replace(
        start_joints=np.array([1.89, -2.52, -0.96, 0.34, 2.03, 1.57])
    )
    headings = np.radians(np.linspace(276.1, 276.3, 50))
    closest = problem.many_branches(problem.plane.attitudes(headings))
    assert set(closest.names.max(axis=1).tolist()) == {2}
