"""Confidence intervals of fractions."""

import pytest
from scipy.stats import binomtest

from freefloat.statistics import confidence_interval, percentage


@pytest.mark.parametrize(("count", "total"), [(0, 200), (200, 200), (3, 10), (1, 1), (40, 4096)])
def test_the_interval_is_wilsons(count: int, total: int) -> None:
    expected = binomtest(count, total).proportion_ci(0.95, method="wilson")
    assert confidence_interval(count, total) == pytest.approx(tuple(expected), abs=1e-15)


def test_a_fraction_that_is_no_estimate_has_no_interval() -> None:
    assert percentage(1, 4, random=False) == "25.00%"
    assert percentage(0, 200) == "0.00% (95% confidence: 0.00% to 1.88%)"
