"""Motions from a grid of attitudes over SO(3)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from freefloat.ensemble.ensemble import Progress
from freefloat.ensemble.feasibility import BranchResults, FeasibilityEvaluator
from freefloat.errors import InputError, whole_number
from freefloat.planning.attitude_map import AttitudeMap
from freefloat.so3 import Array, attitude_grid, frozen

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

        blocks.append(_tables(evaluator.evaluate(block, progress=report)))
    tables = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    for values in tables.values():
        values.setflags(write=False)
    return AttitudeMap(
        problem, seed, frozen(attitudes), tables.pop("minimum_margins"),
        tables.pop("determinant_ratios"), tables.pop("endings"), tables,
    )  # fmt: skip


def _tables(results: BranchResults) -> dict[str, npt.NDArray[Any]]:
    """Quantities of motions by attitude and branch; those for the record alone in float32."""
    motions = results.motions

    def single(values: Array) -> npt.NDArray[np.float32]:
        return values.astype(np.float32)

    return {
        "endings": motions.endings,
        "minimum_margins": motions.minimum,
        "determinant_ratios": motions.determinant_ratios,
        "joints": single(results.joints),
        "ended_at": motions.ended_at,
        "least_at": motions.minimum_at,
        "final_attitude": single(motions.attitudes),
        "largest_rates": single(motions.rates),
        "joint_lower": single(motions.lower),
        "joint_upper": single(motions.upper),
    }
