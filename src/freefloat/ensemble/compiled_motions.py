"""Precise motions by the kernels: panels of polynomials through the ends of their steps.

Between steps a motion is a polynomial of fifth order, through three ends of steps and their rates;
a panel, see :mod:`freefloat.motion.panels`, spans as many steps as its polynomials can follow.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from freefloat.ensemble.endings import COMPLETED, MAX_STEPS
from freefloat.errors import MissingNumbaError
from freefloat.motion.integration import integrate_motion
from freefloat.motion.law import PathLaw
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.panels import NODES, TO_COEFFICIENTS
from freefloat.motion.problem import Problem
from freefloat.so3 import Array

_TOLERANCE = 1e-10
"""Tolerance of motions; a tenth of it is the tolerance of the steps."""
_PANEL_STEPS, _ERROR = 8, 1e-9
"""Most steps of a panel; largest last coefficients and differences through other steps [rad, m]."""


def precise_motion(problem: Problem, attitude: Array, joints: Array) -> Motion:
    """A motion along the whole path, by the kernels where these can give it precisely.

    The reference engine gives motions that end early, exactly up to their singularity, and motions
    with further arms on joint curves; see :func:`.integration.integrate_motion`.
    """
    motion = None if problem.robot_varies else _compiled(problem, attitude, joints)
    return motion or integrate_motion(problem, attitude, joints)


def _compiled(problem: Problem, attitude: Array, joints: Array) -> Motion | None:
    """The kernels' motion; None where it ends early, or its steps do not give all digits."""
    try:
        from freefloat.ensemble.ensemble import EnsembleIntegrator  # compiled kernels import slowly
    except MissingNumbaError:
        return None
    n, duration = problem.dof, problem.path.duration
    rows = np.empty((MAX_STEPS + 2, 9 + 2 * n))
    result = EnsembleIntegrator(problem, 1, tolerance=_TOLERANCE).integrate(
        attitude[None], joints[None], stricter=True, steps=rows
    )
    rows = rows[1 : 1 + int(rows[0, 0])]
    rows[:, 0] *= duration
    rows[:, 5 + n :] /= duration
    times = np.array([0.0, *problem.breaks, duration])
    legs = np.abs(rows[:, :1] - times).argmin(axis=0)
    rows[legs, 0] = times  # the kernels' times are these up to rounding
    if result.endings[0] != COMPLETED or (np.diff(legs) < 2).any():
        return None
    panels = [rows[:1, : 5 + n]]
    for leg in (rows[first : last + 1] for first, last in pairwise(legs.tolist())):
        panels.append(_panels(leg, n))
        differences = _interpolated(leg, panels[-1][:, 0], n, 1) - panels[-1][:, 1:]
        if np.abs(differences).max() > _ERROR:
            return None
    nodes = np.vstack(panels)
    nodes[:, 1:5] /= np.linalg.norm(nodes[:, 1:5], axis=1, keepdims=True)
    return Motion(PathLaw(problem), Ending.COMPLETED, nodes[:, 0], nodes[:, 1:5], nodes[:, 5:])


def _panels(rows: Array, n: int) -> Array:
    """Nodes but the first of the panels of a leg, time, attitude and joints, (8 P, 5 + n)."""
    last = len(rows) - 1
    edges = np.linspace(0, last, -(-last // _PANEL_STEPS) + 1).astype(np.int64)
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


def _interpolated(rows: Array, times: Array, n: int, shift: int = 0) -> Array:
    """Attitudes and joints at times (K,) by Newton's divided differences, shape (K, 4 + n)."""
    windows = np.arange(-shift, len(rows) - 1, 2).clip(0, len(rows) - 3)
    ends = rows[np.repeat(windows[:, None] + np.arange(3), 2, axis=1)]  # each end counts twice
    t, table, coefficients = ends[..., 0], ends[..., 1 : 5 + n], [ends[:, 0, 1 : 5 + n]]
    for order in range(1, 6):
        spans = (t[:, order:] - t[:, :-order])[..., None]
        slopes = np.diff(table, axis=1) / np.where(spans == 0.0, 1.0, spans)
        table = np.where(spans == 0.0, ends[:, order:, 5 + n :], slopes)
        coefficients.append(table[:, 0])
    of = np.clip(np.searchsorted(rows[windows, 0], times, "right") - 1, 0, None)
    values = coefficients.pop()[of]
    for k, coefficient in reversed(list(enumerate(coefficients))):
        values = values * (times - t[of, k])[:, None] + coefficient[of]
    return values
