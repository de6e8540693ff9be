"""Paths in the frame of a tumbling body."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.paths.curves import PolynomialCurve
from freefloat.paths.directed_orientation import DirectedOrientation
from freefloat.paths.orientation import SlerpOrientation
from freefloat.paths.relative_path import RelativePath

TUMBLING = ff.Tumbling(inertia=[115, 72, 150], rate=[0.05, 0.03, 0.0466], com=[0.1, 0, 0.2])
CLIENT = ff.SceneBody(
    "client", ff.Box([1, 1, 2]), [2.6, 0, 0], Rotation.from_rotvec([0.3, 0.4, 0]).as_quat(),
    motion=TUMBLING,
)  # fmt: skip
END = Rotation.from_rotvec([0.0, 0.4, 0.0]).as_quat()


def relative_path(law="quintic"):
    line = PolynomialCurve.line([-1.2, 0, 0], [-0.6, 0.1, 0])
    path = ff.EndEffectorPath(line, SlerpOrientation([0, 0, 0, 1], END))
    return RelativePath(CLIENT, path, ff.Timing(30.0, law))


@pytest.mark.parametrize("t", [0.0, 3.0, 7.5, 12.3, 30.0])
def test_its_pose_in_the_moving_frame_is_the_given_one(t):
    relative = relative_path("trapezoidal")
    timed = relative.timed()
    expected = CLIENT.pose_at(t, timed) @ relative.path.pose(relative.timing.s(t))
    assert timed.pose(t).position == pytest.approx(expected.position, abs=1e-12)
    assert timed.pose(t).rotation == pytest.approx(expected.rotation, abs=1e-12)


@pytest.mark.parametrize("t", [0.5, 3.0, 12.3, 29.0])
def test_its_twist_and_twist_rate_are_derivatives(t):
    timed, h = relative_path("trapezoidal").timed([0.01, 0.0, 0.02]), 1e-4
    before, after = timed.pose(t - h), timed.pose(t + h)
    linear = (after.position - before.position) / (2.0 * h)
    angular = Rotation.from_matrix(after.rotation @ before.rotation.T).as_rotvec() / (2.0 * h)
    assert timed.twist(t) == pytest.approx([*linear, *angular], abs=1e-9)
    change = (timed.twist(t + h) - timed.twist(t - h)) / (2.0 * h)
    assert timed.twist_rate(t) == pytest.approx(change, abs=1e-9)


def test_its_end_has_the_velocity_of_the_point_of_the_body():
    timed = relative_path().timed()
    com = CLIENT.position + CLIENT.orientation @ TUMBLING.com
    axes = CLIENT.orientation @ TUMBLING.rotation(30.0)
    omega = axes @ TUMBLING.angular_velocity(30.0)
    # the angular momentum of the body is constant
    momentum = CLIENT.orientation @ TUMBLING.inertia @ TUMBLING.rate
    assert axes @ TUMBLING.inertia @ axes.T @ omega == pytest.approx(momentum, abs=1e-10)
    velocity = np.cross(omega, timed.pose(30.0).position - com)
    assert timed.twist(30.0) == pytest.approx([*velocity, *omega], abs=1e-10)


@pytest.mark.slow
def test_exact_ranges_end_where_motions_along_it_violate_the_margin():
    """Example 1 relative to a body that turns by 115 degrees meanwhile."""
    problem = ff.load_scenario("planar_3dof/parabola").problem()
    place = problem.path.pose(50.0).position
    turning = ff.Tumbling([1.0, 1.0, 1.0], rate=[0.0, 0.0, 0.02])
    body = ff.SceneBody("client", ff.Box([0.2, 0.2, 0.2]), place, motion=turning)
    coefficients = problem.path.path.curve.coefficients.copy()
    coefficients[0] -= place
    curve = PolynomialCurve(coefficients)
    path = ff.EndEffectorPath(curve, DirectedOrientation.follow(curve, "-y", [0, 0, 1]))
    timed = RelativePath(body, path, ff.Timing(100.0)).timed()
    moving = problem.replace(path=timed, scene=ff.Scene([body]))
    entries = ff.plan(moving).ranges
    assert len(entries) == 2
    for entry in entries:
        for part in entry.ranges:
            for edge, inward in ((part.low, 2e-4), (part.high, -2e-4)):
                inside = ff.simulate(moving, heading=edge + inward, branch=entry.branch)
                outside = ff.simulate(moving, heading=edge - inward, branch=entry.branch)
                assert inside.feasible
                assert not outside.feasible
