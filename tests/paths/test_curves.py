"""Curves: geometry known in closed form, and derivatives that are exactly the slopes."""

from functools import partial

import numpy as np
import pytest

from freefloat.paths.curves import ArcCurve, PolynomialCurve, SplineCurve
from tests.errors import error_key

assert_close = partial(np.testing.assert_allclose, rtol=0)

POINTS = np.array([[0.0, 0.0, 0.0], [1.0, 0.5, -0.2], [1.3, 1.5, 0.4], [0.2, 2.0, 0.1], [0, 1, 1]])
CURVES = {
    "line": PolynomialCurve.line([1.0, 0.0, 0.0], [-0.5, 0.8, 0.33]),
    "parabola": PolynomialCurve([[2.0, 0.0, 0.0], [-3.0, 0.5, 0.0], [0.0, 1.5, 0.0]]),
    "quintic": PolynomialCurve(np.random.default_rng(1).normal(size=(6, 3))),
    "arc": ArcCurve([0.1, 0.2, 0.3], [1.1, 0.2, 0.3], [0.0, 1.0, 2.0], 2.5),
    "reversed arc": ArcCurve([0.0, 0.0, 0.0], [0.0, 2.0, 0.0], [3.0, 0.0, 0.0], -1.2),
    "spline": SplineCurve(POINTS),
    "spline with s": SplineCurve(POINTS, [0.0, 0.2, 0.5, 0.9, 1.0]),
    "two points": SplineCurve(POINTS[:2]),
    "three points": SplineCurve(POINTS[:3]),
}
PLACES = [0.0, 0.137, 0.31, 0.4567, 0.72, 0.951, 1.0]


@pytest.fixture(params=CURVES)
def curve(request):
    return CURVES[request.param]


def slope(function, s, h=1e-3):
    """Central differences of eighth order."""
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    return sum(w * (function(s + k * h) - function(s - k * h)) for k, w in weights.items()) / h


@pytest.mark.parametrize("order", [1, 2])
def test_every_order_is_the_derivative_of_the_one_below(curve, order):
    """d/ds r^(k-1) = r^(k), also at the ends, where the curve goes on smoothly."""
    for s in PLACES:
        result = slope(lambda x: curve(x, order - 1), s)
        assert_close(curve(s, order), result, rtol=1e-9, atol=1e-9)


def test_an_arc_is_right_handed_about_its_normal():
    quarter = ArcCurve([1.0, 1.0, 1.0], [3.0, 1.0, 1.0], [0.0, 0.0, 5.0], np.pi / 2)
    assert_close(quarter(0.0), [3.0, 1.0, 1.0], atol=1e-15)
    assert_close(quarter(0.5), 1.0 + np.sqrt([2.0, 2.0, 0.0]), atol=1e-15)
    assert_close(quarter(1.0), [1.0, 3.0, 1.0], atol=1e-15)
    back = ArcCurve([1.0, 1.0, 1.0], [3.0, 1.0, 1.0], [0.0, 0.0, 5.0], -np.pi / 2)
    assert_close(back(1.0), [1.0, -1.0, 1.0], atol=1e-15)


@pytest.mark.parametrize(
    ("key", "arguments"),
    [
        ("start", ([0, 0, 0], [1, 0, 0.01], [0, 0, 1], 1.0)),
        ("normal", ([0, 0, 0], [1, 0, 0], [0, 0, 0], 1.0)),
    ],
    ids=["off the plane", "no normal"],
)
def test_an_impossible_arc_is_refused(key, arguments):
    assert error_key(ArcCurve, *arguments) == key


@pytest.mark.parametrize("s", [None, [0.0, 0.2, 0.5, 0.9, 1.0]])
def test_a_spline_passes_its_points_where_it_should(s):
    """r(s_i) = p_i, with s_i by chord length when none are given."""
    spline = SplineCurve(POINTS, s)
    chords = np.linalg.norm(np.diff(POINTS, axis=0), axis=1)
    expected = np.append(0.0, np.cumsum(chords) / chords.sum()) if s is None else s
    assert_close(spline.knots, expected, atol=1e-15)
    for knot, point in zip(spline.knots, POINTS, strict=True):
        assert_close(spline(knot), point, atol=1e-14)


@pytest.mark.parametrize("name", ["spline", "spline with s"])
@pytest.mark.parametrize("order", [0, 1, 2])
def test_a_spline_is_twice_continuously_differentiable(name, order):
    """At every inner knot the limits of r, r' and r'' from both sides agree (C2)."""
    spline, h = CURVES[name], 1e-6
    for knot in spline.knots[1:-1]:
        jump = spline(knot + h, order) - spline(knot - h, order)
        higher = spline(knot, order + 1) if order < 2 else slope(lambda s: spline(s, 2), knot, h)
        assert np.abs(jump).max() < 3e-6 * max(1.0, np.abs(higher).max())


@pytest.mark.parametrize("points", [POINTS[:1], [[0, 0, 0], [1, 0, 0], [1, 0, 0]]])
def test_an_impossible_spline_is_refused(points):
    assert error_key(SplineCurve, points) == "points"
