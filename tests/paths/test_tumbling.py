"""Torque-free rotation against closed forms: Jacobi's elliptic functions, symmetric bodies."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation
from scipy.special import ellipj

from freefloat.errors import InputError
from freefloat.paths.tumbling import Tumbling

TURNS = 10.0


def to_z(direction):
    """The shortest rotation of a unit vector onto z, shape (3, 3)."""
    x, y, z = direction
    return Rotation.from_quat([y, -x, 0.0, 1.0 + z]).as_matrix()


class Elliptic:
    """Jacobi's solution: moments A < B < C, no rate about the middle axis at time zero.

    The attitude is the shortest rotation of the angular momentum's direction u onto z after the
    rotation about z by an angle, of rate (omega . (u + z)) / (1 + u_z).
    """

    def __init__(self, moments, p, r):
        A, B, C = self.moments = np.array(moments)
        self.rate = np.array([p, 0.0, r])
        self.twice_energy = A * p**2 + C * r**2
        self.momentum = float(np.hypot(A * p, C * r))
        across, along = (
            self.twice_energy * C - self.momentum**2,
            self.momentum**2 - A * self.twice_energy,
        )
        assert along > across * (B - A) / (C - B)  # it circles about the axis of C
        self.speed = np.sqrt((C - B) * along / (A * B * C))
        self.parameter = (B - A) * across / ((C - B) * along)
        self.sizes = np.sqrt(
            [across / (A * (C - A)), across / (B * (C - B)), along / (C * (C - A))]
        )

    def rates(self, t):
        sn, cn, dn, _ = ellipj(self.speed * t, self.parameter)
        return self.sizes * [cn, sn, dn]

    def precession(self, t):
        r = self.rates(t)[2]
        return (self.twice_energy / self.momentum + r) / (1.0 + self.moments[2] * r / self.momentum)

    def rotation(self, t):
        steps = np.linspace(0.0, t, 2 + int(t / 2.0))
        angle = sum(
            quad(self.precession, low, high, epsabs=1e-13, epsrel=1e-13)[0]
            for low, high in pairwise(steps)
        )
        turn = Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix()
        first, last = (to_z(self.moments * self.rates(u) / self.momentum) for u in (0.0, t))
        return first.T @ turn @ last


@pytest.mark.parametrize(("moments", "p", "r"), [
    ((40.0, 70.0, 90.0), 0.05, 0.1),
    ((40.0, 70.0, 90.0), 0.0979, 0.08),  # near the unstable rotation
    ((1.0, 1.5, 2.2), -0.7, 0.9),
    ((5.0, 5.1, 9.0), 2.0, 1.9),
])  # fmt: skip
def test_ten_revolutions_are_those_of_jacobi(moments, p, r):
    exact = Elliptic(moments, abs(p), r)
    sign = np.diag([np.sign(p), np.sign(p), 1.0])  # a half-turn about z of the whole motion
    tumbling = Tumbling(np.array(moments), [p, 0.0, r])
    revolution = 2.0 * np.pi / np.linalg.norm(exact.rate)
    for t in TURNS * revolution * np.array([0.013, 0.21, 0.5, 0.77, 1.0]):
        expected = sign @ exact.rotation(t) @ sign
        np.testing.assert_allclose(tumbling.rotation(t), expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("spin", [0.3, -1.2])
def test_a_symmetric_body_precesses_steadily(spin):
    across, along = 3.0, 2.0
    rate = np.array([0.4, 0.1, spin])
    momentum = np.array([across, across, along]) * rate
    tumbling = Tumbling([across, across, along], rate)
    for t in (0.0, 3.0, 40.0):
        precession = Rotation.from_rotvec(momentum / across * t)
        own = Rotation.from_rotvec([0.0, 0.0, (1.0 - along / across) * spin * t])
        expected = (precession * own).as_matrix()
        np.testing.assert_allclose(tumbling.rotation(t), expected, rtol=0, atol=1e-11)


def test_the_axes_of_the_body_are_free(rng):
    """With the inertia in rotated axes the motion is the same."""
    R = Rotation.random(rng=rng).as_matrix()
    moments, rate = np.array([3.0, 4.0, 5.0]), np.array([0.1, 0.5, -0.2])
    principal, rotated = Tumbling(moments, rate), Tumbling(R @ np.diag(moments) @ R.T, R @ rate)
    for t in (1.0, 25.0):
        expected = R @ principal.rotation(t) @ R.T
        np.testing.assert_allclose(rotated.rotation(t), expected, rtol=0, atol=1e-11)


def test_angular_momentum_stays_in_inertial_space(rng):
    tumbling = Tumbling([3.0, 4.0, 5.0], rng.normal(size=3))
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
    tumbling = Tumbling([3.0, 4.0, 5.0], [0.1, 0.5, -0.2])
    R, step = tumbling.rotation(-7.0), 1e-5
    after = tumbling.rotation(-7.0 + step)
    rate = Rotation.from_matrix(R.T @ after).as_rotvec() / step
    onward = Tumbling(tumbling.inertia, rate)
    np.testing.assert_allclose(R @ onward.rotation(7.0), np.eye(3), rtol=0, atol=1e-4)


def test_a_body_at_rest_stays():
    assert (Tumbling([1.0, 1.0, 1.0], [0.0, 0.0, 0.0]).rotation(1e6) == np.eye(3)).all()


@pytest.mark.parametrize(("arguments", "key"), [
    (([1.0, 1.0, 5.0], [0.0, 0.0, 1.0]), "tumbling.inertia"),
    (([1.0, 1.0, 1.0], [0.0, 1.0]), "tumbling.rate"),
    (([1.0, 1.0, 1.0], [0.0, 0.0, 1.0], [0.0]), "tumbling.com"),
])  # fmt: skip
def test_values_that_no_body_has_are_refused(arguments, key):
    with pytest.raises(InputError) as caught:
        Tumbling(*arguments)
    assert caught.value.key == key


def test_too_many_revolutions_are_refused():
    with pytest.raises(InputError) as caught:
        Tumbling([1.0, 1.0, 1.0], [0.0, 0.0, 1.0]).rotation(1e5)
    assert caught.value.key == "t"
