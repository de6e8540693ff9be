"""Example 2 with a margin that two fifths of the attitudes violate, and a map of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.motion.margin import Margin
from freefloat.motion.problem import Problem
from freefloat.planning import planner, robustness, tolerance
from freefloat.planning import search as attitude_search
from freefloat.planning.attitude_map import AttitudeMap
from freefloat.planning.mapping import sample_attitudes
from tests.motions import bundled


@pytest.fixture(scope="session")
def margin_30() -> Problem:
    problem = bundled("spatial_6dof/line")
    return replace(problem, margin=Margin(problem.margin.measure, 30.0))


@pytest.fixture(scope="session")
def evaluator(margin_30: Problem) -> FeasibilityEvaluator:
    return FeasibilityEvaluator(margin_30, 1)


@pytest.fixture(scope="session")
def samples(evaluator: FeasibilityEvaluator) -> AttitudeMap:
    """512 attitudes."""
    return sample_attitudes(evaluator, 512)


@pytest.fixture(scope="module")
def smaller() -> Iterator[None]:
    """The same searches with fewer attitudes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(planner, "_CANDIDATES", 6)
        patch.setattr(attitude_search, "_FINISHED", 2)
        patch.setattr(robustness, "_WIDE", 128)
        patch.setattr(robustness, "_DIRECTIONS", 4)
        patch.setattr(robustness, "_EDGE", 100)
        patch.setattr(robustness, "_ROUNDS", 8)
        patch.setattr(robustness, "_CONFIRMING", 1024)
        patch.setattr(tolerance, "_DIRECTIONS", 16)
        yield
