"""What integrates many motions: kernels, or without Numba one motion after the other."""

from __future__ import annotations

import logging
from functools import cache
from typing import TYPE_CHECKING, TypeAlias

from freefloat.ensemble.motions_one_by_one import PreciseIntegrator
from freefloat.errors import MissingNumbaError
from freefloat.motion.pointing import AttitudeLimits
from freefloat.motion.problem import Problem

if TYPE_CHECKING:
    from freefloat.ensemble.ensemble import EnsembleIntegrator

    Integrator: TypeAlias = EnsembleIntegrator | PreciseIntegrator

_logger = logging.getLogger("freefloat")


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
    _logger.warning(
        "motions are integrated one by one, which takes far longer: Numba cannot be imported (%s)",
        reason,
    )
