"""Count of the finished runs of a study while it runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from freefloat.so3 import IntArray
from freefloat.statistics import confidence_interval
from freefloat.studies.columns import NUMBER, VERDICTS, Column
from freefloat.studies.rows import StudyRows

_MISSING = -1


class Tally:
    """Verdicts of the runs of a study so far, and whether these are enough."""

    def __init__(
        self,
        count: int,
        rows: StudyRows,
        until: float | None,
        progress: Callable[[float], None] | None,
    ) -> None:
        """Count the finished runs.

        Args:
            count: Number of runs.
            rows: The finished ones.
            until: Width of the confidence interval of the feasible fraction that is enough.
            progress: Called with the fraction of finished runs, in [0, 1].
        """
        self._verdicts = np.full(count, _MISSING, dtype=np.int8)
        self._until = until
        self._progress = progress
        self._note(rows.column(NUMBER), rows.column("verdict"))

    @property
    def done(self) -> int:
        """Number of finished runs."""
        return int((self._verdicts != _MISSING).sum())

    @property
    def missing(self) -> IntArray:
        """Numbers of the other runs."""
        return np.flatnonzero(self._verdicts == _MISSING)

    @property
    def is_enough(self) -> bool:
        """Whether the interval, of the runs before the first missing one, is narrow enough."""
        if self._until is None:
            return False
        missing = self.missing
        known = self._verdicts[: missing[0]] if len(missing) else self._verdicts
        feasible, infeasible, _ = np.bincount(known, minlength=len(VERDICTS)).tolist()
        if not feasible + infeasible:
            return False
        low, high = confidence_interval(feasible, feasible + infeasible)
        return high - low <= self._until

    def add(self, numbers: Column, verdicts: Iterable[str]) -> bool:
        """Count finished runs; return whether these are enough."""
        self._note(numbers, verdicts)
        if self._progress is not None:
            self._progress(self.done / len(self._verdicts))
        return self.is_enough

    def _note(self, numbers: Column, verdicts: Iterable[str]) -> None:
        self._verdicts[np.asarray(numbers, dtype=int)] = [VERDICTS.index(v) for v in verdicts]
