"""The systems of many motions: momenta, drifts, robots, ends of lines that differ in each.

Disturbed motions, whose durations or masses are others, too, are motions of such systems.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.system import System
from freefloat.ensemble.robots import Robots
from freefloat.errors import LARGEST_NUMBER, InputError, number_array
from freefloat.motion.problem import Problem
from freefloat.motion.problem_inputs import (
    MAX_REVOLUTIONS,
    mean_inertia,
    require_planar_vectors,
    revolutions,
)
from freefloat.so3 import Array, BoolArray, IntArray

FACTORS = "numbers from 1e-6 to 1e6", 1e-6, 1e6
_DURATIONS = "numbers from 1e-6 to 1e12", 1e-6, 1e12
"""What is accepted of factors and of durations [s], and their bounds."""


@dataclass(frozen=True, eq=False)
class Systems:
    """What differs between the systems of K motions.

    Attributes:
        momenta: Angular momenta [N m s], one for all, shape (3,), or for each, (K, 3).
        wheels: Momenta stored in wheels, spacecraft frame [N m s], likewise.
        drifts: Velocities of the centre of mass [m/s], likewise.
        robots: The robots; None for one of all.
        offsets: From the start and the end of the problem's path, a line, to the paths' starts and
            ends, inertial axes [m], shape (K, 2, 3); None for one path of all.
    """

    momenta: Array = field(repr=False)
    wheels: Array = field(repr=False)
    drifts: Array = field(repr=False)
    robots: Robots | None = None
    offsets: Array | None = field(default=None, repr=False)

    @classmethod
    def of(cls, problem: Problem, momenta: Array | None = None) -> Systems:
        """The systems of a problem, perhaps with other momenta."""
        momenta = problem.momentum if momenta is None else momenta
        return cls(momenta, problem.wheel_momentum, problem.path.drift)

    def __getitem__(self, chosen: BoolArray | IntArray | slice) -> Systems:
        """The systems of some motions, where every array is one for each."""
        robots = None if self.robots is None else self.robots[chosen]
        offsets = None if self.offsets is None else self.offsets[chosen]
        return Systems(
            self.momenta[chosen], self.wheels[chosen], self.drifts[chosen], robots, offsets
        )

    def columns(self, count: int) -> Array:
        """Momenta, wheel momenta, drifts, and how much farther paths lead, of ``count`` motions.

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
        """From the start of the problem's path to the starts of the paths [m], shape (K, 3)."""
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
        vectors = (v if v.ndim == 1 else v[k] for v in (self.momenta, self.wheels, self.drifts))
        system = System(problem.model, *vectors)
        return problem.with_system(system)


@dataclass(frozen=True, eq=False)
class ScaledMotions:
    """Motions of a problem that stand for disturbed ones.

    Attributes:
        problem: The nominal problem.
        systems: Momenta, drifts and robots of the motions, one for each.
        stretches: Times of the disturbed motions over times of these motions, shape (K,).
        factors: Factors on all masses and inertias, which the systems do not have, shape (K,).
        scales: Factors on the ratios of the quantities of limits, see
            :attr:`.KnownLimits.places`, shape (K, Q).
    """

    problem: Problem
    systems: Systems = field(repr=False)
    stretches: Array = field(repr=False)
    factors: Array = field(repr=False)
    scales: Array = field(repr=False)

    def __len__(self) -> int:
        return len(self.stretches)

    def __getitem__(self, chosen: BoolArray | IntArray | slice) -> ScaledMotions:
        """Some of the motions."""
        numbers = self.stretches[chosen], self.factors[chosen], self.scales[chosen]
        return ScaledMotions(self.problem, self.systems[chosen], *numbers)

    @property
    def magnifications(self) -> Array:
        """The measure along the disturbed motions over the measure along their stand-ins, (K,)."""
        return np.asarray(self.factors**self.problem.margin.measure.mass_power)

    def problem_of(self, k: int) -> Problem:
        """The problem of motion k."""
        return self.systems.problem_of(self.problem, k)

    @property
    def turns_too_often(self) -> BoolArray:
        """Which systems would rotate more often than problems may, shape (K,)."""
        return self.systems.revolutions(self.problem) > MAX_REVOLUTIONS


