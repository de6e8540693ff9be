"""Numbers as they are shown: guaranteed ones rounded inwards, different ones told apart."""

from __future__ import annotations

from decimal import ROUND_CEILING, ROUND_FLOOR, Context


def rounded_up(value: float, digits: int = 4) -> float:
    """The next larger number of some digits."""
    return _rounded(value, digits, ROUND_CEILING)


def rounded_down(value: float, digits: int = 4) -> float:
    """The next smaller number of some digits, as which guaranteed values are shown."""
    return _rounded(value, digits, ROUND_FLOOR)


def _rounded(value: float, digits: int, rounding: str) -> float:
    """A number of some digits; what differs from one by less than ten digits show is that one."""
    return float(Context(digits, rounding).create_decimal(f"{value:.10g}"))


def digits_apart(value: float, bound: float, digits: int) -> int:
    """Digits, at least some, with which two numbers that differ do not look the same."""
    numbers = range(digits, 17)
    return next((n for n in numbers if f"{value:.{n}g}" != f"{bound:.{n}g}"), digits)
