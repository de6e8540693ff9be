"""The systems of many motions: momenta, drifts, robots, ends of lines that differ in each."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from freefloat.dynamics.system import System
from freefloat.ensemble.robots import Robots
from freefloat.errors import InputError
from freefloat.motion.problem import Problem
from freefloat.motion.revolutions import mean_inertia, revolutions
from freefloat.so3 import Array, BoolArray, IntArray


@dataclass(frozen=True, eq=False)
class Systems:
    """What differs between the systems of K motions.

    Attributes:
        momenta: Angular momenta [N m s], one for all, shape (3,), or for each, (K, 3).
        wheels: Momenta stored in wheels, spacecraft frame [N m s], likewise.
        drifts: Velocities of the centre of mass [m/s], likewise.
        robots: The robots; None for one of all.
        offsets: From the start and the end of the problem's path, a line, to those of the paths,
            inertial axes [m], shape (K, 2, 3); None for one path of all.
    """

    momenta: Array = field(repr=False)
    wheels: Array = field(repr=False)
    drifts: Array = field(repr=False)
    robots: Robots | None = None
    offsets: Array | None = field(default=None, repr=False)

    @classmethod
    def of(
        cls,
        problem: Problem,
        momenta: Array | None = None,
        wheels: Array | None = None,
        drifts: Array | None = None,
        robots: Robots | None = None,
    ) -> Systems:
        """The systems of a problem with other momenta, drifts or robots."""
        return cls(
            problem.momentum if momenta is None else momenta,
            problem.wheel_momentum if wheels is None else wheels,
            problem.path.drift if drifts is None else drifts,
            robots,
        )

    def __getitem__(self, chosen: BoolArray | IntArray | slice) -> Systems:
        """Those of some motions, where every array is one for each."""
        robots = None if self.robots is None else self.robots[chosen]
        offsets = None if self.offsets is None else self.offsets[chosen]
        return Systems(
            self.momenta[chosen], self.wheels[chosen], self.drifts[chosen], robots, offsets
        )

    def columns(self, count: int) -> Array:
        """Momenta, those in wheels, drifts, and how much farther paths lead, of ``count`` motions.

        Shape (K, 12).

        Raises:
            InputError: If an array has another shape, or a number is not finite.
        """
        parts = []
        for key, values in (("momenta", self.momenta), ("wheels", self.wheels),
                            ("drifts", self.drifts)):  # fmt: skip
            array = np.asarray(values, dtype=float)
            if array.shape not in ((3,), (count, 3)) or not np.isfinite(array).all():
                accepted = f"finite numbers, shape (3,) or ({count}, 3)"
                raise InputError(key, f"shape {array.shape} was given", accepted)
            parts.append(np.broadcast_to(array, (count, 3)))
        ends = np.zeros((count, 3)) if self.offsets is None else np.diff(self.offsets, axis=1)[:, 0]
        parts.append(ends)
        return np.ascontiguousarray(np.hstack(parts))  # other kernels would be compiled for columns

    def revolutions(self, problem: Problem) -> Array:
        """How often the systems rotate along the problem's path, shape (K,)."""
        robots = self.robots
        inertias = mean_inertia(problem.model) if robots is None else robots.mean_inertias
        return revolutions(self.momenta, self.wheels, inertias, problem.path.duration)

    @property
    def start_offsets(self) -> Array | None:
        """From the start of the problem's path to those of the paths [m], shape (K, 3)."""
        return None if self.offsets is None else self.offsets[:, 0]

    def path_of(self, problem: Problem, k: int) -> Problem:
        """A problem with the robot and the path of motion k."""
        if self.robots is not None:
            problem = self.robots.problem(problem, k)
        if self.offsets is None:
            return problem
        return problem.replace(path=problem.path.displaced(*self.offsets[k]))

    def problem_of(self, problem: Problem, k: int) -> Problem:
        """A problem with the system of motion k."""
        problem = self.path_of(problem, k)
        own = (v if v.ndim == 1 else v[k] for v in (self.momenta, self.wheels, self.drifts))
        system = System(problem.model, *own)
        return problem.with_system(system)
