"""Numbers printed by Nanos and Papadopoulos, from motions and from joint space."""

from functools import cache, partial

import numpy as np
import pytest

import freefloat as ff
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.motion.motion import Ending
from freefloat.paths.curves import PolynomialCurve
from freefloat.paths.orientation import FixedOrientation
from freefloat.planning.plane.ranges import find_range_limits, heading_ranges
from freefloat.so3 import axes_rotation, heading_of, heading_quaternion
from tests.motions import BAD, GOOD, heading, on_side, simulated, tracking
from tests.validation.comparisons import assert_agrees

assert_close = partial(np.testing.assert_allclose, rtol=0)


C = [0.1214, 0.4686, 0.1943]


def test_example_2_completes_from_the_printed_attitude(spatial):
    """The branch with q1 near 1.25 follows the line from A to B, between nodes, too."""
    assert (spatial.margin.measure.name, spatial.margin.threshold) == ("arm", 5.0)
    attitude = spatial.attitude(GOOD)
    near = [b for b in spatial.branches(attitude) if abs(b.joints[0] - 1.25) < 0.05]
    assert len(near) == 4  # elbow and wrist either way
    for branch in near:
        motion = ff.integrate_motion(spatial, attitude, branch.joints)
        assert motion.ending is Ending.COMPLETED
        assert motion.final.time == 100.0
        position, angle = tracking(motion, np.linspace(0.0, 100.0, 200))
        assert position < 1e-6
        assert angle < 1e-6
        residuals = motion.residuals()
        assert residuals.momentum < 1e-6
        assert residuals.end_effector_position < 1e-6
        assert residuals.end_effector_orientation < 1e-6


def test_example_2_becomes_singular_at_c_from_the_bad_attitude(spatial):
    """Exactly four of the eight branches fail, all within 3 mm of the printed C."""
    for error in errors_of_c(spatial):
        assert_agrees("test_example_2_becomes_singular_at_c_from_the_bad_attitude", error)


def test_example_2_becomes_singular_at_c_with_b_in_its_plane(spatial):
    """With the z of B that (41) gives instead of the printed 0.33 m, to the digits of C."""
    normal = np.array([0.4683, 1.1683, -0.7])
    z = (0.4683 - normal[:2] @ [-0.5, 0.8]) / normal[2]
    A, B = np.array([1.0, 0.0, 0.0]), np.array([-0.5, 0.8, z])
    assert_close(z, 0.33, atol=0.005)
    attitude = FixedOrientation(axes_rotation("attitude", ("x", normal), ("z", A - B)))
    path = ff.EndEffectorPath(PolynomialCurve.line(A, B), attitude)
    problem = spatial.replace(path=ff.TimedPath(path, spatial.path.timing))
    for error in errors_of_c(problem):
        assert_agrees("test_example_2_becomes_singular_at_c_with_b_in_its_plane", error)


def errors_of_c(problem: ff.Problem) -> list[float]:
    """Distances of four singular ends from the printed C [m]; the other four branches complete."""
    ends = [simulated(problem, BAD, k) for k in range(8)]
    singular = [motion for motion in ends if motion.ending is Ending.SINGULAR]
    assert len(singular) == 4
    assert all(motion.completed for motion in ends if motion not in singular)
    poses = [problem.model.end_effector_pose(x.final.attitude, x.final.joints) for x in singular]
    return [float(np.linalg.norm(pose.position - C)) for pose in poses]


def test_the_printed_touch_point_leads_back_to_the_printed_attitude(spatial):
    """From q_t, eps_t at tau_t = 0.4225 back to A: [0.46 0.0935 0.7352 -0.489] to 5e-4."""
    attitude = spatial.attitude([0.4295, -0.147, 0.6898, -0.564])
    printed = [0.1, 2.0, 3.3076, -2.6104, 2.2981, 1.4288]
    gaps = {}
    for branch in spatial.branches(attitude, 42.25):
        gap = (branch.joints - printed + np.pi) % (2 * np.pi) - np.pi
        gaps[float(np.abs(gap).max())] = branch.joints
    assert min(gaps) < 3e-3  # four printed digits of the attitude, metres of arm
    joints = gaps[min(gaps)]
    assert spatial.margin.measure(joints) == pytest.approx(-5.0, abs=0.02)
    motion = ff.integrate_motion(spatial, attitude, joints, start=42.25, end=0.0)
    assert motion.completed
    assert motion.final.time == 0.0
    error = np.abs(motion.final.attitude - [0.46, 0.0935, 0.7352, -0.489]).max()
    assert_agrees("test_the_printed_touch_point_leads_back_to_the_printed_attitude", error)
    where = spatial.model.end_effector_pose(motion.final.attitude, motion.final.joints).position
    assert_close(where, [1.0, 0.0, 0.0], atol=1e-8)


