"""Torque-free rotation: symmetric bodies in closed form, invariants, values that are refused.

The general case is compared with Jacobi's elliptic functions in tests/validation/test_scene.py.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from tests.errors import error_key


def test_the_axes_of_the_body_are_free(rng):
    R = Rotation.random(rng=rng).as_matrix()
    moments, rate = np.array([3.0, 4.0, 5.0]), np.array([0.1, 0.5, -0.2])
    principal = ff.Tumbling(moments, rate)
    rotated = ff.Tumbling(R @ np.diag(moments) @ R.T, R @ rate)
    for t in (1.0, 25.0):
        expected = R @ principal.rotation(t) @ R.T
        np.testing.assert_allclose(rotated.rotation(t), expected, rtol=0, atol=1e-11)


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
