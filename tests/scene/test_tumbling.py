"""Torque-free rotation: symmetric bodies in closed form, invariants, values that are refused.

The general case is compared with Jacobi's elliptic functions in tests/validation/test_scene.py.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from tests.errors import error_key


@pytest.mark.parametrize("spin", [0.3, -1.2])
def test_a_symmetric_body_precesses_steadily(spin):
    across, along = 3.0, 2.0
    rate = np.array([0.4, 0.1, spin])
    momentum = np.array([across, across, along]) * rate
    tumbling = ff.Tumbling([across, across, along], rate)
    for t in (0.0, 3.0, 40.0):
        precession = Rotation.from_rotvec(momentum / across * t)
        own = Rotation.from_rotvec([0.0, 0.0, (1.0 - along / across) * spin * t])
        expected = (precession * own).as_matrix()
        np.testing.assert_allclose(tumbling.rotation(t), expected, rtol=0, atol=1e-11)


def test_the_axes_of_the_body_are_free(rng):
    """With the inertia in rotated axes the motion is the same."""
    R = Rotation.random(rng=rng).as_matrix()
    moments, rate = np.array([3.0, 4.0, 5.0]), np.array([0.1, 0.5, -0.2])
    principal, rotated = (
        ff.Tumbling(moments, rate),
        ff.Tumbling(R @ np.diag(moments) @ R.T, R @ rate),
    )
    for t in (1.0, 25.0):
        expected = R @ principal.rotation(t) @ R.T
        np.testing.assert_allclose(rotated.rotation(t), expected, rtol=0, atol=1e-11)


def test_angular_momentum_stays_in_inertial_space(rng):
    tumbling = ff.Tumbling([3.0, 4.0, 5.0], rng.normal(size=3))
    L = tumbling.inertia @ tumbling.rate
    step = 1e-4
    for t in rng.uniform(0.0, 50.0, 5):
        before, after = (tumbling.rotation(t + side) for side in (-step, step))
        R = tumbling.rotation(t)
        omega = Rotation.from_matrix(before.T @ after).as_rotvec() / (2.0 * step)
        np.testing.assert_allclose(R @ tumbling.inertia @ omega, L, rtol=0, atol=1e-6)
        assert np.linalg.norm(omega) <= tumbling.largest_rate


def test_time_runs_backward_too():
    """Rotating on from an earlier time leads to the attitude at time zero."""
    tumbling = ff.Tumbling([3.0, 4.0, 5.0], [0.1, 0.5, -0.2])
    R, step = tumbling.rotation(-7.0), 1e-5
    after = tumbling.rotation(-7.0 + step)
    rate = Rotation.from_matrix(R.T @ after).as_rotvec() / step
    onward = ff.Tumbling(tumbling.inertia, rate)
    np.testing.assert_allclose(R @ onward.rotation(7.0), np.eye(3), rtol=0, atol=1e-4)


def test_a_body_at_rest_stays():
    assert (ff.Tumbling([1.0, 1.0, 1.0], [0.0, 0.0, 0.0]).rotation(1e6) == np.eye(3)).all()


@pytest.mark.parametrize(("arguments", "key"), [
    (([1.0, 1.0, 5.0], [0.0, 0.0, 1.0]), "tumbling.inertia"),
    (([1.0, 1.0, 1.0], [0.0, 1.0]), "tumbling.rate"),
])  # fmt: skip
def test_values_that_no_body_has_are_refused(arguments, key):
    assert error_key(ff.Tumbling, *arguments) == key


def test_too_many_revolutions_are_refused():
    assert error_key(ff.Tumbling([1.0, 1.0, 1.0], [0.0, 0.0, 1.0]).rotation, 1e5) == "t"
