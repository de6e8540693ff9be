"""Example 2 with a margin that two fifths of the attitudes violate; smaller searches."""

from collections.abc import Iterator
from dataclasses import replace

import pytest

import freefloat as ff
from tests.motions import bundled
from tests.plans import smaller_searches


@pytest.fixture(scope="session")
def margin_30() -> ff.Problem:
    problem = bundled("spatial_6dof/line")
    return replace(problem, margin=ff.Margin(problem.margin.measure, 30.0))


@pytest.fixture(scope="module")
def smaller() -> Iterator[None]:
    """The same searches with fewer attitudes."""
    with smaller_searches():
        yield
