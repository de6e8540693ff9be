"""Attitude laws: axes where they should point, and rates that are the exact angular velocity."""

from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.paths.curves import ArcCurve, PolynomialCurve, SplineCurve
from freefloat.paths.directed_orientation import DirectedOrientation
from freefloat.paths.orientation import FixedOrientation, OrientationSpline, SlerpOrientation
from tests.errors import error_key

assert_close = partial(np.testing.assert_allclose, rtol=0)

PLACES = [0.0, 0.137, 0.31, 0.4567, 0.72, 0.951, 1.0]
ROTATIONS = Rotation.from_quat(np.random.default_rng(3).normal(size=(6, 4)))
START, END = ROTATIONS[0].as_matrix(), ROTATIONS[1].as_matrix()
CUBIC = PolynomialCurve([[2.0, 0.0, 0.0], [-3.0, 0.5, 0.3], [0.0, 1.5, -0.4], [0.2, 0.1, 0.6]])
ARC = ArcCurve([0.0, 0.0, 0.2], [1.0, 0.0, 0.2], [0.0, 0.0, 1.0], 2.0)
SPLINE = SplineCurve([[0, 0, 0], [1, 0.4, 0.1], [1.5, 1.4, 0.5], [0.7, 2, 0.2]])
NORMAL = [0.2, -0.1, 1.0]
TARGET = np.array([0.3, -1.7, 2.1])
KNOTS = np.array([0.0, 0.15, 0.35, 0.6, 0.8, 1.0])
GENTLE = Rotation.from_rotvec(np.cumsum(np.random.default_rng(4).uniform(-0.8, 0.8, (6, 3)), 0))
LAWS = {
    "fixed": FixedOrientation(START),
    "slerp": SlerpOrientation(START, END),
    "slerp by nearly pi": SlerpOrientation(
        START, Rotation.from_rotvec([0, 3.14159, 0]).as_matrix()),
    "slerp that stays": SlerpOrientation(START, START),
    "slerp by a little": SlerpOrientation(START, Rotation.from_rotvec([1e-9, 0, 0]).as_matrix()),
    **{f"follow {axis}": DirectedOrientation.follow(CUBIC, axis, NORMAL)
       for axis in ("x", "-x", "y", "-y")},
    "follow an arc": DirectedOrientation.follow(ARC, "x", [0.0, 0.0, 1.0]),
    "follow a spline": DirectedOrientation.follow(SPLINE, "-y", [0.0, 0.0, 1.0]),
    **{f"point {axis}": DirectedOrientation.point_at(CUBIC, axis, TARGET)
       for axis in ("x", "-x", "y", "-y", "z", "-z")},
    "point from a spline": DirectedOrientation.point_at(SPLINE, "z", TARGET),
    "sampled": OrientationSpline(GENTLE.as_quat(), KNOTS),
}  # fmt: skip


@pytest.fixture(params=LAWS)
def law(request):
    return LAWS[request.param]


def column(rotation, axis):
    """The direction of a named axis, minus sign included."""
    return (-1.0 if axis.startswith("-") else 1.0) * rotation[:, "xyz".index(axis[-1])]


def angular_velocity(law, s, h=1e-3):
    """Angular velocity from R' R^T, R' by central differences of eighth order."""
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    slope = sum(w * (law.rotation(s + k * h) - law.rotation(s - k * h)) for k, w in weights.items())
    W = slope / h @ law.rotation(s).T
    return np.array([W[2, 1] - W[1, 2], W[0, 2] - W[2, 0], W[1, 0] - W[0, 1]]) / 2.0


def test_the_rate_is_the_angular_velocity_of_the_rotation(law):
    """dR/ds = omega x R in inertial axes, also at the ends, where the law goes on smoothly."""
    for s in PLACES:
        assert_close(law.rate(s), angular_velocity(law, s), atol=1e-9)


def test_a_slerp_goes_from_start_to_end_by_the_shortest_rotation_at_a_constant_rate():
    """R(s) = exp(s phi) R(0), |phi| at most pi."""
    law, phi = LAWS["slerp"], Rotation.from_matrix(END @ START.T).as_rotvec()
    assert_close(law.rotation(0.0), START, atol=1e-14)
    assert_close(law.rotation(1.0), END, atol=1e-14)
    assert np.linalg.norm(phi) < np.pi
    for s in PLACES:
        assert_close(law.rate(s), phi, atol=1e-14)
        half = Rotation.from_rotvec(s * phi).as_matrix() @ START
        assert_close(law.rotation(s), half, atol=1e-14)


