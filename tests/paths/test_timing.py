"""Time laws: from rest to rest, at rest at every stop, derivatives exact, never backwards."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import freefloat as ff
from freefloat.paths.curves import PolynomialCurve
from freefloat.paths.directed_orientation import DirectedOrientation
from freefloat.paths.orientation import SlerpOrientation
from freefloat.paths.timing import Stop, TimeLaw
from tests.errors import error_key

assert_close = partial(np.testing.assert_allclose, rtol=0)

LAWS = [law for law in TimeLaw if law is not TimeLaw.UNIFORM]


@st.composite
def timings(draw):
    """Any law, duration and number of stops."""
    count = draw(st.integers(0, 3))
    fractions = st.lists(st.floats(0.05, 1.0), min_size=count + 1, max_size=count + 1)
    duration = draw(st.floats(1e-3, 1e6))
    places, times = (np.cumsum(draw(fractions)) for _ in "st")
    stops = zip(places[:-1] / places[-1], duration * times[:-1] / times[-1], strict=True)
    return ff.Timing(duration, draw(st.sampled_from(LAWS)), tuple(Stop(s, t) for s, t in stops))


@given(timings())
def test_every_law_rests_at_its_ends_and_stops(timing):
    """s = 0 and ds/dt = 0 at the start, s_i and 0 at every stop, 1 and 0 at the end."""
    rests = [Stop(0.0, 0.0), *timing.stops, Stop(1.0, timing.duration)]
    for rest in rests:
        assert timing.s(rest.t) == pytest.approx(rest.s, abs=1e-12)
        assert timing.s(rest.t, 1) * timing.duration == pytest.approx(0.0, abs=1e-10)


@given(timings(), st.floats(0.001, 0.999))
def test_every_order_is_the_derivative_of_the_one_below(timing, fraction):
    for k, (low, high) in enumerate(zip((0.0, *timing.ends), timing.ends, strict=False)):
        t, h = low + fraction * (high - low), 1e-2 * (high - low)
        for order in (1, 2):
            weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
            slope = sum(
                w * (timing.s(t + i * h, order - 1, k) - timing.s(t - i * h, order - 1, k))
                for i, w in weights.items()
            ) / h  # fmt: skip
            result = timing.s(t, order, k) * (high - low) ** order
            assert result == pytest.approx(slope * (high - low) ** order, abs=1e-9)


@given(timings())
def test_time_never_runs_backwards_along_the_path(timing):
    """ds/dt >= 0, so s rises from 0 to 1."""
    t = np.linspace(0.0, timing.duration, 301)
    rates = np.array([timing.s(x, 1) for x in t]) * timing.duration
    places = np.array([timing.s(x) for x in t])
    assert rates.min() > -1e-10
    assert np.diff(places).min() > -1e-12
    assert (places >= -1e-12).all()
    assert (places <= 1.0 + 1e-12).all()


@given(timings())
def test_place_and_speed_are_continuous_where_segments_meet(timing):
    for segment, end in enumerate(timing.ends[:-1]):
        for order, tolerance in ((0, 1e-12), (1, 1e-9)):
            both = [
                timing.s(end, order, k) * timing.duration**order for k in (segment, segment + 1)
            ]
            assert both[0] == pytest.approx(both[1], abs=tolerance)


def test_the_quintic_is_that_of_18b():
    """s = 10 tau^3 - 15 tau^4 + 6 tau^5, and the printed time at F follows from it (19)."""
    timing = ff.Timing(100.0)
    for tau, s in ((0.0, 0.0), (0.25, 0.103515625), (0.5, 0.5), (0.75, 0.896484375), (1.0, 1.0)):
        assert timing.s(100.0 * tau) == pytest.approx(s, abs=1e-15)
        assert timing.s(100.0 * tau, 1) == pytest.approx(0.3 * tau**2 * (1 - tau) ** 2, abs=1e-16)
    assert timing.s(69.73) == pytest.approx(2.5 / 3.0, abs=1e-4)


def test_the_trapezoid_speeds_up_cruises_and_slows_down():
    timing = ff.Timing(100.0, TimeLaw.TRAPEZOIDAL)
    assert timing.ends == pytest.approx((25.0, 75.0, 100.0))
    for t in (25.0, 40.0, 75.0):
        assert timing.s(t, 1) == pytest.approx(4.0 / 300.0)
    assert timing.s(25.0) == pytest.approx(1.0 / 6.0)
    assert timing.s(75.0) == pytest.approx(5.0 / 6.0)
    assert [timing.s(t, 2) * 1e4 for t in (10.0, 50.0, 90.0)] == pytest.approx([16 / 3, 0, -16 / 3])


@pytest.mark.parametrize("duration", [0.0, np.nan])
def test_a_duration_is_a_positive_number(duration):
    """Zero, negative and endless durations are refused by name."""
    assert error_key(ff.Timing, duration) == "timing.duration"


@pytest.mark.parametrize("law", LAWS)
def test_a_timed_path_moves_with_the_twist_of_its_pose(law):
    """v_E = (d pose / ds) ds/dt (33a), and the poses are those of the path at s(t)."""
    path = ff.EndEffectorPath(
        PolynomialCurve([[2.0, 0.0, 0.0], [-3.0, 0.5, 0.3], [0.0, 1.5, -0.4]]),
        SlerpOrientation(np.eye(3), np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])),
    )
    timed, h = ff.TimedPath(path, ff.Timing(20.0, law, (Stop(0.4, 9.0),))), 1e-4
    assert timed.duration == 20.0
    for t in (1.0, 4.5, 8.0, 12.0, 19.0):
        pose = timed.pose(t)
        assert (pose.position == path.pose(timed.timing.s(t)).position).all()
        velocity = (timed.pose(t + h).position - timed.pose(t - h).position) / (2 * h)
        assert_close(timed.twist(t)[:3], velocity, atol=1e-8)
        rotation_rate = (timed.pose(t + h).rotation - timed.pose(t - h).rotation) / (2 * h)
        W = rotation_rate @ pose.rotation.T
        assert_close(timed.twist(t)[3:], [W[2, 1], W[0, 2], W[1, 0]], atol=1e-8)


@pytest.mark.parametrize("law", LAWS)
def test_the_twist_rate_is_the_derivative_of_the_twist(law):
    curve = PolynomialCurve([[2.0, 0.0, 0.0], [-3.0, 0.5, 0.3], [0.0, 1.5, -0.4]])
    path = ff.EndEffectorPath(curve, DirectedOrientation.follow(curve, "x", [0.1, 0.2, 1.0]))
    timed, h = ff.TimedPath(path, ff.Timing(20.0, law, (Stop(0.4, 9.0),))), 1e-3
    for t in (0.01, 1.0, 4.5, 8.0, 12.0, 19.99):
        rate = (timed.twist(t + h) - timed.twist(t - h)) / (2 * h)
        assert_close(timed.twist_rate(t), rate, atol=1e-6)


def test_rounding_beyond_the_end_is_no_rest() -> None:
    timing = ff.Timing(40.0, "uniform")
    assert timing.s(40.00000000000001, 1) == timing.s(-1e-15, 1) == pytest.approx(1.0 / 40.0)
    assert timing.s(40.1, 1) == timing.s(-0.1, 1) == 0.0
