"""Fractions of samples and their confidence intervals."""

from __future__ import annotations

import math

_CONFIDENCE = 0.95
QUANTILE = 1.959963984540054
"""Quantile of the standard normal distribution, for 95 % confidence, two-sided."""


def confidence_interval(count: int, total: int) -> tuple[float, float]:
    """The 95 % confidence interval of a fraction (Wilson 1927), also where it is 0 or 1.

    SciPy's ``binomtest`` gives the same interval, but its import takes half a second.

    Args:
        count: Number of random samples with a property.
        total: Number of all samples, at least one.
    """
    z2 = QUANTILE**2
    centre = (count + z2 / 2.0) / (total + z2)
    half = math.sqrt(z2 * (count * (total - count) / total + z2 / 4.0)) / (total + z2)
    low = 0.0 if count == 0 else centre - half
    return low, 1.0 if count == total else centre + half


def percentage(count: int, total: int, random: bool = True) -> str:
    """Format a fraction; of random samples, with its confidence interval."""
    if not random:
        return _percent(count / total)
    low, high = confidence_interval(count, total)
    interval = f"{_CONFIDENCE:.0%} confidence: {_percent(low)} to {_percent(high)}"
    return f"{_percent(count / total)} ({interval})"


def _percent(fraction: float) -> str:
    """A fraction with two decimals, or as many as tell it from none and all."""
    texts = [f"{fraction:.{places}%}" for places in range(2, 8)]
    telling = (text for text in texts if float(text[:-1]) not in (0.0, 100.0))
    return texts[0] if fraction in (0.0, 1.0) else next(telling, texts[-1])
