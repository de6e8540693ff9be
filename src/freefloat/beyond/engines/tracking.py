"""Closed-loop tracking: a controller that knows the nominal robot follows a plan in MuJoCo.

Once per period the controller measures attitude, joints and the pose of the end-effector, and
solves (4) of the nominal robot for joint rates: resolved-rate control with the generalized Jacobian
(Umetani and Yoshida 1989), with the twist of the path plus a gain times the error of the pose.
Joint servos follow these rates on a simulated robot with other masses, other inertias and dry
friction.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from math import ceil
from numbers import Real
from typing import Any

import numpy as np
import numpy.typing as npt

from freefloat.beyond.engines.closed_loops import Loops, follow
from freefloat.beyond.engines.rate_commands import MeasureValues
from freefloat.concurrency import available_cores, run_chunks
from freefloat.dynamics.measures import singularity_measure
from freefloat.errors import (
    InputError,
    finite_number,
    require_extra,
    require_type,
    seed_number,
    whole_number,
)
from freefloat.motion.margin import keeps_threshold
from freefloat.motion.motion import Motion
from freefloat.planning.plan import Plan
from freefloat.planning.simulation import Simulation
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, frozen

_LARGEST_STEP = 0.5
"""Largest product of gain and period; the loop becomes unstable at 2."""
_MAX_PERIODS = 1_000_000
"""Largest number of periods."""
_TOGETHER, _PERIODS_TOGETHER = 256, 2_000_000
"""Largest number of runs, and of their periods, that are simulated together."""


@dataclass(frozen=True, eq=False)
class Tracking:
    """A plan followed by a controller, on a simulated robot that deviates from its model.

    Attributes:
        model: The simulated robot.
        threshold: Required margin.
        tolerance: Allowed distance from the path [m] and angle from its orientation [rad].
        times: Instants of control, and the end [s], shape (K,).
        attitudes: Attitudes of the spacecraft, unit quaternions x, y, z, w, shape (K, 4).
        joints: Joint values [rad or m], shape (K, n).
        margins: Singularity measure of the simulated robot, positive while it has the sign of the
            start, shape (K,).
        position_errors: Distances of the end-effector from the path [m], shape (K,).
        orientation_errors: Angles from the path's orientation [rad], shape (K,); zero where the
            task leaves it free.
    """

    model: FreeFloatingModel = field(repr=False)
    threshold: float
    tolerance: float
    times: Array = field(repr=False)
    attitudes: Array = field(repr=False)
    joints: Array = field(repr=False)
    margins: Array = field(repr=False)
    position_errors: Array = field(repr=False)
    orientation_errors: Array = field(repr=False)

    def __post_init__(self) -> None:
        for entry in fields(self)[3:]:
            object.__setattr__(self, entry.name, frozen(getattr(self, entry.name)))

    @property
    def minimum_margin(self) -> float:
        """The smallest magnitude of the measure; zero where it changes sign."""
        return max(0.0, float(self.margins.min()))

    @property
    def margin_time(self) -> float:
        """Time of the smallest margin [s]."""
        return float(self.times[self.margins.argmin()])

    @property
    def peak_position_error(self) -> float:
        """Largest distance of the end-effector from the path [m]."""
        return float(self.position_errors.max())

    @property
    def final_position_error(self) -> float:
        """The distance at the end [m]."""
        return float(self.position_errors[-1])

    @property
    def peak_orientation_error(self) -> float:
        """Largest angle from the path's orientation [rad]."""
        return float(self.orientation_errors.max())

    @property
    def margin_kept(self) -> bool:
        """Whether the simulated robot keeps the margin."""
        return bool(keeps_threshold(self.minimum_margin, self.threshold))

    @property
    def on_path(self) -> bool:
        """Whether the end-effector stays within the tolerance."""
        return max(self.peak_position_error, self.peak_orientation_error) <= self.tolerance

    @property
    def survived(self) -> bool:
        """Whether the margin is kept and the path followed."""
        return self.margin_kept and self.on_path

    def to_dict(self) -> dict[str, Any]:
        """The outcome as a JSON document."""
        return {
            "survived": self.survived, "margin": self.minimum_margin,
            "margin_time": self.margin_time, "margin_required": self.threshold,
            "peak_position_error": self.peak_position_error,
            "final_position_error": self.final_position_error,
            "peak_orientation_error": self.peak_orientation_error, "tolerance": self.tolerance,
        }  # fmt: skip


