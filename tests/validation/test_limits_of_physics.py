"""What must come out whatever the arm: heavy spacecraft, ways back, closed loops, time."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.dynamics.momentum import end_effector_jacobian
from freefloat.paths.curves import Curve
from freefloat.paths.orientation import FixedOrientation
from freefloat.paths.timing import Stop, TimeLaw
from tests.motions import BAD, GOOD, bundled, heading, problem_with, relative, simulated, two
from tests.robots import Robot, joint_values, robots
from tests.validation.comparisons import assert_agrees

assert_close = partial(np.testing.assert_allclose, rtol=0)


def apart(first, second):
    differences = [getattr(first, name) - getattr(second, name)
                   for name in ("joints", "attitude", "base_position")]  # fmt: skip
    return np.abs(np.concatenate(differences)).max()


def there_and_back(problem, attitude, branch):
    there = simulated(problem, attitude, branch)
    assert there.completed
    final = there.final
    back = ff.integrate_motion(
        problem, final.attitude, final.joints, start=problem.path.duration, end=0.0
    )
    return there, back


@pytest.mark.parametrize(
    ("name", "attitude", "branch"),
    [("spatial_6dof/line", GOOD, 2), ("spatial_6dof/line", BAD, 0),
     ("planar_3dof/parabola", heading(200.0), 0),
     ("planar_3dof/parabola_nonstop", heading(330.0), 0)],
)  # fmt: skip
def test_out_and_back_returns_the_start(name, attitude, branch):
    """Appendix A: the reverse motion with -h retraces the forward one, stops included."""
    there, back = there_and_back(bundled(name), attitude, branch)
    assert back.completed
    assert back.final.time == 0.0
    assert_agrees("test_out_and_back_returns_the_start", apart(back.final, there.initial))


def timed(problem, momentum, timing):
    path = ff.TimedPath(problem.path.path, timing)
    motion = simulated(replace(problem, path=path, momentum=momentum), GOOD, 2)
    assert motion.completed
    return motion.final


LAWS = [
    ff.Timing(100.0, TimeLaw.CUBIC),
    ff.Timing(100.0, TimeLaw.TRAPEZOIDAL),
    ff.Timing(100.0, TimeLaw.QUINTIC, (Stop(0.3, 45.0), Stop(0.7, 75.0))),
    ff.Timing(3.0),
    ff.Timing(1e4),
]


@pytest.mark.parametrize("timing", LAWS)
def test_without_momentum_the_end_does_not_depend_on_time(spatial, timing):
    """h = 0: the motion of the base is geometric, whatever the law, the stops, the duration."""
    usual = timed(spatial, [0, 0, 0], ff.Timing(100.0))
    other = timed(spatial, [0, 0, 0], timing)
    assert_agrees("test_without_momentum_the_end_does_not_depend_on_time", apart(other, usual))


class JointLoop(Curve):
    """The end-effector curve while q = (0.3 + 0.6 cos u, 0.7 + 0.6 sin u), h = 0, u = 2 pi s.

    In the plane as complex numbers, from masses and lengths alone: what moves with the spacecraft,
    with joint 1 and with joint 2 gives the angular momentum about the centre of mass.
    """

    MASSES, MOMENTS = np.array([40.0, 4.0, 3.0]), np.array([6.667, 0.333, 0.25])

    def __init__(self, aside, loops=1):
        self.tool, self.loops = 1.0 + 1j * aside, loops
        count = 256
        u = 2.0 * np.pi * np.arange(count) / count
        rates = np.fft.rfft([self.drift(x) for x in u]) / count
        self.mean, self.waves = rates[0].real, 2.0 * rates[1:60]

    def bodies(self, q):
        """Centres of mass, joints and end-effector, with the spacecraft at heading zero."""
        a, b = np.exp(1j * q[0]), np.exp(1j * (q[0] + q[1]))
        points = np.array(
            [0.0, 0.5 + 0.5 * a, 0.5 + a + 0.5 * b, 0.5, 0.5 + a, 0.5 + a + self.tool * b]
        )
        return points - self.MASSES @ points[:3] / self.MASSES.sum()

    def rows(self, q):
        """Angular momentum and end-effector velocity per rate of heading, q1 and q2."""
        p, m = self.bodies(q), self.MASSES
        momentum, velocity = [], []
        for first in range(3):
            pivot = 0.0 if first == 0 else p[2 + first]
            v = np.where(np.arange(3) >= first, 1j * (p[:3] - pivot), 0.0)
            drift = m @ v / m.sum()
            spin = self.MOMENTS[first:].sum()
            momentum.append(float((m * (p[:3].conj() * (v - drift)).imag).sum() + spin))
            velocity.append(1j * (p[5] - pivot) - drift)
        return np.array(momentum), np.array(velocity)

    def joints(self, u):
        q = np.array([0.3 + 0.6 * np.cos(u), 0.7 + 0.6 * np.sin(u)])
        return q, 0.6 * np.array([-np.sin(u), np.cos(u)])

    def drift(self, u):
        """d heading / du by conservation of momentum."""
        q, rate = self.joints(u)
        h, _ = self.rows(q)
        return -(h[1:] @ rate) / h[0]

    def heading(self, u):
        k = np.arange(1, len(self.waves) + 1)
        return self.mean * u + float((self.waves / (1j * k) * (np.exp(1j * k * u) - 1)).sum().real)

    def __call__(self, s, order=0):
        if np.ndim(s):
            return np.array([self(each, order) for each in s])
        if order == 2:
            return (self(s + 1e-5, 1) - self(s - 1e-5, 1)) / 2e-5
        u = 2.0 * np.pi * self.loops * s
        (q, rate), rotation = self.joints(u), np.exp(1j * self.heading(u))
        if order == 0:
            value = self.bodies(q)[5]
        else:
            value = self.rows(q)[1] @ [self.drift(u), *rate] * 2.0 * np.pi * self.loops
        return np.array([(rotation * value).real, (rotation * value).imag, 0.0])


def looping(aside, loops, law=TimeLaw.QUINTIC):
    model, upright = ff.FreeFloatingModel.from_urdf(two(aside), "tool"), FixedOrientation(np.eye(3))
    loop, timing = JointLoop(aside, loops), ff.Timing(30.0 * loops, law)
    problem = problem_with(model, ff.Task.PLANAR_POSITION, [0, 0, 0], loop, upright, timing)
    return ff.integrate_motion(problem, [0, 0, 0, 1], [0.9, 0.7])


@pytest.mark.parametrize("law", TimeLaw)
def test_a_closed_joint_loop_turns_the_spacecraft_by_the_golden_angle(law):
    """40/4/3: once round, the base has turned by -2.35462974398 degrees, the joints are back."""
    angle, _ = quad(JointLoop(1.5).drift, 0.0, 2.0 * np.pi, epsabs=1e-13)
    assert np.degrees(angle) == pytest.approx(-2.35462974398, abs=1e-10)
    motion = looping(1.5, 1, law)
    assert motion.completed
    assert_close(motion.final.joints, [0.9, 0.7], atol=1e-8)
    rotation = np.degrees(Rotation.from_quat(motion.final.attitude).as_rotvec()[2])
    assert_agrees(
        "test_a_closed_joint_loop_turns_the_spacecraft_by_the_golden_angle",
        abs(rotation + 2.35462974398),
    )
    (half,) = motion.sample(15.0)
    assert_close(half.joints, [-0.3, 0.7], atol=1e-8)


@pytest.mark.slow
@given(data=st.data(), robot=robots(branch=st.just("")))
def test_heavy_base_recovers_the_fixed_base_arm(data: st.DataObject, robot: Robot) -> None:
    """On a spacecraft 100 times heavier the arm is 100 times nearer to one on a fixed base."""
    light, heavy = (
        ff.FreeFloatingModel.from_urdf(robot.text, robot.end_effector, scale_mass={"bus": factor})
        for factor in (1e5, 1e7)
    )
    q = data.draw(joint_values(light.dof))
    fixed_base = end_effector_jacobian(light, q)[:, 6:]
    near, nearer = (
        relative(ff.generalized_jacobian(model, q), fixed_base) for model in (light, heavy)
    )
    assert near < 0.02
    assert_agrees("test_heavy_base_recovers_the_fixed_base_arm", abs(100.0 * nearer / near - 1.0))
