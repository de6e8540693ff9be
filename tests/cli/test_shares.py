"""Shares of samples in words."""

from __future__ import annotations

import pytest

from freefloat.cli.shares import share_text


@pytest.mark.parametrize(
    ("share", "error", "count", "told"),
    [
        (0.4062, 0.0614, 64, "40.62% ± 6.14%"),
        (0.4, None, 10, "40.00%"),
        (1.0, None, 10, "100.00%"),
        (1.0, 0.0, 64, "100.00% (at least 95.43% with 95% confidence)"),
        (0.0, 0.0, 4096, "0.00% (at most 0.07% with 95% confidence)"),
    ],
)
def test_a_sample_in_which_all_agree_tells_what_it_leaves_open(
    share: float, error: float | None, count: int, told: str
) -> None:
    """0.9543 to the power of 64 is a twentieth: fewer would hardly all agree."""
    assert share_text(share, error, count) == told
    assert abs(0.9543**64 - 0.05) < 5e-4