def track(
    result: Plan | Simulation,
    *,
    mass_error: float = 0.0,
    noise: float = 0.0,
    friction: float = 0.0,
    seed: int = 0,
    gain: float = 1.0,
    period: float = 0.1,
    tolerance: float = 0.02,
) -> Tracking:
    """Follow the motion of a plan or a simulation with feedback, in MuJoCo.

    The simulated robot starts at the planned attitude, joints and joint rates with the planned
    momentum, and with the end-effector on the path.

    Args:
        result: Plan or simulation, whose chosen motion completes.
        mass_error: Standard deviation of the logarithm of the factor by which mass and inertia of
            every body are multiplied; 0.05 is about 5 %.
        noise: Standard deviation of measured angles [rad], and of positions [m].
        friction: Dry friction in every joint [N m or N].
        seed: Seed of the random numbers.
        gain: Gain of the error of the pose [1/s].
        period: Period of the controller [s].
        tolerance: Allowed distance from the path [m] and angle from its orientation [rad].

    Raises:
        InputError: If the motion does not complete, a number is not accepted, or MuJoCo is not
            installed.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> tracking = ff.track(ff.simulate(problem, heading=0.0), mass_error=0.02, noise=1e-4)
        >>> tracking.survived
        True
    """
    given = {"mass_error": mass_error, "noise": noise, "friction": friction, "seed": seed,
             "gain": gain, "tolerance": tolerance}  # fmt: skip
    for key, value in given.items():
        require_type(key, value, Real, "a number")
    return track_many(result, **given, period=period, threads=1)[0]


