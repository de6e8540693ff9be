"""How near the ensemble's kernels come to the floating-point peak of the computer."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

import freefloat as ff
from benchmarks.result import Result, race
from freefloat.attitude_grids import attitude_grid
from freefloat.ensemble.arrays import kernel_problem
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.ensemble.kernels import flow, records
from freefloat.lockstep.compilation import compiled
from freefloat.lockstep.lanes import WIDTH
from freefloat.lockstep.tables import lanes

sys.path.append(str(Path(__file__).resolve().parents[2]))
from tests import lock_step

ROUNDS, CHAINS = 200_000, 6
COUNTED = (np.add, np.subtract, np.multiply, np.divide, np.sqrt, np.negative)


@compiled
def multiply_and_add(array: np.ndarray, rounds: int) -> None:
    """Chains of multiplications and additions that do not wait for one another."""
    x = lanes(array, 1)
    a, b, c, d, e, f = x[0], x[1], x[2], x[3], x[4], x[5]
    factor = x[6]
    for _ in range(rounds):
        a = a * factor + a
        b = b * factor + b
        c = c * factor + c
        d = d * factor + d
        e = e * factor + e
        f = f * factor + f
    x[0] = a + b + c + d + e + f


@contextmanager
def counted() -> Iterator[list[int]]:
    """Count the operations of plain kernels, for one motion."""
    count = [0]

    def apply(array: Any, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        plain = [np.asarray(entry) for entry in inputs]
        result = np.asarray(getattr(ufunc, method)(*plain, **options))
        if ufunc in COUNTED:
            count[0] += result.size // WIDTH
        return result.view(lock_step.Lanes)

    with patch.object(lock_step.Lanes, "__array_ufunc__", apply):
        yield count


def operations(problem: ff.Problem) -> int:
    """Floating-point operations of one evaluation of (4) for one motion."""
    with lock_step.plain_kernels(), counted() as count:
        arrays = kernel_problem(problem)
        work = records.workspace_in_tables(records.make_workspace(arrays.robot.n, arrays.robot.m))
        tables = records.problem_in_tables(arrays, None, work)
        y = lock_step.Table(np.full((5 + arrays.robot.n, WIDTH), 0.3), 1)
        count[0] = 0
        flow.flow(tables.robot, tables.course, tables.null_space, y, work, 0)
        return count[0]


def bound_results(quick: bool) -> list[Result]:
    problem = ff.load_scenario("spatial_6dof/line").problem()
    number = operations(problem)
    attitudes = attitude_grid(8 if quick else 256)
    branches = problem.many_branches(attitudes)
    where, _ = np.nonzero(branches.exist)
    starts, joints = attitudes[where], branches.joints[branches.exist]
    integrator, array = EnsembleIntegrator(problem, 1), np.full((7, WIDTH), 1e-9)
    evaluations = int(integrator.integrate(starts, joints).evaluations.sum())
    multiply_and_add(array, 1)
    taken, chains = race(
        lambda: integrator.integrate(starts, joints),
        lambda: multiply_and_add(array, ROUNDS), rounds=1 if quick else 5,
    )  # fmt: skip
    peak = 2 * CHAINS * WIDTH * ROUNDS / chains
    return [
        Result(
            "an evaluation of (4) in an ensemble, one core", taken / evaluations,
            f"{number:,} floating-point operations at the peak of {peak / 1e9:.0f} GFLOP/s",
            number / peak, remark="steps, measure and minima included",
        )
    ]  # fmt: skip
