"""Bounds between points: they hold wherever one looks, and are close to what is found."""

import numpy as np
import pytest
from numpy.polynomial import chebyshev

from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.momentum import Task
from freefloat.io.scenario import load_scenario
from freefloat.motion.bounds import lower_bounds
from freefloat.motion.closest_approach import closest_approach
from freefloat.motion.integration import integrate_motion
from freefloat.motion.matrix_bounds import ScaledSystem
from freefloat.motion.motion import DEGREE, NODES, Ending, Motion
from freefloat.motion.problem import Margin, Problem
from freefloat.paths.curves import PolynomialCurve
from freefloat.paths.orientation import FixedOrientation
from freefloat.paths.path import EndEffectorPath
from freefloat.paths.timing import TimedPath, Timing
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import heading_quaternion
from tests.robots import random_robot

ROBOTS = [
    ("RRRRRR", Task.POSE), ("RPRRCR", Task.POSE), ("RRRRRRR", Task.POSE), ("PRRRRRP", Task.POSE),
    ("RRRR", Task.POSITION), ("RPR", Task.POSITION), ("RRRRRFR", Task.POSE),
]  # fmt: skip


def wandering(rng, chain, task, size):
    """A motion that no equation knows: smooth joints of a random robot, two panels."""
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


@pytest.mark.parametrize(("chain", "task"), ROBOTS)
def test_the_matrix_bends_no_more_than_bounded(rng, chain, task):
    """Second derivatives by differences, of the whole matrix and of D, at many places."""
    worst = 0.0
    for _ in range(4):
        motion = wandering(rng, chain, task, 0.5)
        system, c = ScaledSystem.of(motion), motion.coefficients[0, :, 5:]
        rates, bends = chebyshev.chebder(c), chebyshev.chebder(c, 2)
        for x in rng.uniform(-0.99, 0.99, 6):
            h = 1e-3
            before, now, after = (
                system.matrix(chebyshev.chebval(place, c)) for place in (x - h, x, x + h)
            )
            second = (before - 2.0 * now + after) / h**2
            w = system.quickness(chebyshev.chebval(x, rates))
            change = system.quickness(chebyshev.chebval(x, bends))
            whole, locked = system.bends(w, change)
            assert np.linalg.norm(second) <= whole
            assert np.linalg.norm(second[: system.base, : system.base]) <= locked
            worst = max(worst, np.linalg.norm(second) / whole)
            slope = system.slope(chebyshev.chebval(x, c), chebyshev.chebval(x, rates))
            np.testing.assert_allclose(
                slope, (after - before) / (2.0 * h), atol=2e-5 * np.abs(slope).max()
            )
    assert worst > 0.02  # or nothing could be proven with it


def proven(motion, names):
    found = {name: closest_approach(motion, _measure(motion, name)).value for name in names}
    return found, lower_bounds(motion, found)


def _measure(motion, name):
    return singularity_measure(motion.problem.model, motion.problem.task, name)


def holds(motion, bounds):
    """Look at very many places whether the bounds hold."""
    places = np.linspace(0.0, motion.panels, 601)
    joints = motion.evaluate(places)[2]
    for name, bound in bounds.bounds.items():
        values = np.abs([_measure(motion, name)(q) for q in joints])
        assert values.min() >= bound * (1.0 - 1e-9), name


@pytest.mark.parametrize(("chain", "task"), ROBOTS)
def test_bounds_hold_on_motions_of_random_robots(rng, chain, task):
    count = 0
    while count < 1:
        motion = wandering(rng, chain, task, 0.15)
        found = {name: closest_approach(motion, _measure(motion, name)).value
                 for name in ("gjm", "system", "sigma")}  # fmt: skip
        if found["sigma"] < 0.01:
            continue
        count += 1
        bounds = lower_bounds(motion, found)
        assert all(bounds.bounds[name] >= 0.9 * value for name, value in found.items())
        holds(motion, bounds)


def test_bounds_hold_along_the_papers_examples():
    """Arm and its system in space, the paper's S in the plane."""
    problem = load_scenario("spatial_6dof/line").problem()
    attitude = problem.attitude("attitude", [0.46008, 0.09337, 0.73519, -0.48898])
    motion = integrate_motion(problem, attitude, problem.branches(attitude)[2].joints)
    found, bounds = proven(motion, ("gjm", "arm", "sigma"))
    assert bounds.bounds["arm"] >= 0.9 * found["arm"]
    holds(motion, bounds)
    problem = load_scenario("planar_3dof/parabola").problem()
    attitude = heading_quaternion(np.deg2rad(200.0))
    motion = integrate_motion(problem, attitude, problem.branches(attitude)[0].joints)
    found, bounds = proven(motion, ("gjm", "system"))
    assert bounds.bounds["system"] >= 0.9 * found["system"]
    holds(motion, bounds)


def test_nothing_is_proven_of_a_motion_that_passes_a_singularity():
    """Values at points that jump over it are not believed."""
    problem = load_scenario("planar_3dof/parabola").problem()
    joints = np.array([0.3, 0.05, 1.0]) * np.ones((DEGREE + 1, 1))
    joints[:, 1] = 0.4 * NODES + 0.013  # the arm stretches on the way
    attitudes = np.tile([0.0, 0.0, 0.0, 1.0], (DEGREE + 1, 1))
    motion = Motion(problem, Ending.COMPLETED, (NODES + 1.0) / 2.0, attitudes, joints)
    places = np.array([0.0, 1.0])
    jumped = {name: float(np.abs([_measure(motion, name)(q)
                                  for q in motion.evaluate(places)[2]]).min())
              for name in ("gjm", "system", "sigma")}  # fmt: skip
    values = [_measure(motion, "gjm")(q) for q in motion.joints]
    assert min(values) < 0.0 < max(values)
    bounds = lower_bounds(motion, jumped)
    assert set(bounds.bounds.values()) == {0.0}
