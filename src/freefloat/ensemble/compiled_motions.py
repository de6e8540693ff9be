"""Precise motions by the kernels, with trajectory: polynomials through the ends of their steps.

Between the ends of two steps a motion is the polynomial of fifth order through three neighbouring
ends and their rates, whose error is below that of the steps. Panels, see
:mod:`freefloat.motion.panels`, span several steps, as many as their polynomials can follow.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from freefloat.dynamics.redundancy import Metric
from freefloat.ensemble.endings import COMPLETED, MAX_STEPS
from freefloat.errors import MissingNumbaError
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.panels import NODES, TO_COEFFICIENTS
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, IntArray

_TOLERANCE = 1e-10
"""A tenth of it is that of the steps."""
_STEPS = 8
"""Largest number of steps in a panel."""
_ERROR = 1e-9
"""Largest last coefficient of a panel's polynomials [rad, m]."""


def precise_motion(problem: Problem, attitude: Array, joints: Array) -> Motion:
    """A motion along the whole path, by the kernels where these can give it precisely.

    Motions that end early end exactly where :func:`~freefloat.motion.integration.integrate_motion`
    ends them. It also integrates those with further arms on joint curves, or with damped rates.
    """
    base = problem.redundancy is not None and problem.redundancy.metric is Metric.BASE
    motion = None if base or problem.arms else _compiled(problem, attitude, joints)
    return motion or integrate_motion(problem, attitude, joints)


def _compiled(problem: Problem, attitude: Array, joints: Array) -> Motion | None:
    """The kernels' motion; None where it ends early, or steps are too few between two breaks."""
    try:
        from freefloat.ensemble.ensemble import EnsembleIntegrator  # compiled kernels import slowly
    except MissingNumbaError:
        return None
    n, integrator = problem.model.arm_dof, EnsembleIntegrator(problem, 1, tolerance=_TOLERANCE)
    rows = np.empty((MAX_STEPS + 2, 9 + 2 * n))
    result = integrator.integrate(attitude[None], joints[None], stricter=True, steps=rows)
    if result.endings[0] != COMPLETED:
        return None
    rows = rows[1 : 1 + int(rows[0, 0])]
    rows[:, 0] *= problem.path.duration
    rows[:, 5 + n :] /= problem.path.duration
    legs = np.searchsorted(rows[:, 0], [0.0, *problem.breaks, problem.path.duration])
    if (np.diff(legs) < 2).any():
        return None
    panels = [_panels(rows[first : last + 1], n) for first, last in pairwise(legs.tolist())]
    nodes = np.vstack([rows[:1, : 5 + n], *panels])
    nodes[:, 1:5] /= np.linalg.norm(nodes[:, 1:5], axis=1, keepdims=True)
    return Motion(problem, Ending.COMPLETED, nodes[:, 0], nodes[:, 1:5], nodes[:, 5:])


def _panels(rows: Array, n: int) -> Array:
    """Nodes but the first of the panels of a leg, time, attitude and joints, (8 P, 5 + n)."""
    last = len(rows) - 1
    edges = np.linspace(0, last, -(-last // _STEPS) + 1).astype(np.int64)
    while True:
        starts, ends = rows[edges[:-1], :1], rows[edges[1:], :1]
        times = starts + (ends - starts) * (NODES + 1.0) / 2.0
        values = _interpolated(rows, times.ravel(), n).reshape(*times.shape, -1)
        errors = np.abs(TO_COEFFICIENTS[-2:] @ values).max(axis=(1, 2))
        rough = (errors > _ERROR) & (np.diff(edges) > 1)
        if not rough.any():
            nodes = np.concatenate([times[..., None], values], axis=2)
            return nodes[:, 1:].reshape(-1, 5 + n)
        edges = np.union1d(edges, (edges[:-1] + edges[1:])[rough] // 2)


def _interpolated(rows: Array, times: Array, n: int) -> Array:
    """Attitudes and joints at times (K,) by Newton's divided differences, shape (K, 4 + n)."""
    interval = np.clip(np.searchsorted(rows[:, 0], times, "right") - 1, 0, len(rows) - 2)
    first = np.minimum(interval // 2 * 2, len(rows) - 3)
    ends: IntArray = np.repeat(first[:, None] + np.arange(3), 2, axis=1)
    t, table, rates = rows[ends, 0], rows[ends, 1 : 5 + n], rows[ends[:, 1:], 5 + n :]
    coefficients = [table[:, 0]]
    for order in range(1, 6):
        spans = (t[:, order:] - t[:, :-order])[..., None]
        same = spans == 0.0
        table = np.diff(table, axis=1) / np.where(same, 1.0, spans)
        table = np.where(same, rates, table) if order == 1 else table
        coefficients.append(table[:, 0])
    values = coefficients[5]
    for k in range(4, -1, -1):
        values = values * (times - t[:, k])[:, None] + coefficients[k]
    return values