def equivalents(
    problem: Problem,
    count: int,
    *,
    momenta: npt.ArrayLike | None = None,
    wheels: npt.ArrayLike | None = None,
    drifts: npt.ArrayLike | None = None,
    durations: npt.ArrayLike | None = None,
    scale_mass: npt.ArrayLike = 1.0,
    robots: Robots | None = None,
    scales: Array | None = None,
    offsets: Array | None = None,
) -> ScaledMotions:
    """The motions of a problem that stand for disturbed ones.

    A motion with duration T, momentum h and all masses and inertias multiplied by s is the nominal
    one (duration T0) with momentum h T / (T0 s), run through T / T0 times as slowly: equation (4)
    is linear in momentum and rates, and S* does not change. Momentum in wheels scales likewise, the
    velocity of the centre of mass with T / T0 alone.

    Args:
        problem: The nominal problem.
        count: Number K of motions; an argument is one value for all, or one for each.
        momenta: Angular momenta [N m s], shape (3,) or (K, 3); the problem's when left out.
        wheels: Momenta stored in wheels [N m s], likewise.
        drifts: Velocities of the centre of mass [m/s], likewise.
        durations: Durations of the path [s], shape () or (K,).
        scale_mass: Factors on all masses and inertias, shape () or (K,).
        robots: K robots, without these factors; the problem's when left out.
        scales: Factors on the ratios of limits, shape (K, Q); 1 when left out.
        offsets: Offsets of the ends of a line, see :class:`.Systems`; none when left out.

    Raises:
        InputError: If a value is not accepted, or a duration is given for a path in the frame of a
            body, which moves in its own time.
    """
    nominal = problem.path.duration
    stretches = np.ones(count)
    if durations is not None:
        stretches = broadcast("durations", durations, (count,), *_DURATIONS) / nominal
        if problem.path.frame is not None and (stretches != 1.0).any():
            moving = "the path is stated in the frame of a body of the scene"
            raise InputError("durations", moving, "none, or another path")
    factors = broadcast("scale_mass", scale_mass, (count,), *FACTORS)
    vectors = {"momenta": momenta, "wheels": wheels, "drifts": drifts}
    nominals = problem.momentum, problem.wheel_momentum, problem.path.drift
    h, w, v = (
        np.broadcast_to(value, (count, 3)) if given is None else broadcast(key, given, (count, 3))
        for (key, given), value in zip(vectors.items(), nominals, strict=True)
    )
    if problem.has_headings:
        for key, values in (("momenta", h), ("wheels", w), ("drifts", v)):
            require_planar_vectors(key, problem.plane, values, along=key != "drifts")
    ratio = (stretches / factors)[:, None]
    systems = Systems(h * ratio, w * ratio, v * stretches[:, None], robots, offsets)
    scales = np.ones((count, 1)) if scales is None else scales
    return ScaledMotions(problem, systems, stretches, factors, scales)


def broadcast(
    key: str,
    values: npt.ArrayLike,
    shape: tuple[int, ...],
    accepted: str = f"numbers up to {LARGEST_NUMBER:g}",
    lowest: float = -LARGEST_NUMBER,
    highest: float = LARGEST_NUMBER,
) -> Array:
    """Values for all motions, or for each, as an array of a shape; else an InputError."""
    array = number_array(key, values, accepted)
    if array.shape not in (shape, shape[1:]):
        accepted = f"one value for all motions, shape {shape[1:]}, or one for each, shape {shape}"
        raise InputError(key, f"shape {array.shape} was given", accepted)
    array = np.broadcast_to(array, shape)
    wrong = ~(np.isfinite(array) & (array >= lowest) & (array <= highest))
    if wrong.any():
        raise InputError(key, f"{array[wrong].flat[0]} was given", accepted)
    return array