@pytest.mark.parametrize("axis", ["x", "-x", "y", "-y"])
def test_follow_looks_along_the_path_with_z_nearest_to_the_normal(axis):
    law = DirectedOrientation.follow(CUBIC, axis, NORMAL)
    for s in PLACES:
        R, tangent = law.rotation(s), CUBIC(s, 1) / np.linalg.norm(CUBIC(s, 1))
        assert_close(column(R, axis), tangent, atol=1e-14)
        upright = NORMAL - (NORMAL @ tangent) * tangent
        assert_close(R[:, 2], upright / np.linalg.norm(upright), atol=1e-14)


@pytest.mark.parametrize("axis", ["x", "-x", "y", "-y", "z", "-z"])
def test_point_at_keeps_its_axis_on_the_target(axis):
    """The named axis is the unit vector from the end-effector to the target."""
    law = DirectedOrientation.point_at(CUBIC, axis, TARGET)
    for s in PLACES:
        sight = TARGET - CUBIC(s)
        pointed = column(law.rotation(s), axis)
        assert_close(pointed, sight / np.linalg.norm(sight), atol=1e-14)


@pytest.mark.parametrize(("axis", "second"), [("x", 1), ("-y", 2), ("z", 0)])
def test_point_at_settles_roll_by_the_axis_farthest_from_all_sights(axis, second):
    line = PolynomialCurve.line([2.0, 0.3, 0.1], [2.0, -0.3, 0.15])
    law = DirectedOrientation.point_at(line, axis, [0.0, 0.0, 0.0])
    for s in PLACES:
        sight = -line(s) / np.linalg.norm(line(s))
        near = np.array([0.0, 0.0, 1.0]) - sight[2] * sight
        result = law.rotation(s)[:, second]
        assert_close(result, near / np.linalg.norm(near), atol=1e-14)


@pytest.mark.parametrize("place", [0.0, 0.123456])
def test_directions_that_do_not_exist_are_refused(place):
    """Of paths that turn back or run along the normal, to a target on the path, along all axes."""
    back = PolynomialCurve(np.outer([place**2, -2.0 * place, 1.0], [1.0, 0.5, 0.0]))
    rising = PolynomialCurve([[0, 0, 0], [-2 * place, 0, 1.0], [1.0, 0, 0]])
    for curve in (back, rising):
        with pytest.raises(ff.InputError):
            DirectedOrientation.follow(curve, "x", [0.0, 0.0, 1.0])
    line = PolynomialCurve.line([1.0, 0.0, 0.2], [-1.0, 0.4, 0.3])
    corner = SplineCurve([[1, 0, 0], [0, 1, 0], [0, 0, 1]])  # no inertial axis to settle roll by
    for curve, target in ((line, line(place)), (corner, np.zeros(3))):
        with pytest.raises(ff.InputError):
            DirectedOrientation.point_at(curve, "x", target)


def test_a_sampled_attitude_passes_its_samples():
    """R(s_i) is the rotation of quaternion i."""
    for knot, rotation in zip(KNOTS, GENTLE, strict=True):
        result = LAWS["sampled"].rotation(knot)
        assert_close(result, rotation.as_matrix(), atol=1e-13)


def test_a_sampled_orientation_has_continuous_acceleration():
    """At inner samples omega and its derivative have no jump (C2)."""
    law, h = LAWS["sampled"], 1e-5

    def acceleration(s, side):
        step = side * h
        return (-3 * law.rate(s) + 4 * law.rate(s + step) - law.rate(s + 2 * step)) / (2 * step)

    for knot in KNOTS[1:-1]:
        jump = law.rate(knot + 1e-9) - law.rate(knot - 1e-9)
        assert np.abs(jump).max() < 1e-6
        both = acceleration(knot, 1.0), acceleration(knot, -1.0)
        assert_close(both[0], both[1], atol=1e-4 * np.abs(both[0]).max() + 1e-4)


@pytest.mark.parametrize(
    "values",
    [START + 1e-5, -START, np.full((3, 3), np.nan), [0.0, 0.0, 0.0, 2.0], np.eye(4), "upright"],
)  # fmt: skip
def test_orientation_laws_refuse_what_is_no_rotation(values):
    laws = {"axes": FixedOrientation, "end": partial(SlerpOrientation, START)}
    for key, law in laws.items():
        assert error_key(law, values) == key
