"""Bounds hold between the points where the measures are evaluated, and are close to them."""

import numpy as np
import pytest
from numpy.polynomial import chebyshev

import freefloat as ff
from freefloat.certificate.bounds import Intervals, _ArmBounds, _Neighbourhood, lower_bounds
from freefloat.certificate.matrix_bounds import ScaledSystem
from freefloat.motion.law import PathLaw
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.panels import DEGREE, NODES
from freefloat.paths.curves import PolynomialCurve
from freefloat.paths.orientation import FixedOrientation
from tests.motions import GOOD, heading, simulated
from tests.robots import random_robot

ROBOTS = [
    ("RRRRRR", ff.Task.POSE), ("RPRRCR", ff.Task.POSE), ("RRRRRRR", ff.Task.POSE),
    ("PRRRRRP", ff.Task.POSE),
    ("RRRR", ff.Task.POSITION), ("RPR", ff.Task.POSITION), ("RRRRRFR", ff.Task.POSE),
]  # fmt: skip


def wandering(rng, chain, task, size):
    """Smooth joints of a random robot in two panels, which solve no equation of motion."""
    robot = random_robot(rng, chain)
    model = ff.FreeFloatingModel.from_urdf(robot.text, robot.end_effector)
    c = size * rng.normal(size=(5, model.dof)) / np.arange(1, 6)[:, None] ** 2
    c[0] = rng.uniform(-1.5, 1.5, model.dof)
    return moving(model, task, c)


