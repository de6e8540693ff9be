"""Tangency points: states at which a motion has S = S0 as its smallest magnitude."""

import numpy as np
import pytest

import freefloat as ff
from freefloat.planning.plane.tangency import TangencyKind, planar_tangency_points
from freefloat.so3 import heading_quaternion
from tests.motions import bundled


@pytest.fixture(scope="module")
def problem():
    return bundled("planar_3dof/parabola_nonstop")


@pytest.fixture(scope="module")
def points(problem):
    return planar_tangency_points(problem, 5.0, (0.0, 100.0))


def test_tangency_points_are_on_the_path_with_s_equal_s0(problem, points):
    """(15) and (17), for both signs and in both cases; angles in one revolution."""
    assert {point.level for point in points} == {5.0, -5.0}
    assert TangencyKind.END in {point.kind for point in points}
    for point in points:
        assert problem.margin.measure(point.joints) == pytest.approx(point.level, abs=1e-8)
        pose = problem.model.end_effector_pose(heading_quaternion(point.heading), point.joints)
        required = problem.path.pose(point.time)
        assert pose.position == pytest.approx(required.position, abs=1e-9)
        assert pose.rotation == pytest.approx(required.rotation, abs=1e-9)
        assert np.abs(point.joints).max() <= np.pi
        assert 0.0 <= point.heading < 2 * np.pi


def test_tangent_points_are_local_minima_of_the_motion_through_them(problem, points):
    """(14): shortly before and after, |S| along the motion is larger, to second order."""
    tangent = [point for point in points if point.kind is TangencyKind.TANGENT]
    assert tangent
    for point in tangent:
        values = []
        for step in (-0.2, 0.2, -0.1, 0.1):
            motion = ff.integrate_motion(
                problem, heading_quaternion(point.heading), point.joints,
                start=point.time, end=point.time + step,
            )  # fmt: skip
            values.append(abs(problem.margin.measure(motion.final.joints)) - 5.0)
        assert min(values) > 0.0
        assert max(values[2:]) < 0.5 * max(values[:2])
