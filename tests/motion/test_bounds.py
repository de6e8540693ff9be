"""Bounds hold between the points where the measures are evaluated, and are close to them."""

import numpy as np
import pytest
from numpy.polynomial import chebyshev

from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.momentum import Task
from freefloat.motion.bounds import lower_bounds
from freefloat.motion.extrema import closest_approach
from freefloat.motion.margin import Margin
from freefloat.motion.matrix_bounds import ScaledSystem
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.panels import DEGREE, NODES
from freefloat.motion.problem import Problem
from freefloat.paths.curves import PolynomialCurve
from freefloat.paths.orientation import FixedOrientation
from freefloat.paths.path import EndEffectorPath
from freefloat.paths.timing import TimedPath, Timing
from freefloat.robot.model import FreeFloatingModel
from tests.motions import GOOD, followed, heading
from tests.robots import random_robot

ROBOTS = [
    ("RRRRRR", Task.POSE), ("RPRRCR", Task.POSE), ("RRRRRRR", Task.POSE), ("PRRRRRP", Task.POSE),
    ("RRRR", Task.POSITION), ("RPR", Task.POSITION), ("RRRRRFR", Task.POSE),
]  # fmt: skip


def wandering(rng, chain, task, size):
    """Smooth joints of a random robot in two panels, which solve no equation of motion."""
    robot = random_robot(rng, chain)
    model = FreeFloatingModel.from_urdf(robot.text, robot.tip)
    curve = PolynomialCurve.line((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    path = TimedPath(EndEffectorPath(curve, FixedOrientation(np.eye(3))), Timing(1.0))
    problem = Problem(
        model, path, task, np.zeros(3), Margin(singularity_measure(model, task, "gjm"), 0.0)
    )
    c = size * rng.normal(size=(5, model.dof)) / np.arange(1, 6)[:, None] ** 2
    c[0] = rng.uniform(-1.5, 1.5, model.dof)
    x = np.append((NODES[:-1] - 1.0) / 2.0, (NODES + 1.0) / 2.0)
    joints = chebyshev.chebval(x, c).T
    attitudes = np.tile([0.0, 0.0, 0.0, 1.0], (len(x), 1))
    return Motion(problem, Ending.COMPLETED, (x + 1.0) / 2.0, attitudes, joints)


def states(rng, chain, task, count):
    """Scaled systems of random robots with joints, their derivatives by a parameter, and it."""
    for _ in range(count):
        motion = wandering(rng, chain, task, 0.5)
        system, c = ScaledSystem(motion), motion.coefficients[0, :, 5:]
        for x in rng.uniform(-0.99, 0.99, 6):
            yield system, lambda place, c=c: chebyshev.chebval(place, c), c, x


@pytest.mark.parametrize(("chain", "task"), ROBOTS)
def test_the_slope_is_that_of_differences(rng, chain, task):
    for system, joints, c, x in states(rng, chain, task, 4):
        rates, h = chebyshev.chebval(x, chebyshev.chebder(c)), 1e-5
        q = joints(x)
        ahead, behind = system.matrix(q + h * rates), system.matrix(q - h * rates)
        slope = system.slope(q, rates)
        np.testing.assert_allclose(
            slope, (ahead - behind) / (2.0 * h), atol=1e-8 * np.abs(slope).max()
        )


BLOCKS = ("D", "Dq", "base", "linear", "angular")
TIGHT = {"D": 0.02, "Dq": 0.02, "base": 0.05, "linear": 0.05, "angular": 0.2}
"""Fraction of the bound of a block that its second derivative reaches for some random arm."""


def test_second_derivatives_of_every_block_are_bounded(rng):
    """By differences, for arms of all kinds: no factor of a bound can be dropped."""
    reached = dict.fromkeys(BLOCKS, 0.0)
    for chain, task in ROBOTS:
        for system, joints, c, x in states(rng, chain, task, 4):
            h, k = 1e-3, system.base
            before, now, after = (system.matrix(joints(place)) for place in (x - h, x, x + h))
            second = (before - 2.0 * now + after) / h**2
            w, change = (
                system.joint_speed(chebyshev.chebval(x, chebyshev.chebder(c, order)))
                for order in (1, 2)
            )
            bounds = system.second_derivatives(w, change)
            tip = second[k:, k:]
            linear = sum(row < 3 for row in task.rows)
            norms = {
                "D": np.linalg.norm(second[:k, :k]) / bounds.D,
                "Dq": (np.linalg.norm(second[:k, k:], axis=0) / bounds.Dq).max(),
                "base": np.linalg.norm(second[k:, :k]) / bounds.base,
                "linear": np.linalg.norm(tip[:linear], axis=0).max() / bounds.linear,
                "angular": np.linalg.norm(tip[linear:], axis=0).max() / bounds.angular,
            }
            assert np.linalg.norm(second) <= bounds.whole
            for name, ratio in norms.items():
                assert ratio <= 1.0, name
                reached[name] = max(reached[name], ratio)
    assert all(reached[name] >= fraction for name, fraction in TIGHT.items()), reached


def proven(motion, names):
    result = {name: closest_approach(motion, _measure(motion, name)).value for name in names}
    return result, lower_bounds(motion, result)


def _measure(motion, name):
    return singularity_measure(motion.problem.model, motion.problem.task, name)


def assert_holds(motion, bounds):
    places = np.linspace(0.0, motion.panels, 601)
    joints = motion.evaluate(places)[2]
    for name, bound in bounds.bounds.items():
        values = np.abs([_measure(motion, name)(q) for q in joints])
        assert values.min() >= bound * (1.0 - 1e-9), name


@pytest.mark.slow
@pytest.mark.parametrize(("chain", "task"), ROBOTS[1:6])
def test_bounds_hold_on_motions_of_random_robots(rng, chain, task):
    motion = wandering(rng, chain, task, 0.15)
    while closest_approach(motion, _measure(motion, "sigma")).value < 0.01:
        motion = wandering(rng, chain, task, 0.15)
    result, bounds = proven(motion, ("gjm", "system", "sigma"))
    assert all(bounds.bounds[name] >= 0.9 * value for name, value in result.items())
    assert_holds(motion, bounds)


@pytest.mark.slow
def test_bounds_hold_along_the_papers_examples(spatial, planar):
    """Arm and its system in space, the paper's S in the plane."""
    motion = followed(spatial, GOOD, 2).cut(15.0, Ending.MARGIN)  # beyond the closest approach
    result, bounds = proven(motion, ("gjm", "arm", "sigma"))
    assert bounds.bounds["arm"] >= 0.9 * result["arm"]
    assert_holds(motion, bounds)
    motion = followed(planar, heading(200.0), 0)
    result, bounds = proven(motion, ("gjm", "system"))
    assert bounds.bounds["system"] >= 0.9 * result["system"]
    assert_holds(motion, bounds)


def test_nothing_is_proven_of_a_motion_that_passes_a_singularity(planar):
    """Although the values at both ends are far from zero."""
    joints = np.array([0.3, 0.05, 1.0]) * np.ones((DEGREE + 1, 1))
    joints[:, 1] = 0.4 * NODES + 0.013  # the arm stretches on the way
    attitudes = np.tile([0.0, 0.0, 0.0, 1.0], (DEGREE + 1, 1))
    motion = Motion(planar, Ending.COMPLETED, (NODES + 1.0) / 2.0, attitudes, joints)
    ends = {name: min(abs(_measure(motion, name)(q)) for q in motion.joints[[0, -1]])
            for name in ("gjm", "system", "sigma")}  # fmt: skip
    values = [_measure(motion, "gjm")(q) for q in motion.joints]
    assert min(values) < 0.0 < max(values)
    bounds = lower_bounds(motion, ends)
    assert set(bounds.bounds.values()) == {0.0}