def moving(model, task, c):
    """Joints by Chebyshev coefficients (K, n) in two panels."""
    curve = PolynomialCurve.line((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    path = ff.TimedPath(ff.EndEffectorPath(curve, FixedOrientation(np.eye(3))), ff.Timing(1.0))
    problem = ff.Problem(
        model, path, task, np.zeros(3), ff.Margin(ff.singularity_measure(model, task, "gjm"), 0.0)
    )
    x = np.append((NODES[:-1] - 1.0) / 2.0, (NODES + 1.0) / 2.0)
    joints = chebyshev.chebval(x, c).T
    attitudes = np.tile([0.0, 0.0, 0.0, 1.0], (len(x), 1))
    return Motion(PathLaw(problem), Ending.COMPLETED, (x + 1.0) / 2.0, attitudes, joints)


def states(rng, chain, task, count):
    """Scaled systems of random robots with joints, their derivatives by a parameter, and it."""
    for _ in range(count):
        motion = wandering(rng, chain, task, 0.5)
        system, c = ScaledSystem(motion), motion.coefficients[0, :, 5:]
        for x in rng.uniform(-0.99, 0.99, 6):
            yield system, lambda place, c=c: chebyshev.chebval(place, c), c, x


BLOCKS = ("D", "Dq", "base", "linear", "angular")
TIGHT = {"D": 0.02, "Dq": 0.02, "base": 0.05, "linear": 0.05, "angular": 0.2}
"""Fraction of the bound of a block that its second derivative reaches for some random arm."""


def test_second_derivatives_of_every_block_are_bounded(rng):
    """By differences, for arms of all kinds."""
    reached = dict.fromkeys(BLOCKS, 0.0)
    for chain, task in ROBOTS:
        for system, joints, c, x in states(rng, chain, task, 4):
            h, k = 1e-3, system.base
            places = np.array([joints(place) for place in (x - h, x, x + h)])
            before, now, after = system.matrices(places, np.zeros_like(places))[0]
            second = (before - 2.0 * now + after) / h**2
            w, change = (
                system.joint_speed(chebyshev.chebval(x, chebyshev.chebder(c, order)))
                for order in (1, 2)
            )
            bounds = system.second_derivatives(w, change)
            end_effector = second[k:, k:]
            linear = sum(row < 3 for row in task.rows)
            norms = {
                "D": np.linalg.norm(second[:k, :k]) / bounds.D,
                "Dq": (np.linalg.norm(second[:k, k:], axis=0) / bounds.Dq).max(),
                "base": np.linalg.norm(second[k:, :k]) / bounds.base,
                "linear": np.linalg.norm(end_effector[:linear], axis=0).max() / bounds.linear,
                "angular": np.linalg.norm(end_effector[linear:], axis=0).max() / bounds.angular,
            }
            assert np.linalg.norm(second) <= bounds.whole
            for name, ratio in norms.items():
                assert ratio <= 1.0, name
                reached[name] = max(reached[name], ratio)
    assert all(reached[name] >= fraction for name, fraction in TIGHT.items()), reached


@pytest.mark.parametrize("half", [0.1, 0.3])
def test_neighbourhoods_are_exact_where_the_matrix_shrinks_evenly(half):
    """A = diag(D, S): the largest decrease that slope and second derivative allow."""
    A, ones, b = np.diag([3.0, 0.5]), np.ones(1), 0.4
    shrinking = _Neighbourhood.about(A, np.diag([0.0, -0.4]), 1, half, (0.0, 0.0), ones)
    assert shrinking.smallest_singular_value() == pytest.approx(0.5 - 0.4 * half)
    bending = _Neighbourhood.about(A, np.zeros((2, 2)), 1, half, (b, 0.0), ones)
    assert bending.smallest_singular_value() == pytest.approx(0.5 - half**2 / 2.0 * b)
    for near, factor in (
        (_Neighbourhood.about(np.eye(2), -0.2 * np.eye(2), 1, half, (0.0, 0.0), ones),
         1.0 - 0.2 * half),
        (_Neighbourhood.about(np.eye(2), np.zeros((2, 2)), 1, half, (b, 0.0), ones),
         1.0 - half**2 / 2.0 * b / np.sqrt(2.0)),
    ):  # fmt: skip
        determinant = 2.0 * np.log(factor)
        assert 1.01 * determinant < near.log_determinant(by_locked=False) <= determinant
    growing = _Neighbourhood.about(A, np.zeros((2, 2)), 1, half, (0.0, b), ones)
    increase = np.log(1.0 + half**2 / 2.0 * b / 3.0)
    decrease = growing.log_determinant(by_locked=True) - np.log(0.5)
    assert -1.01 * increase < decrease <= -increase
    together = _Neighbourhood.about(A, np.diag([0.6, 0.0]), 1, half, (0.0, 0.0), ones)
    assert together.log_determinant(by_locked=True) - np.log(0.5) > -0.6 * (0.2 * half) ** 2


@pytest.mark.parametrize("order", [1, 2])
def test_the_second_derivative_of_the_arm_is_bounded(spatial, order):
    """By differences, over all angles: of joints that move evenly, and that begin to move."""
    c, h, value = np.zeros((3, 6)), 1e-3, _measure_of(spatial, "arm")
    c[order, 1:3] = 0.01, 0.02
    largest = 0.0
    for q2, q3 in np.random.default_rng(1).uniform(-np.pi, np.pi, (200, 2)):
        c[0, 1:3] = q2, q3
        before, now, after = (value(chebyshev.chebval(x, c)) for x in (-h, 0.0, h))
        largest = max(largest, abs(before - 2.0 * now + after) / h**2)
    attitudes = np.tile([0.0, 0.0, 0.0, 1.0], (DEGREE + 1, 1))
    joints = chebyshev.chebval(NODES, c).T
    motion = Motion(PathLaw(spatial), Ending.COMPLETED, (NODES + 1.0) / 2.0, attitudes, joints)
    half = 1e-2
    (bound,) = _ArmBounds(motion).bounds(Intervals(np.array([0]), np.zeros(1), half))["arm"]
    slope = (value(chebyshev.chebval(h, c)) - value(chebyshev.chebval(-h, c))) / (2.0 * h)
    second = 2.0 / half**2 * (abs(value(chebyshev.chebval(0.0, c))) - half * abs(slope) - bound)
    assert largest <= second < 3.0 * largest


def proven(motion, names):
    result = {name: ff.closest_approach(motion, _measure(motion, name)).value for name in names}
    return result, lower_bounds(motion, result)


def _measure(motion, name):
    return _measure_of(motion.problem, name)


def _measure_of(problem, name):
    return ff.singularity_measure(problem.model, problem.task, name)


def assert_holds(motion, bounds):
    places = np.linspace(0.0, motion.panels, 601)
    joints = motion.evaluate(places)[2]
    for name, bound in bounds.bounds.items():
        values = np.abs([*map(_measure(motion, name), joints)])
        assert values.min() >= bound * (1.0 - 1e-9), name


@pytest.mark.slow
@pytest.mark.parametrize(("chain", "task"), ROBOTS[1:6])
def test_bounds_hold_on_motions_of_random_robots(rng, chain, task):
    motion = wandering(rng, chain, task, 0.15)
    while ff.closest_approach(motion, _measure(motion, "sigma")).value < 0.01:
        motion = wandering(rng, chain, task, 0.15)
    result, bounds = proven(motion, ("gjm", "system", "sigma"))
    assert all(bounds.bounds[name] >= 0.9 * value for name, value in result.items())
    assert_holds(motion, bounds)


@pytest.mark.slow
def test_bounds_hold_along_the_papers_examples(spatial, planar):
    """Arm and its system in space, the paper's S in the plane."""
    motion = simulated(spatial, GOOD, 2).cut(15.0, Ending.MARGIN)  # beyond the closest approach
    result, bounds = proven(motion, ("gjm", "arm", "sigma"))
    assert bounds.bounds["arm"] >= 0.9 * result["arm"]
    assert_holds(motion, bounds)
    motion = simulated(planar, heading(200.0), 0)
    result, bounds = proven(motion, ("gjm", "system"))
    assert bounds.bounds["system"] >= 0.9 * result["system"]
    assert_holds(motion, bounds)


@pytest.mark.slow
def test_nothing_is_proven_of_a_motion_that_passes_a_singularity(planar):
    """Although the values at both ends are far from zero."""
    joints = np.array([0.3, 0.05, 1.0]) * np.ones((DEGREE + 1, 1))
    joints[:, 1] = 0.4 * NODES + 0.013  # the arm stretches on the way
    attitudes = np.tile([0.0, 0.0, 0.0, 1.0], (DEGREE + 1, 1))
    motion = Motion(PathLaw(planar), Ending.COMPLETED, (NODES + 1.0) / 2.0, attitudes, joints)
    ends = {name: min(abs(_measure(motion, name)(q)) for q in motion.joints[[0, -1]])
            for name in ("gjm", "system", "sigma")}  # fmt: skip
    values = [_measure(motion, "gjm")(q) for q in motion.joints]
    assert min(values) < 0.0 < max(values)
    bounds = lower_bounds(motion, ends)
    assert set(bounds.bounds.values()) == {0.0}
