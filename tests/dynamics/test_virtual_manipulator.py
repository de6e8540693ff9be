"""The virtual manipulator: a free-floating arm as a fixed-base arm in the spacecraft frame."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import freefloat as ff
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.rotations import rotation_matrix
from tests.robots import (
    STROKE,
    Robot,
    attitudes,
    inertial_text,
    joint_text,
    joint_values,
    link_text,
    planar_robot,
    random_robot,
    robots,
)


def both(robot: Robot) -> tuple[ff.FreeFloatingModel, VirtualManipulator]:
    fixed = dict.fromkeys(robot.others, 0.6)
    model = robot.model(fixed_joints=fixed)
    return model, VirtualManipulator.of(model)


@given(data=st.data(), robot=robots(), attitude=attitudes)
def test_virtual_and_real_end_effector_poses_agree(data, robot, attitude):
    """In the inertial frame both are the end-effector pose from the centre of mass."""
    model, virtual = both(robot)
    q = data.draw(joint_values(model.dof))
    pose, R = virtual.pose(q), rotation_matrix(attitude)
    expected = model.end_effector_pose(attitude, q)
    np.testing.assert_allclose(R @ pose.position, expected.position, atol=1e-12)
    np.testing.assert_allclose(R @ pose.rotation, expected.rotation, atol=1e-12)


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 4))
def test_barycentric_lengths_are_weighted_by_the_mass_before_them(seed: int, n: int) -> None:
    """l_i shrinks by the mass from the spacecraft to body i - 1, r_i by that up to body i."""
    rng = np.random.default_rng(seed)
    m, before, after = np.exp(rng.normal(size=n + 1)), rng.random(n), rng.random(n + 1)
    virtual = VirtualManipulator.of(
        ff.FreeFloatingModel.from_urdf(planar_robot(m, np.ones(n + 1), before, after))
    )
    fraction = np.cumsum(m) / m.sum()
    expected = after * fraction + np.append(0.0, before * fraction[:-1])
    np.testing.assert_allclose(virtual.lengths(), expected, atol=1e-13)


@given(data=st.data(), robot=robots())
def test_reach_bounds_the_distance(data: st.DataObject, robot: Robot) -> None:
    model, virtual = both(robot)
    q = np.array([data.draw(joint_values(model.dof)) for _ in range(5)])
    assert np.abs(q).max() <= STROKE
    p = virtual.kinematics(q)[0]
    assert np.linalg.norm(p, axis=1).max() <= virtual.reach * (1.0 + 1e-12)


def test_strokes_of_prismatic_joints_are_reduced_by_the_mass_ratio() -> None:
    """A mass m extended from a spacecraft of mass M moves by M / (M + m) per metre."""
    text = "<robot name='r'>" + link_text("bus", inertial_text(30.0, np.eye(3)))
    text += joint_text("rail", "P", "bus", "arm", axis="1 0 0")
    text += link_text("arm", inertial_text(10.0, np.eye(3))) + "</robot>"
    virtual = VirtualManipulator.of(ff.FreeFloatingModel.from_urdf(text))
    gained = virtual.pose([1.0]).position - virtual.pose([0.0]).position
    np.testing.assert_allclose(gained, [0.75, 0, 0], atol=1e-14)
    np.testing.assert_allclose(virtual.strokes, [0.75], atol=1e-14)
    assert virtual.reach == pytest.approx(0.75 * STROKE)


def test_other_arms_have_no_elbow_and_spherical_wrist(spatial_6dof, planar_3dof, rng):
    """Wrist axes a millimetre apart, a skew elbow, other structures."""
    text = spatial_6dof.description.text
    wrist = text.replace(
        '<joint name="q6" type="continuous">',
        '<joint name="q6" type="continuous"><origin xyz="0 0 1e-3"/>',
    )
    offset = text.replace(
        '<link name="link_4">\n    <inertial>\n      <mass value="1e-6"/>',
        '<link name="link_4"><inertial><origin xyz="0 0 0.1"/><mass value="5"/>',
    )
    skew = text.replace(
        '<origin xyz="1 0 0"/><axis xyz="0 -1 0"/>', '<origin xyz="1 0 0"/><axis xyz="0 -1 0.01"/>'
    )
    for other in (wrist, offset, skew):
        assert other != text
        virtual = VirtualManipulator.of(ff.FreeFloatingModel.from_urdf(other, "end_effector"))
        assert not virtual.has_elbow_and_spherical_wrist
    assert not VirtualManipulator.of(planar_3dof).has_elbow_and_spherical_wrist
    for structure in ("RRRRR", "RRRRRR", "RRRRRRR", "RRPRRR"):
        assert not both(random_robot(rng, structure))[1].has_elbow_and_spherical_wrist