def track_many(
    result: Plan | Simulation,
    *,
    mass_error: npt.ArrayLike = 0.0,
    noise: npt.ArrayLike = 0.0,
    friction: npt.ArrayLike = 0.0,
    seed: npt.ArrayLike = 0,
    gain: npt.ArrayLike = 1.0,
    period: float = 0.1,
    tolerance: npt.ArrayLike = 0.02,
    threads: int | None = None,
) -> tuple[Tracking, ...]:
    """Follow a motion many times, on other robots or with other measurements, side by side.

    Every argument but the period is one value for all K runs, or one for each, shape (K,). A run
    has the results of :func:`track`; they do not depend on the others.

    Args:
        result: Plan or simulation, whose chosen motion completes.
        mass_error: As of :func:`track`, like the other arguments.
        noise: Noise of measurements.
        friction: Friction of the joints.
        seed: Seed of the random numbers.
        gain: Gain of the controller.
        period: Period of the controller.
        tolerance: Tolerance of the path.
        threads: Number of threads; one for each core when left out.

    Raises:
        InputError: If the motion does not complete, an argument is not accepted, or MuJoCo is not
            installed.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> simulation = ff.simulate(problem, heading=0.0)
        >>> runs = track_many(simulation, mass_error=0.02, noise=1e-4, seed=range(8))
        >>> sum(run.survived for run in runs)
        8
    """
    require_extra("mujoco", "mujoco")
    require_type("result", result, Plan | Simulation, "a Plan or a Simulation")
    if result.chosen is None or not result.chosen.motion.completed:
        raise InputError("result", "it has no motion along the whole path", "a feasible plan")
    motion = result.chosen.motion
    motion.model.require_supported("tracked motions")
    threads = whole_number("threads", available_cores() if threads is None else threads, 1)
    times = _instants(motion.law.timing.duration, period)
    given = {"mass_error": mass_error, "noise": noise, "friction": friction, "seed": seed,
             "gain": gain, "tolerance": tolerance}  # fmt: skip
    columns = _columns(given)
    for key in ("mass_error", "noise", "friction", "tolerance"):
        for value in columns[key]:
            finite_number(key, value, "a number, 0 or more", 0.0)
    highest = _LARGEST_STEP / period
    for value in columns["gain"]:
        finite_number("gain", value, f"a number from 0 to {highest:.6g} 1/s", 0.0, highest)
    columns["seed"] = [seed_number("seed", value) for value in columns["seed"]]
    count = len(columns["seed"])
    size = max(1, min(_TOGETHER, _PERIODS_TOGETHER // len(times), ceil(count / threads)))
    trackings: dict[int, list[Tracking]] = {}

    def simulate(first: int) -> None:
        some = {key: column[first : first + size] for key, column in columns.items()}
        trackings[first] = _tracked(motion, times, some)

    firsts = range(0, count, size)
    run_chunks(simulate, firsts, threads)
    return tuple(tracking for first in firsts for tracking in trackings[first])


def _instants(duration: float, period: float) -> Array:
    """Equidistant instants of control, and the end [s]."""
    accepted = f"a time from {duration / _MAX_PERIODS:.3g} to {duration:.6g} s"
    finite_number("period", period, accepted, duration / _MAX_PERIODS, duration)
    return np.linspace(0.0, duration, 1 + ceil(duration / period))


def _columns(given: dict[str, Any]) -> dict[str, list[Any]]:
    """Values of each run, of arguments that are one value for all or one for each."""
    columns = {k: list(v) if np.ndim(v) else [v] for k, v in given.items()}
    count = max(len(column) for column in columns.values())
    for key, column in columns.items():
        if len(column) not in (1, count) or np.ndim(given[key]) > 1:
            problem = f"shape {np.shape(given[key])} was given"
            raise InputError(key, problem, f"one value for all runs, or {count}")
    return {k: v * count if len(v) == 1 else v for k, v in columns.items()}


def _tracked(motion: Motion, times: Array, columns: dict[str, list[Any]]) -> list[Tracking]:
    """Simulate runs side by side."""
    problem, generators = motion.problem, [np.random.default_rng(k) for k in columns["seed"]]
    dof, periods = problem.model.dof, len(times) - 1
    pairs = list(zip(columns["mass_error"], generators, strict=True))
    factors = np.array([np.exp(error * rng.standard_normal(1 + dof)) for error, rng in pairs])
    pairs = list(zip(columns["noise"], generators, strict=True))
    noise = np.stack([size * rng.standard_normal((periods, 9 + dof)) for size, rng in pairs], 1)
    unique, places = np.unique(factors, axis=0, return_inverse=True)
    robots = [_simulated_robot(motion, row) for row in unique]
    loops = Loops(factors, noise, np.array(columns["friction"]), np.array(columns["gain"]))
    courses = follow(motion, times, loops)
    trackings = []
    for k, place in enumerate(places.tolist()):
        (model, measure), tolerance = robots[place], columns["tolerance"][k]
        attitudes, joints = courses.attitudes[:, k], courses.joints[:, k]
        values, errors = measure(joints), courses.errors[:, k].T
        course = times, attitudes, joints, values * np.sign(values[0]), *errors
        trackings.append(Tracking(model, problem.margin.threshold, tolerance, *course))
    return trackings


def _simulated_robot(motion: Motion, factors: Array) -> tuple[FreeFloatingModel, MeasureValues]:
    """The robot with mass and inertia of every body multiplied by factors (1 + n,)."""
    nominal, problem = motion.model, motion.problem
    places = nominal.link_places.items()
    model = nominal.scaled({link: float(factors[number]) for link, (number, _) in places})
    measure = singularity_measure(model, problem.task, problem.margin.measure.name)
    return model, MeasureValues(model, problem.task, measure)
