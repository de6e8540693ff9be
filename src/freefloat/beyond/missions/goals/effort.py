"""How much work a search for a motion may do."""

from __future__ import annotations

from dataclasses import dataclass, field

_MOST = 300_000
"""Instants of a search: fifteen to thirty seconds of processor time."""


@dataclass(eq=False)
class SolverBudget:
    """Work of a search, counted in instants of paths at which they are looked at.

    Where a search ends follows from its seed, not from the speed of the machine.

    Attributes:
        most: Most instants.
        done: Instants so far.
    """

    most: int = _MOST
    done: int = field(default=0, init=False)

    def take(self, instants: int) -> None:
        """Count some instants."""
        self.done += instants

    @property
    def fraction(self) -> float:
        """The fraction of the work that is done, in [0, 1]."""
        return min(1.0, self.done / self.most)

    @property
    def spent(self) -> bool:
        """Whether the search has to end."""
        return self.done >= self.most
