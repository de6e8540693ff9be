"""Joint rates of least angular velocity of the spacecraft: metric ``base``."""

from dataclasses import replace

import numpy as np
import pytest

import freefloat as ff
from freefloat.dynamics import resolved_rates
from freefloat.dynamics.momentum import end_effector_jacobian, momentum_map
from freefloat.dynamics.redundancy import DAMPED_BELOW, Metric, Toward
from freefloat.motion.panels import NODES, with_slopes
from tests.redundant import ARMS, redundant

BASE = ff.Redundancy(Metric.BASE)
REACTIONLESS = [("RRRRRRR", ff.Task.POSITION), ("5", ff.Task.PLANAR_POSITION)]
"""Arms whose null space has more dimensions than the spacecraft's attitude."""
EVERY_ARM = [*ARMS, REACTIONLESS[0]]


def general_solution(start, joints):
    """S*, its right side, and the spacecraft's rate per joint rate and at rest, body frame."""
    model, task = start.problem.model, start.problem.task
    A, J = (f(model, joints, start.attitude) for f in (momentum_map, end_effector_jacobian))
    J = J[task.rows]
    per_rate = -np.linalg.solve(A[:, :6], A[:, 6:])
    at_rest = np.linalg.solve(A[:, :6], np.append(np.zeros(3), start.problem.momentum))
    twist, _ = start.problem.path.twist_and_speed(5.0)
    y = twist[task.rows] - J[:, :6] @ at_rest
    return J[:, 6:] + J[:, :6] @ per_rate, y, per_rate[3:], at_rest[3:]


def rates_of(problem, start, joints):
    """Angular velocity and joint rates of a problem at some joints."""
    motion = problem.path.twist_and_speed(5.0)
    return problem.resolved_rate_solver().rates(start.attitude, joints, *motion)


@pytest.mark.parametrize(("structure", "task"), EVERY_ARM)
def test_rates_are_the_closed_form(structure, task, monkeypatch):
    """S^+ y + N z, where z of least norm minimizes the angular velocity; without damping."""
    monkeypatch.setattr(resolved_rates, "DAMPED_BELOW", 1e-9)
    start = redundant(structure, task, BASE)
    S, y, per_rate, at_rest = general_solution(start, start.joints)
    u, N = np.linalg.pinv(S) @ y, np.linalg.svd(S)[2][len(S) :].T
    z = np.linalg.lstsq(per_rate @ N, -(at_rest + per_rate @ u), rcond=1e-9)[0]
    omega, rates = rates_of(start.problem, start, start.joints)
    np.testing.assert_allclose(rates, u + N @ z, rtol=0, atol=1e-7 * np.abs(rates).max())
    expected = at_rest + per_rate @ (u + N @ z)
    np.testing.assert_allclose(omega, expected, rtol=0, atol=1e-8 * np.abs(at_rest).max())


@pytest.mark.parametrize(("structure", "task"), EVERY_ARM)
def test_damping_bounds_the_rates(structure, task):
    """Everywhere: the task is met, the spacecraft no faster, and the joint rates bounded."""
    start, rng = redundant(structure, task, BASE), np.random.default_rng(3)
    plain = replace(start.problem, redundancy=None)
    for _ in range(60):
        joints = rng.uniform(-np.pi, np.pi, len(start.joints))
        S, y, per_rate, _ = general_solution(start, joints)
        omega_plain, u = rates_of(plain, start, joints)
        omega, rates = rates_of(start.problem, start, joints)
        np.testing.assert_allclose(S @ rates, y, rtol=0, atol=1e-10 * np.linalg.norm(rates))
        assert np.linalg.norm(omega) <= np.linalg.norm(omega_plain) * (1.0 + 1e-9)
        limit = DAMPED_BELOW * np.linalg.norm(per_rate)
        assert np.linalg.norm(rates - u) <= 1.07 * np.linalg.norm(omega_plain) / limit


@pytest.mark.parametrize(("structure", "task"), REACTIONLESS)
@pytest.mark.parametrize("toward", list(Toward))
def test_the_spacecraft_stands_still(structure, task, toward):
    """Where the arm has the freedom and no momentum is stored; also with an attraction."""
    settings = ff.Redundancy(Metric.BASE, toward, 0.5)
    start = redundant(structure, task, settings, seed=1, momentum=False)
    omega, rates = rates_of(start.problem, start, start.joints)
    assert np.linalg.norm(omega) < 1e-12 * np.linalg.norm(rates)
    if toward is not Toward.NONE:
        _, plain = rates_of(replace(start.problem, redundancy=BASE), start, start.joints)
        assert np.linalg.norm(rates - plain) > 1e-3 * np.linalg.norm(plain)


def test_the_polynomials_inside_steps_have_the_rates_of_the_equation():
    """Also in steps in which the damping sets in: `check` differentiates the stored motion."""
    start = redundant("PRFRPRR", ff.Task.POSITION, BASE)
    motion = ff.integrate_motion(start.problem, start.attitude, start.joints)
    panel, x = np.repeat(np.arange(motion.panels), len(NODES)), np.tile(NODES, motion.panels)
    moving, states, slopes = with_slopes(motion.coefficients, panel, x)
    states[:, 1:5] /= np.linalg.norm(states[:, 1:5], axis=1)[:, None]
    where = states[:, 0], states[:, 1:5], states[:, 5:], motion.timing_segment(panel[moving])
    exact = motion.law.rates(*where).joints
    assert np.abs(slopes[:, 5:] - exact).max() < 2e-6 * np.abs(exact).max()
