"""Shares that a sample tells of, with what it leaves open, for people."""

from __future__ import annotations

_DOUBT = 0.05
"""Probability of a sample in which all agree, where as many as is told do not."""


def share_text(share: float, error: float | None, count: int) -> str:
    """``12.34% ± 0.20%``; where all of a sample agree, what may nevertheless be so.

    Args:
        share: In [0, 1].
        error: Its standard error; None where nothing was drawn at random.
        count: Size of the sample.
    """
    if error is None or count < 1:
        return f"{share:.2%}"
    others = 1.0 - _DOUBT ** (1.0 / count)  # nearly 3 / count
    sure = f"with {1.0 - _DOUBT:.0%} confidence"
    if share >= 1.0:
        return f"{share:.2%} (at least {1.0 - others:.2%} {sure})"
    if share <= 0.0:
        return f"{share:.2%} (at most {others:.2%} {sure})"
    return f"{share:.2%} ± {error:.2%}"
