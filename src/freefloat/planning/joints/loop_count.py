"""The number of loops: the fewest with which a motion keeps its limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from freefloat.concurrency import Progress
from freefloat.limits.result import LimitResult, violated
from freefloat.planning.joints.loop_motion import LoopMotion, LoopMotions
from freefloat.so3 import Array

MOST_LOOPS = 64
"""Largest number of loops that is tried."""
_STARTS = 6
"""Random loops from which a search begins."""
_MORE = 3
"""Further numbers of loops that are tried where the fewest take too long."""
_WORTH = 0.5
"""Allowed duration, over that of the fewest loops, from which more loops are tried: their duration
grows with the root of their number, unless the fewest have little room."""
_FURTHER = (2, 4, 8)
"""Factors on a number of loops that is not enough, to find one that is."""

_SIMILAR = 0.2
"""Relative difference of coefficients up to which loops are near the same minimum."""
_WIDER = (1.5, 2.0, 3.0, 5.0, 10.0)
"""Factors on the widths of joint ranges that are tried where loops do not fit into them."""


class LoopCountSearch:
    """Search for the fewest loops, each of which turns the spacecraft by the same rotation.

    Attributes:
        violation: The first limit that a motion with the most loops violated; None where loops with
            the rotation were not found, or a motion was.
    """

    def __init__(self, motions: LoopMotions, seed: int, progress: Progress | None = None) -> None:
        self._motions, self._rng = motions, np.random.default_rng(seed)
        self._report = progress or (lambda fraction: None)
        self._known: tuple[int, Array] | None = None
        self.violation: LimitResult | None = None

    def fewest(self, longest: float | None) -> LoopMotion | None:
        """The motion with the fewest loops, or more if that takes too long; None without one.

        The number is doubled until a motion keeps its limits, and then reduced, beginning with the
        loop that was found.

        Args:
            longest: Duration that is allowed [s].
        """
        count = 1
        found = self.exactly(count)
        while found is None and count < MOST_LOOPS:
            count *= 2
            self._report(np.log2(count) / np.log2(2 * MOST_LOOPS))
            found = self.exactly(count)
        if found is None:
            return None
        for fewer in range(count - 1, count // 2, -1):
            other = self.exactly(fewer)
            if other is None:
                break
            found = other
        for more in range(found.loops.count + 1, found.loops.count + 1 + _MORE):
            if longest is None or not _WORTH * found.duration <= longest < found.duration:
                break
            found = min(filter(None, (found, self.exactly(more))), key=lambda m: m.duration)
        return found

    def exactly(self, count: int) -> LoopMotion | None:
        """The shortest motion of some loops that keeps its limits; None where none was found."""
        rotation, search = self._motions.rotation ** (1.0 / count), self._motions.search
        starts = [search.random(self._rng) / np.sqrt(count) for _ in range(_STARTS)]
        if self._known is not None:  # the rotation grows with the square of a small loop
            known, coefficients = self._known
            starts.append(np.sqrt(known / count) * coefficients)
        loops = [c for start in starts if (c := search.unbounded(rotation, start)) is not None]
        best: LoopMotion | None = None
        smallest = np.inf
        for loop in _distinct(sorted(loops, key=search.mean_square)):
            if search.mean_square(loop) >= smallest:  # bounds would increase it
                break
            found = search.shortest(rotation, loop)
            motion = None if found is None else self._motion(found, count)
            if motion is None or found is None:
                continue
            if best is None or motion.duration < best.duration:
                best, smallest = motion, search.mean_square(found)
        return best

    def _motion(self, coefficients: Array, count: int) -> LoopMotion | None:
        """The motion along loops; None where it violates a limit."""
        self._known = count, coefficients
        violation = self._motions.shape_violation(coefficients)
        if violation is None:
            guess = self._motions.guess(self._motions.search.effort(coefficients), count)
            found = self._motions.along(coefficients, count, guess)
            if found is None:
                return None
            violation = next(iter(violated(found.results)), None)
            if violation is None:
                self.violation = None
                return found
        self.violation = violation
        return None

    def needed(self, count: int | None) -> dict[str, float]:
        """What would be enough: more loops than ``count``, or wider joint ranges, by a factor."""
        if count is not None:
            numbers = [factor * count for factor in _FURTHER if factor * count <= MOST_LOOPS]
            enough = next((more for more in numbers if self.exactly(more) is not None), None)
            return {} if enough is None else {"loops": enough}
        if self.violation is not None:
            return {}
        rotation = self._motions.rotation ** (1.0 / MOST_LOOPS)
        for factor in _WIDER:
            search = replace(self._motions.search, widened=factor)
            starts = [search.random(self._rng) / np.sqrt(MOST_LOOPS) for _ in range(_STARTS)]
            loops = [c for start in starts if (c := search.unbounded(rotation, start)) is not None]
            if any(search.shortest(rotation, loop) is not None for loop in _distinct(loops)):
                return {"range_factor": factor}
        return {}


def _distinct(loops: Sequence[Array]) -> list[Array]:
    """Loops without those that are nearly an earlier one."""
    found: list[Array] = []
    for loop in loops:
        if all(np.linalg.norm(loop - other) > _SIMILAR * np.linalg.norm(other) for other in found):
            found.append(loop)
    return found
