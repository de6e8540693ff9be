"""Fractions of samples as text."""

from freefloat.statistics import percentage


def test_a_fraction_of_random_samples_has_wilsons_interval() -> None:
    assert percentage(0, 200) == "0.00% (95% confidence: 0.00% to 1.88%)"
    assert percentage(1, 4, random=False) == "25.00%"
