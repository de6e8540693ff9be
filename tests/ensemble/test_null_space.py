"""Compiled motions of redundant arms agree with single integration."""

import numpy as np
import pytest

from freefloat.ensemble.endings import COMPLETED
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.ensemble.kernels import flow as flow_kernels
from freefloat.ensemble.kernels.records import BY_TIME, FORWARD, SEGMENT
from freefloat.ensemble.systems import Systems
from freefloat.lockstep.lanes import WIDTH
from freefloat.so3 import angle_between
from tests.lock_step import Kernels, plain_kernels
from tests.redundant import ARMS, choices, redundant

EVERYTHING = [(*arm, k) for arm in ARMS for k in range(9)]


@pytest.mark.parametrize(("structure", "task", "number"), EVERYTHING)
def test_rates_agree_with_pinocchio(structure, task, number):
    """At random states, to rounding or, toward sigma, to the error of differences."""
    assert_same_rates(structure, task, choices(structure, task, 7)[number], number)


def assert_same_rates(structure, task, redundancy, seed):
    """Compiled rates are those of the precise solver at random states."""
    start = redundant(structure, task, redundancy, 7)
    problem, rng, T = start.problem, np.random.default_rng(seed), start.problem.path.duration
    n, times = problem.model.dof, np.repeat([3.0, 12.0], WIDTH // 2)
    joints = start.joints + rng.uniform(-0.5, 0.5, (WIDTH, n))
    with plain_kernels():
        kernels = Kernels(problem)
        work, course = kernels.work, kernels.problem.course
        work.h.array[:] = Systems.of(problem).columns(1).T
        work.status[BY_TIME], work.status[FORWARD] = 1.0, 1.0
        work.status[SEGMENT] = np.searchsorted([*problem.path.breaks], times)
        y = kernels.column(np.column_stack(
            [np.tile(start.attitude, (WIDTH, 1)), joints, times / T]
        ))  # fmt: skip
        determinant, _ = flow_kernels.flow(
            kernels.robot, course, kernels.problem.null_space, y, work, 0
        )
    derivatives = work.K.array.reshape(-1, 7, WIDTH)[:, 0].T / T
    solver, a, w = problem.resolved_rate_solver(), start.attitude[:3], start.attitude[3]
    for k, t in enumerate(times.tolist()):
        omega, expected = solver.rates(start.attitude, joints[k], *problem.path.twist_and_speed(t))
        scale = np.abs(expected).max()
        exact = 1e-6 if problem.redundancy.toward == "sigma" else 1e-9
        change, rates = derivatives[k, :4], derivatives[k, 4 : 4 + n]
        np.testing.assert_allclose(rates, expected, rtol=0, atol=exact * scale)
        turning = 2.0 * (w * change[:3] - change[3] * a - np.cross(a, change[:3]))
        np.testing.assert_allclose(turning, omega, rtol=0, atol=exact * max(scale, 1.0))
        assert determinant[k] == pytest.approx(problem.margin.measure(joints[k]), rel=1e-9)


@pytest.mark.parametrize("number", [1, 5, 8])
def test_compiled_motions_retrace(number):
    """An end before the start goes back the same way."""
    structure, task = ARMS[0]
    start = redundant(structure, task, choices(structure, task)[number])
    integrator = EnsembleIntegrator(start.problem, 1, tolerance=1e-9)
    there, end = integrator.integrate(start.attitude[None], start.joints[None]), np.array([20.0])
    assert there.endings[0] == COMPLETED
    back = integrator.integrate(there.attitudes, there.joints, starts=end, ends=0.0 * end)
    np.testing.assert_allclose(back.joints[0], start.joints, rtol=0, atol=1e-5)
    assert angle_between(back.attitudes[0], start.attitude) < 1e-5
