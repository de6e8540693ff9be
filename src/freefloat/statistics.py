"""Fractions of samples and their confidence intervals."""

from __future__ import annotations

_CONFIDENCE = 0.95


def confidence_interval(count: int, total: int) -> tuple[float, float]:
    """Return the 95 % confidence interval of a fraction (Wilson 1927), also where it is 0 or 1.

    Args:
        count: Number of random samples with a property.
        total: Number of all samples, at least one.
    """
    from scipy.stats import binomtest  # imports slowly

    interval = binomtest(count, total).proportion_ci(_CONFIDENCE, method="wilson")
    return float(interval.low), float(interval.high)


def percentage(count: int, total: int, random: bool = True) -> str:
    """Format a fraction, that of random samples with its confidence interval."""
    if not random:
        return f"{count / total:.2%}"
    low, high = confidence_interval(count, total)
    return f"{count / total:.2%} ({_CONFIDENCE:.0%} confidence: {low:.2%} to {high:.2%})"