def test_example_1_at_140_and_200_degrees(planar):
    """On the paper's branch, S > 0, 140 meets a singularity and 200 completes; both do on S < 0."""
    bad, good = on_side(planar, 140.0, 1), on_side(planar, 200.0, 1)
    assert bad.ending is Ending.SINGULAR
    assert 0.0 < bad.final.time < 69.73
    assert good.completed
    assert ff.closest_approach(good, planar.margin.measure).value > 5.0
    for degrees in (140.0, 200.0):
        other = on_side(planar, degrees, -1)
        assert other.completed
        assert ff.closest_approach(other, planar.margin.measure).sign == -1


TOUCH_POINTS = [
    # segment, tau_t, theta_0t, q_t, where printed, degrees there
    ("FB", 0.9495, -0.7463, [-3.6512, 0.1762, 1.7885], 100.0, 318.9),
    ("FB", 0.9495, -0.7463, [-3.6512, 0.1762, 1.7885], 69.73, 354.2),
    ("AF", 0.4895, 0.9158, [-0.6074, 2.9265, 0.9617], 69.73, 335.3),
    ("AF", 0.6413, 1.5922, [-0.7348, 2.9014, 0.2833], 69.73, 60.9),
    ("AF", 0.6413, 1.5922, [-0.7348, 2.9014, 0.2833], 0.0, 161.0),
]


@pytest.mark.parametrize(("segment", "tau", "theta", "joints", "t", "printed"), TOUCH_POINTS)
def test_printed_touch_points_lead_to_the_printed_headings(
    planar, segment, tau, theta, joints, t, printed
):
    """S = 5 at the printed point, and the motion through it ends at the printed degrees."""
    begin, length = (0.0, 69.73) if segment == "AF" else (69.73, 30.27)
    t_touch, attitude = begin + tau * length, heading_quaternion(theta)
    gaps = {}
    for branch in planar.branches(attitude, t_touch):
        gap = (branch.joints - joints + np.pi) % (2 * np.pi) - np.pi
        gaps[float(np.abs(gap).max())] = branch.joints
    assert min(gaps) < 1e-3
    assert planar.margin.measure(gaps[min(gaps)]) == pytest.approx(5.0, abs=0.03)
    motion = ff.integrate_motion(planar, attitude, gaps[min(gaps)], start=t_touch, end=t)
    assert motion.completed
    result = np.degrees(heading_of(motion.final.attitude))
    error = abs((result - printed + 180.0) % 360.0 - 180.0)
    assert_agrees("test_printed_touch_points_lead_to_the_printed_headings", error)


def test_the_touch_point_at_the_end_leads_to_the_printed_heading_at_f(planar):
    """The touch point at the end B: S = 5 at 259.4 degrees, which is 298.7 degrees at F."""
    attitude = heading(259.4)
    values = {planar.margin.measure(b.joints): b for b in planar.branches(attitude, 100.0)}
    nearest = min(values, key=lambda value: abs(value - 5.0))
    assert nearest == pytest.approx(5.0, abs=0.1)
    motion = ff.integrate_motion(planar, attitude, values[nearest].joints, start=100.0, end=69.73)
    assert np.degrees(heading_of(motion.final.attitude)) == pytest.approx(298.7, abs=0.06)


@pytest.mark.slow
def test_published_ranges_of_example_1(planar):
    """Printed: at A [0, 63] and [161, 360] degrees, as one range across zero, S > 0.

    At F [60.9, 298.7] for both segments, [60.9, 335.3] for the first alone.
    """
    assert (planar.margin.measure.name, planar.margin.threshold) == ("system", 5.0)
    whole, first = (0.0, 100.0), (0.0, 69.73)
    for span, at, expected in (
        (whole, 0.0, (161.0, 423.0)), (whole, 69.73, (60.9, 298.7)), (first, 69.73, (60.9, 335.3)),
    ):  # fmt: skip
        ((interval,), *_) = (
            entry.ranges for entry in heading_ranges(planar, limits_of(planar, span), span, at)
        )
        error = np.abs(np.degrees([interval.low, interval.high]) - expected).max()
        assert_agrees("test_published_ranges_of_example_1", error)


@cache
def limits_of(problem, span):
    return find_range_limits(problem, span)


def test_published_planar_barycentric_lengths(planar_3dof: ff.FreeFloatingModel) -> None:
    """The paper's a, b, c, d."""
    lengths = VirtualManipulator.of(planar_3dof).lengths()
    error = np.abs(np.array(lengths) - [0.424628, 1.783439, 0.966030, 0.399575]).max()
    assert_agrees("test_published_planar_barycentric_lengths", error)
