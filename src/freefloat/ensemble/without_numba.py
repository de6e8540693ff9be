"""What integrates many motions: kernels, or without Numba one motion after the other."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import cache, partial
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from freefloat.concurrency import Progress, step_of
from freefloat.dynamics.generalized_jacobian import generalized_jacobian
from freefloat.ensemble.endings import COMPLETED, FAILED, LIMITED, MARGIN, SINGULAR
from freefloat.ensemble.result import EnsembleResult
from freefloat.ensemble.systems import Systems
from freefloat.errors import IntegrationError, MissingNumbaError
from freefloat.motion.extrema import at_nodes, closest_approach, minimum
from freefloat.motion.integration import integrate_motion
from freefloat.motion.margin import ROUNDING
from freefloat.motion.motion import Motion
from freefloat.motion.pointing import AttitudeLimits, Keep, PointingLimit
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, IntArray

if TYPE_CHECKING:
    from freefloat.ensemble.ensemble import EnsembleIntegrator

Slack: TypeAlias = Callable[[Array, Array, Array], Array]
"""Slacks of a limit at times (K,) with attitudes (K, 4) and joints (K, n)."""
Integrator: TypeAlias = "EnsembleIntegrator | PreciseIntegrator"


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
