"""Planar arms agree with Pinocchio; margin curves with the closed forms of the paper."""

import numpy as np
import pytest

import freefloat as ff
from freefloat.dynamics.momentum import inertia_matrices
from freefloat.dynamics.resolved_rates import ResolvedRateSolver
from freefloat.regions.planar_regions import PlanarArm
from freefloat.so3 import heading_quaternion
from tests.planes import planar_arm


@pytest.mark.parametrize("joints", ["+++", "+-+", "---", "-++"])
def test_determinant_rates_and_place_agree_with_pinocchio(joints):
    """S, the rates of (24) and the end-effector's place, for offset links and either axis sense."""
    model = ff.FreeFloatingModel.from_urdf(planar_arm(1, joints, np.eye(3)), "tool")
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
