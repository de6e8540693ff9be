"""Example 2 with a margin that two fifths of the attitudes violate, and a map of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

import freefloat as ff
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.mapping import sample_attitudes
from tests.motions import bundled
from tests.plans import smaller_searches


@pytest.fixture(scope="session")
def margin_30() -> ff.Problem:
    problem = bundled("spatial_6dof/line")
    return replace(problem, margin=ff.Margin(problem.margin.measure, 30.0))


@pytest.fixture(scope="session")
def evaluator(margin_30: ff.Problem) -> FeasibilityEvaluator:
    return FeasibilityEvaluator(margin_30, 1)


@pytest.fixture(scope="session")
def samples(evaluator: FeasibilityEvaluator) -> AttitudeMap:
    """512 attitudes."""
    return sample_attitudes(evaluator, 512)


@pytest.fixture(scope="module")
def smaller() -> Iterator[None]:
    """The same searches with fewer attitudes."""
    with smaller_searches():
        yield
