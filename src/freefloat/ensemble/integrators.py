"""Precise motions and integrators of many: by kernels where these can, or the reference engine.

Between the ends of the kernels' steps a precise motion is a polynomial of fifth order, through
three ends of steps and their rates; a panel, see :mod:`freefloat.motion.panels`, spans as many
steps as its polynomials can follow. Without Numba one motion is integrated after the other.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import cache, partial
from itertools import pairwise
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from freefloat.concurrency import Progress, step_of
from freefloat.dynamics.generalized_jacobian import generalized_jacobian
from freefloat.ensemble.endings import COMPLETED, FAILED, LIMITED, MARGIN, MAX_STEPS, SINGULAR
from freefloat.ensemble.result import EnsembleResult
from freefloat.ensemble.systems import Systems
from freefloat.errors import IntegrationError, MissingNumbaError
from freefloat.motion.extrema import at_nodes, closest_approach, minimum
from freefloat.motion.integration import integrate_motion
from freefloat.motion.law import PathLaw
from freefloat.motion.margin import ROUNDING
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.panels import NODES, TO_COEFFICIENTS
from freefloat.motion.pointing import AttitudeLimits, Keep, PointingLimit
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, IntArray

if TYPE_CHECKING:
    from freefloat.ensemble.ensemble import EnsembleIntegrator

_TOLERANCE = 1e-10
"""Tolerance of motions; a tenth of it is the tolerance of the steps."""
_PANEL_STEPS, _ERROR = 8, 1e-9
"""Most steps of a panel; largest last coefficients and differences through other steps [rad, m]."""
Slack: TypeAlias = Callable[[Array, Array, Array], Array]
"""Slacks of a limit at times (K,) with attitudes (K, 4) and joints (K, n)."""
Integrator: TypeAlias = "EnsembleIntegrator | PreciseIntegrator"


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


class PreciseIntegrator:
    """Integrator in place of an ``EnsembleIntegrator``, with results of the same meaning.

    Motions that use their margin up are integrated to their end.
    """

    threads = 1

    def __init__(
        self, problem: Problem, *, tolerance: float, limits: AttitudeLimits | None = None
    ) -> None:
        """Prepare a problem; arguments as of ``EnsembleIntegrator``."""
        self.problem, self.tolerance = problem, tolerance
        self._limits = limits or AttitudeLimits()

    def integrate(
        self,
        attitudes: Array,
        joints: Array,
        systems: Systems | None = None,
        *,
        starts: Array | None = None,
        ends: Array | None = None,
        stop_below: float = 0.0,
        stricter: bool = False,
        extremes: bool = False,
        progress: Progress | None = None,
    ) -> EnsembleResult:
        """See ``EnsembleIntegrator.integrate``."""
        K, n = len(joints), self.problem.dof
        starts = np.zeros(K) if starts is None else starts
        ends = np.full(K, self.problem.path.duration) if ends is None else ends
        result = EnsembleResult.empty((K,), n, self._limits.number)
        report = step_of(progress, 0.0, 1.0)
        for k, (start, end) in enumerate(zip(starts.tolist(), ends.tolist(), strict=True)):
            problem = self.problem if systems is None else systems.problem_of(self.problem, k)
            try:
                state, exact = (attitudes[k], joints[k]), self.tolerance
                motion = integrate_motion(problem, *state, start=start, end=end, tolerance=exact)
            except IntegrationError as error:
                result.endings[k], result.ended_at[k] = FAILED, error.time
            else:
                self._note(motion, k, stop_below, result)
            report((k + 1) / K)
        for array in result:
            array.setflags(write=False)
        return result

    def _note(self, motion: Motion, k: int, stop_below: float, result: EnsembleResult) -> None:
        """Write the results of motion k."""
        n, final = self.problem.dof, motion.final
        joints = motion.joints[:, :n]
        result.attitudes[k], result.joints[k] = final.attitude, final.joints[:n]
        result.lower[k], result.upper[k] = joints.min(axis=0), joints.max(axis=0)
        result.rates[k] = result.base_rate[k] = 0.0
        if motion.panels:
            rates = np.nan_to_num(motion.node_rates, nan=np.inf)
            result.rates[k] = np.abs(rates[..., 3 : 3 + n]).max(axis=(0, 1))
            with np.errstate(over="ignore"):  # just before a singularity the square is infinite
                result.base_rate[k] = np.linalg.norm(rates[..., :3], axis=-1).max()
        result.evaluations[k] = len(motion.times)
        result.slacks[k] = [_least(motion, slack) for slack in self._slacks(motion)]
        result.ended_at[k] = result.minimum_at[k] = final.time
        if not motion.completed:
            result.endings[k] = SINGULAR
            return
        approach = closest_approach(motion, motion.setting.margin.measure)
        result.minimum[k], result.minimum_at[k] = approach.value, approach.time
        result.determinant_ratios[k] = _determinant_ratio(motion)
        if approach.value < stop_below * (1.0 - ROUNDING):
            result.endings[k] = MARGIN
        else:
            result.endings[k] = LIMITED if (result.slacks[k] < 0.0).any() else COMPLETED

    def _slacks(self, motion: Motion) -> list[Slack]:
        """What the limits of attitude leave along a motion, see :attr:`EnsembleResult.slacks`."""
        first, least = motion.initial.attitude, self._limits.turn_cosine
        slacks = [partial(_pointing_slack, motion, limit) for limit in self._limits.pointing]
        if self._limits.base_turn is None:
            return [*slacks]
        return [*slacks, lambda t, attitudes, joints: abs(attitudes @ first) - least]


def _pointing_slack(
    motion: Motion, limit: PointingLimit, t: Array, attitudes: Array, joints: Array
) -> Array:
    problem = motion.problem
    axis, target = limit.vectors(problem.model, attitudes, joints, problem.path.origin(t))
    slack = (axis * target).sum(axis=1) - np.cos(limit.angle)
    return np.asarray(slack if limit.keep is Keep.INSIDE else -slack)


def _least(motion: Motion, slack: Slack) -> float:
    def along(panel: IntArray, x: Array) -> Array:
        return slack(*motion.at(panel, x))[:, None]

    return minimum(at_nodes(motion, along), along).value if motion.panels else np.inf


def _determinant_ratio(motion: Motion) -> float:
    """Smallest over largest magnitude of det S* at the nodes; of its volume with more joints."""
    model, task = motion.problem.model_at(), motion.setting.task
    S = generalized_jacobian(model, motion.joints[:, : model.dof], task)
    volumes = np.linalg.svd(S, compute_uv=False).prod(axis=1)
    return float(volumes.min() / volumes.max())


def integrator_for(
    problem: Problem,
    threads: int | None = None,
    *,
    tolerance: float,
    limits: AttitudeLimits | None = None,
) -> Integrator:
    """The integrator of many motions of a problem; arguments as of ``EnsembleIntegrator``.

    Raises:
        MissingNumbaError: If there are no kernels, for a task that is not planar.
    """
    try:
        from freefloat.ensemble.ensemble import EnsembleIntegrator  # compiled kernels import slowly
    except MissingNumbaError as error:
        if not problem.task.planar:
            raise
        _warn(str(error.__cause__))
        return PreciseIntegrator(problem, tolerance=tolerance, limits=limits)
    return EnsembleIntegrator(problem, threads, tolerance=tolerance, limits=limits)


@cache
def _warn(reason: str) -> None:
    logging.getLogger("freefloat").warning(
        "motions are integrated one by one, which takes far longer: Numba cannot be imported (%s)",
        reason,
    )
