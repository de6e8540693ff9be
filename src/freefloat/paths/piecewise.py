"""What consists of pieces in s: where their smoothness ends, and which piece holds."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from dataclasses import dataclass, replace
from typing import Any, Generic, Protocol, TypeVar, cast, runtime_checkable

import numpy as np

from freefloat.brief import brief
from freefloat.so3 import Array, frozen

_ROUNDING = 1e-12
"""Of s: pieces that hold on less are not meant."""

T = TypeVar("T")


@runtime_checkable
class Piecewise(Protocol):
    """What is smooth only between breaks: high derivatives jump there.

    Integrators whose steps end at the breaks keep their order; those that step across lose it.
    """

    breaks: Array
    """Where, rising, inside (0, 1)."""

    def within(self, low: float, high: float) -> Any:
        """The same from low to high, continued by its outermost pieces beyond."""


def breaks_of(law: object) -> Array:
    """Values of s, rising, at which high derivatives of a law jump; of most laws nowhere."""
    return law.breaks if isinstance(law, Piecewise) else frozen([])


def within(law: T, low: float, high: float) -> T:
    """A law from low to high, continued as smoothly as it is there."""
    return cast(T, law.within(low, high)) if isinstance(law, Piecewise) else law


def breaks_that_count(knots: Array, bends: Array, negligible: float) -> Array:
    """Inner knots where a jump of the third derivative shows.

    Args:
        knots: Rising, shape (N + 1,).
        bends: Third derivatives between them, shape (N, c).
        negligible: A jump counts where it moves the law by more than this over the longer of the
            two intervals beside it.
    """
    jumps = np.linalg.norm(np.diff(bends, axis=0), axis=1)
    widths = np.diff(knots)
    moved = jumps * np.maximum(widths[:-1], widths[1:]) ** 3
    return frozen(knots[1:-1][moved > negligible])


@dataclass(frozen=True)
class Pieces(Generic[T]):
    """Pieces between knots, the first and the last continued beyond.

    Attributes:
        knots: Rising; one more than pieces.
        pieces: Smooth functions of s.
        first: Of those in use.
        last: Of those in use.
    """

    __repr__ = brief

    knots: tuple[float, ...]
    pieces: tuple[T, ...]
    first: int
    last: int

    def at(self, s: float) -> T:
        """The piece that holds at s."""
        return self.pieces[min(max(bisect_right(self.knots, s) - 1, self.first), self.last)]

    def within(self, low: float, high: float) -> Pieces[T]:
        """Only those that hold somewhere between, but for rounding."""
        first = max(bisect_right(self.knots, low + _ROUNDING) - 1, self.first)
        last = min(bisect_left(self.knots, high - _ROUNDING) - 1, self.last)
        return replace(self, first=min(first, self.last), last=max(first, last))
