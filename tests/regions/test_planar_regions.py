"""Planar arms agree with Pinocchio; margin curves with the closed forms of the paper."""

import numpy as np
import pytest

import freefloat as ff
from freefloat.dynamics.momentum import inertia_matrices
from freefloat.dynamics.resolved_rates import ResolvedRateSolver
from freefloat.regions.planar_regions import PlanarArm
from freefloat.so3 import heading_quaternion

URDF = """<robot name="bent"><link name="l0"><inertial><origin xyz="0.1 -0.2 0"/><mass value="90"/>
<inertia ixx="9" ixy="0" ixz="0" iyy="9" iyz="0" izz="12"/></inertial></link>
{joint1}<link name="l1"><inertial><origin xyz="0.4 0.1 0"/><mass value="11"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1.5"/></inertial></link>
{joint2}<link name="l2"><inertial><origin xyz="0.3 -0.1 0"/><mass value="7"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="0.8"/></inertial></link>
{joint3}<link name="l3"><inertial><origin xyz="0.1 0.05 0"/><mass value="2"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="0.3"/></inertial></link>
<joint name="tool" type="fixed"><parent link="l3"/><child link="tip"/>
<origin xyz="0.3 0.1 0" rpy="0 0 0.4"/></joint><link name="tip"/></robot>"""


def bent_arm(*axes: int) -> ff.FreeFloatingModel:
    """Offsets everywhere, joint frames rotated, joint axes along +z or -z."""
    joints = {
        f"joint{i}": f'<joint name="q{i}" type="continuous"><parent link="l{i - 1}"/>'
        f'<child link="l{i}"/><origin xyz="{0.4 + 0.2 * i} {0.1 * i} 0" rpy="0 0 {0.3 * i}"/>'
        f'<axis xyz="0 0 {axis}"/></joint>'
        for i, axis in enumerate(axes, start=1)
    }
    return ff.FreeFloatingModel.from_urdf(URDF.format(**joints), "tip")


@pytest.mark.parametrize("axes", [(1, 1, 1), (1, -1, 1), (-1, -1, -1), (-1, 1, 1)])
def test_determinant_rates_and_place_agree_with_pinocchio(axes):
    """S, the rates of (24) and the end-effector's place, for offset links and either axis sense."""
    model = bent_arm(*axes)
    arm, S = PlanarArm.of(model), ff.singularity_measure(model, ff.Task.PLANAR_POSE, "system")
    equation = ResolvedRateSolver(ff.System(model, [0, 0, 0.7]), ff.Task.PLANAR_POSE)
    rng = np.random.default_rng(3)
    for _ in range(20):
        joints, heading = rng.uniform(-np.pi, np.pi, 3), rng.uniform(-np.pi, np.pi)
        twist = np.array([*rng.normal(size=2), 0, 0, 0, rng.normal()])
        attitude = heading_quaternion(heading)
        angles = arm.angles(heading, joints)
        assert arm.determinant(angles) == pytest.approx(S(joints), rel=1e-9, abs=1e-9)
        place = model.end_effector_pose(attitude, joints).position
        assert arm.vectors(angles).sum() == pytest.approx(complex(*place[:2]), abs=1e-12)
        D, _ = inertia_matrices(model, joints)
        assert arm.momentum_coefficients(angles).sum() == pytest.approx(D[2, 2], rel=1e-12)
        omega, rates = equation.rates(attitude, joints, twist)
        rotation = 1j * twist[5] * arm.vectors(angles)[3]
        velocity = np.asarray(complex(*twist[:2]) - rotation)
        rates_of_24 = arm.rates(angles, 0.7, velocity, np.asarray(twist[5]))
        expected = np.cumsum(np.append(omega[2], arm.signs * rates))
        assert rates_of_24 == pytest.approx(expected, rel=1e-7, abs=1e-9)
