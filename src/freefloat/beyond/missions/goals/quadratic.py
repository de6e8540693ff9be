"""A relaxed problem at a path, linearized, the step to its least value, and a budget of steps."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from freefloat.beyond.missions.goals.attitude_kernel import JointCourse
from freefloat.so3 import Array

_MOST = 300_000
"""Instants of a search: fifteen to thirty seconds of processor time."""
WEIGHT_OF_END = 10.0
"""Least weight of the residuals of the end in what steps decrease [1/rad, 1/m]."""
_ACTIVE_SETS = 10
"""Most sets of violations for which a step is computed."""
_HALVINGS = 12
"""Bisections of the way to the least value of one of them."""
_RANK = 1e-10
"""Singular value, over the largest one, from which the end can be changed in a direction."""


@dataclass(eq=False)
class SolverBudget:
    """Work of a search, counted in instants of paths at which they are looked at.

    Where a search ends follows from its seed, not from the speed of the machine.
    """

    done: int = field(default=0, init=False)

    def take(self, instants: int) -> None:
        """Count some instants."""
        self.done += instants

    @property
    def fraction(self) -> float:
        """The fraction of the work that is done, in [0, 1]."""
        return min(1.0, self.done / _MOST)

    @property
    def spent(self) -> bool:
        """Whether the search has to end."""
        return self.done >= _MOST


class Step(NamedTuple):
    """A step of the unknowns."""

    change: Array  # (unknowns,)
    gain: float  # decrease of the value that it promises
    multiplier: float  # largest multiplier of the end's residuals
    back: Array  # changes by which residuals of the end decrease by one, (unknowns, size)


@dataclass(frozen=True, eq=False)
class Quadratic:
    """The problem at a path, linearized."""

    course: JointCourse
    smooth: float  # what is minimized, without penalties of violations
    gradient: Array  # of ``smooth``, (unknowns,)
    matrix: Array  # second derivatives of ``smooth``, (unknowns, unknowns)
    hinges: Array  # how far limits are violated, negative where they are kept, weighted, (M,)
    slopes: Array  # derivatives of the hinges, (M, unknowns)
    error: Array  # residuals of the end, (size,)
    jacobian: Array  # derivatives of the residuals, (size, unknowns)

    @cached_property
    def penalty(self) -> float:
        """Half the sum of squared violations."""
        return _penalty(self.hinges)

    @property
    def value(self) -> float:
        """What is minimized, with penalties."""
        return self.smooth + self.penalty

    @property
    def promise(self) -> float:
        """The duration, increased by what is violated [s]."""
        error = float(np.abs(self.error).sum())
        return self.course.duration * (1.0 + self.penalty + WEIGHT_OF_END * error)

    def merit(self, weight: float) -> float:
        """What steps decrease, with a weight of the end's residuals [1/rad, 1/m]."""
        return self.value + weight * float(np.abs(self.error).sum())

    def step(self, damping: float, scale: Array) -> Step:
        """The step to the least value subject to the linearized end.

        Which limits are violated after the step is found with it, by Newton's method.
        """
        M, hinges = self.matrix + np.diag(damping * scale), self.hinges
        change = np.zeros_like(self.gradient)
        for number in range(_ACTIVE_SETS):
            active = hinges > 0.0
            rows = self.slopes[active]
            H = M + rows.T @ rows
            gradient = self.gradient + rows.T @ self.hinges[active]
            back, inverse, free = self._back(H, -gradient)
            residuals = self.error + self.jacobian @ free
            least = free - back @ residuals
            change = self._between(M, change, least) if number else least
            hinges = self.hinges + self.slopes @ change
            if np.array_equal(hinges > 0.0, active):
                break
        promised = change @ (self.gradient + self.matrix @ change / 2.0) + _penalty(hinges)
        largest = float(np.abs(inverse @ residuals).max(initial=0.0))
        return Step(change, self.penalty - float(promised), largest, back)

    def _between(self, M: Array, start: Array, end: Array) -> Array:
        """The change with the least value on the way from one to another."""
        way = end - start
        hinges, slopes = self.hinges + self.slopes @ start, self.slopes @ way
        slope, curvature = way @ (self.gradient + M @ start), way @ M @ way

        def rising(part: float) -> bool:
            violations = np.maximum(hinges + part * slopes, 0.0)
            return bool(slope + part * curvature + violations @ slopes > 0.0)

        low, high = 0.0, 1.0
        if not rising(high):
            return end
        for _ in range(_HALVINGS):
            middle = (low + high) / 2.0
            low, high = (low, middle) if rising(middle) else (middle, high)
        return np.asarray(start + low * way)

    def back(self, damping: float) -> Array:
        """Changes of the unknowns that violate little, by which residuals decrease by one."""
        rows = self.slopes[self.hinges > 0.0]
        H = self.matrix + rows.T @ rows + damping * np.eye(len(self.gradient))
        return self._back(H, self.gradient)[0]

    def _back(self, H: Array, forces: Array) -> tuple[Array, Array, Array]:
        """The changes that are smallest by a matrix, their multipliers, and what forces change."""
        solved, free = np.split(np.linalg.solve(H, np.vstack([self.jacobian, forces]).T), [-1], 1)
        values, vectors = np.linalg.eigh(self.jacobian @ solved)
        kept = values > _RANK * values.max(initial=0.0)
        inverse = (vectors[:, kept] / values[kept]) @ vectors[:, kept].T
        return solved @ inverse, inverse, free[:, 0]


def _penalty(hinges: Array) -> float:
    violations = np.maximum(hinges, 0.0)
    return float(violations @ violations) / 2.0
