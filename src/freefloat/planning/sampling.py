"""Motions from a grid of attitudes over SO(3)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from freefloat.ensemble.ensemble import Progress
from freefloat.ensemble.feasibility import BranchOutcomes, FeasibilityEvaluator
from freefloat.errors import InputError
from freefloat.planning.attitude_map import AttitudeMap
from freefloat.so3 import Array, attitude_grid, frozen, whole_number

_BLOCK = 2048
"""Attitudes that are integrated together."""
_FEWEST = 8


def sample_attitudes(
    evaluator: FeasibilityEvaluator,
    samples: int,
    seed: int = 0,
    progress: Progress | None = None,
) -> AttitudeMap:
    """Integrate the motions of every arm branch from attitudes spread over all of SO(3).

    Args:
        evaluator: Of a spatial problem.
        samples: Number of attitudes, 8 or more.
        seed: Rotates the grid of attitudes.
        progress: Called with the fraction done, in [0, 1].

    Raises:
        InputError: If the task is planar, or the samples or the seed are no such numbers.
    """
    problem = evaluator.problem
    if problem.task.planar:
        raise InputError("task", f"{problem.task} was given", "pose or position")
    samples = whole_number("samples", samples, _FEWEST)
    seed = whole_number("seed", seed, 0)
    attitudes = attitude_grid(samples, seed)
    blocks = []
    for first in range(0, samples, _BLOCK):
        block = attitudes[first : first + _BLOCK]

        def report(done: float, first: int = first, count: int = len(block)) -> None:
            if progress is not None:
                progress((first + done * count) / samples)

        blocks.append(_tables(evaluator.prospects(block, progress=report)))
    tables = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    for values in tables.values():
        values.setflags(write=False)
    return AttitudeMap(
        problem, seed, frozen(attitudes), tables.pop("minimum_margins"),
        tables.pop("determinant_ratios"), tables.pop("endings"), tables,
    )  # fmt: skip


def _tables(outcomes: BranchOutcomes) -> dict[str, npt.NDArray[Any]]:
    """Quantities of motions by attitude and branch; those for the record alone in float32."""
    ensemble, spread = outcomes.rollout, outcomes.spread

    def single(values: Array) -> npt.NDArray[np.float32]:
        return values.astype(np.float32)

    return {
        "endings": outcomes.endings,
        "minimum_margins": outcomes.least,
        "determinant_ratios": outcomes.determinant_ratios,
        "joints": single(outcomes.joints),
        "ended_at": spread(ensemble.ended_at),
        "least_at": spread(ensemble.least_at),
        "final_attitude": single(spread(ensemble.attitudes)),
        "largest_rates": single(spread(ensemble.rates)),
        "joint_lower": single(spread(ensemble.lower)),
        "joint_upper": single(spread(ensemble.upper)),
    }
