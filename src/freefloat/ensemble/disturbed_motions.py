"""Many disturbed motions of one problem at once, each with the verdict of a precise motion.

All motions are integrated in an ensemble. Those that end early, come near to a singularity or near
to the threshold, or on request to bounds of joint ranges, are integrated once more with a tolerance
of 1e-10; where that changes the ending, or the minimum is still too near to the threshold, a
precise motion decides.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import tau

import numpy as np
import numpy.typing as npt

from freefloat.concurrency import Progress, step_of
from freefloat.ensemble.endings import (
    COMPLETED,
    FAILED,
    MOTION,
    NORMAL,
    SINGULAR,
    STRICT,
)
from freefloat.ensemble.ensemble import STEP_TOLERANCE, EnsembleIntegrator
from freefloat.ensemble.equivalence import FACTORS, Equivalents, broadcast, equivalents
from freefloat.ensemble.many_motions import ManyMotions
from freefloat.ensemble.result import EnsembleResult
from freefloat.ensemble.robots import Robots
from freefloat.ensemble.starts import starts_at
from freefloat.errors import InputError, IntegrationError, number_array, whole_number
from freefloat.motion.extrema import closest_approach
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Ending
from freefloat.motion.problem import Problem, require_problem
from freefloat.robot.joint_ranges import largest_range_ratio
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, BoolArray, IntArray, heading_quaternion

_STRICT_TOLERANCE = 1e-10
_NEAR, _STILL_NEAR = 1e-4, 1e-5
"""Differences of minimum and threshold, relative to the threshold, below which an ensemble and one
at the strict tolerance do not decide; larger errors were seen in one of 6,000 planar motions."""
_SINGULAR_RATIO, _PLANAR_RATIO = 1e-3, 0.1
"""Smallest over largest det S* below which errors of the minimum are large, in space and plane."""
SAFE_RANGE, STRICT_SAFE_RANGE = 0.9, 0.99
"""Fractions of joint ranges within which values at the steps of an ensemble, and of one at the
strict tolerance, show that the ranges are kept."""
_EQUAL = 1e-4
"""Relative difference of margins that errors of the ensemble may cause."""
_FIRST_PASS = 0.8
"""Fraction of the progress at which the first ensemble is done."""
_CODES = {Ending.COMPLETED: COMPLETED, Ending.SINGULAR: SINGULAR}


def simulate_many(
    problem: Problem,
    attitudes: npt.ArrayLike | None = None,
    *,
    headings: npt.ArrayLike | None = None,
    branch: int | None = None,
    joints: npt.ArrayLike | None = None,
    momenta: npt.ArrayLike | None = None,
    wheels: npt.ArrayLike | None = None,
    drifts: npt.ArrayLike | None = None,
    durations: npt.ArrayLike | None = None,
    scale_mass: npt.ArrayLike | Mapping[str, npt.ArrayLike] = 1.0,
    thresholds: npt.ArrayLike | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> ManyMotions:
    """Integrate many disturbed motions of a problem and decide which keep the margin.

    Every argument is one value for all motions, or one for each of K. Results do not depend on the
    number of motions, their order or the number of threads.

    Args:
        problem: Robot, path, momentum and margin without disturbances.
        attitudes: Of the spacecraft at the start, quaternions x, y, z, w, shape (4,) or (K, 4).
        headings: For planar tasks, in their place: angles from the inertial x axis [rad].
        branch: Integrate the arm branch with this number.
        joints: Integrate the arm branch nearest to these joint values at each attitude, shape (n,);
            of a redundant arm the configuration to which Newton's method converges from them, if
            it lies inside the joint ranges. With neither argument all arm branches are integrated,
            and the one with the largest minimum margin counts.
        momenta: Angular momenta [N m s], shape (3,) or (K, 3).
        wheels: Momenta stored in wheels [N m s], likewise.
        drifts: Velocities of the centre of mass [m/s], likewise.
        durations: Durations of the path [s]; the time law is stretched.
        scale_mass: Factors on mass and inertia of every link, or a map from links to those of each.
            With such a map, configurations are found fast for one requested ``branch`` or
            ``joints`` alone; otherwise each robot's model is built.
        thresholds: Required margins; by default the problem's.
        threads: Number of threads; one for each core when left out.
        progress: Called with the fraction done, in [0, 1].

    Raises:
        InputError: If an argument is not accepted, or a system would rotate too often.

    Example:
        >>> problem = ff.load_scenario("planar_3dof/parabola_nonstop").problem()
        >>> momenta = np.linspace([0.0, 0.0, -1.0], [0.0, 0.0, 1.0], 201)
        >>> motions = ff.simulate_many(problem, headings=np.radians(200.0), momenta=momenta)
        >>> print(f"{motions.feasible_fraction:.2f}")
        0.87
    """
    require_problem(problem)
    q0 = _attitudes(problem, attitudes, headings)
    if branch is not None:
        existing = problem.many_branches(q0.reshape(-1, 4)[:1]).joints.shape[1]
        whole_number("branch", branch, 0, max(existing, 1) - 1)
    by_link = scale_mass if isinstance(scale_mass, Mapping) else {}
    factor = 1.0 if isinstance(scale_mass, Mapping) else scale_mass
    vectors = {"attitudes": q0, "momenta": momenta, "wheels": wheels, "drifts": drifts}
    numbers = {"durations": durations, "scale_mass": factor, "thresholds": thresholds}
    numbers |= {f"scale_mass.{link}": values for link, values in by_link.items()}
    counts = _counts(vectors, 2) + _counts(numbers, 1)
    count = counts[0] if counts else 1
    disturbed = equivalents(
        problem, count, momenta=momenta, wheels=wheels, drifts=drifts, durations=durations,
        scale_mass=factor, robots=_scaled_robots(problem, by_link, count) if by_link else None,
    )  # fmt: skip
    if disturbed.turns_too_often.any():
        raise InputError("momenta", "a system rotates too often", "smaller or shorter ones")
    required = problem.margin.threshold if thresholds is None else thresholds
    required = broadcast("thresholds", required, (count,), "magnitudes, 0 or more", 0.0, np.inf)
    if joints is not None:
        joints = problem.model.joint_vector(joints)[: problem.model.arm_dof]
    q0 = broadcast("attitudes", q0, (count, 4))
    return integrate_disturbed(disturbed, q0, required, branch, joints, threads, progress)


def _scaled_robots(problem: Problem, scale_mass: Mapping[str, npt.ArrayLike], count: int) -> Robots:
    """Robots with factors on mass and inertia of links."""
    model, factors = problem.model, {}
    for name, values in scale_mass.items():
        if name not in model.link_places:
            accepted = ", ".join(model.link_places)
            raise InputError(f"scale_mass.{name}", "the robot has no such link", accepted)
        factors[name] = broadcast(f"scale_mass.{name}", values, (count,), *FACTORS)

    def model_of(number: int) -> FreeFloatingModel:
        return model.scaled({name: float(values[number]) for name, values in factors.items()})

    robots = Robots.of(model, np.arange(count), model_of, factors=factors)
    if not robots.suit(problem).all():
        words = "with these factors a robot is not symmetric about the plane of its task or measure"
        raise InputError("scale_mass", words, "other factors, or another task or measure")
    return robots


def _counts(given: Mapping[str, npt.ArrayLike | None], dimension: int) -> list[int]:
    """Lengths of the arguments that have a value for each motion."""
    arrays = {
        key: number_array(key, values, "numbers")
        for key, values in given.items()
        if values is not None
    }
    for key, array in arrays.items():
        if not array.size:
            raise InputError(key, "it is empty", "one value, or one for each motion")
    return [len(array) for array in arrays.values() if array.ndim == dimension]


def _attitudes(
    problem: Problem, attitudes: npt.ArrayLike | None, headings: npt.ArrayLike | None
) -> Array:
    """Checked, normalized attitudes, shape (4,) or (K, 4)."""
    if headings is not None and attitudes is None and problem.task.planar:
        angles = number_array("headings", headings, "angles [rad]")
        if angles.ndim > 1 or not angles.size or not np.isfinite(angles).all():
            raise InputError("headings", f"{angles.tolist()} was given", "finite angles [rad]")
        return heading_quaternion(angles)
    if headings is not None or attitudes is None:
        return problem.attitude(attitudes, heading=headings)  # type: ignore[arg-type]  # an error
    q0 = number_array("attitudes", attitudes, "quaternions x, y, z, w")
    if q0.ndim < 2:
        return problem.attitude(q0, key="attitudes")
    checked = [problem.attitude(attitude, key=f"attitudes.{k}") for k, attitude in enumerate(q0)]
    return np.array(checked).reshape(-1, 4)


def integrate_disturbed(
    disturbed: Equivalents,
    attitudes: Array,
    thresholds: Array,
    branch: int | None = None,
    joints: Array | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
    *,
    ranges: bool = False,
) -> ManyMotions:
    """Integrate the motions that stand for disturbed ones; arguments as of :func:`simulate_many`.

    Args:
        disturbed: The motions.
        attitudes: Initial attitudes, unit quaternions x, y, z, w, shape (K, 4).
        thresholds: Required margins, shape (K,).
        branch: Number of the arm branch.
        joints: Joint values near those of the arm branch, shape (n,) or (K, n).
        threads: Number of threads.
        progress: Called with the fraction done.
        ranges: Whether motions near the bounds of joint ranges are integrated strictly, too.
    """
    problem = disturbed.problem
    starts = starts_at(problem, attitudes, branch, joints, disturbed.systems.robots)
    owners, columns = np.nonzero(starts.exist)
    begun = starts.joints[owners, columns]
    motions, deciders = _decided(
        disturbed[owners], attitudes[owners], begun, thresholds[owners], threads, progress, ranges
    )
    chosen = _best(owners, motions, len(attitudes))
    found = chosen >= 0
    table = EnsembleResult.empty((len(attitudes),), problem.model.arm_dof)
    table.assign(found, EnsembleResult._make(values[chosen[found]] for values in motions))
    first, branches = np.full((2, len(attitudes)), -1)
    first[found] = columns[chosen[found]]
    branches[found] = starts.branches[np.arange(len(attitudes)), first][found]
    by = np.zeros(len(attitudes), np.int8)
    by[found] = deciders[chosen[found]]
    initial = np.full((len(attitudes), problem.model.arm_dof), np.nan)
    initial[found] = begun[chosen[found]]
    shifts = _shifts_into_ranges(problem, table.lower, table.upper)
    return ManyMotions(
        np.array(attitudes), initial + shifts, branches, table.endings,
        table.ended_at * disturbed.stretches, table.minimum * disturbed.magnifications,
        table.minimum_at * disturbed.stretches, np.array(thresholds), by,
        table.lower + shifts, table.upper + shifts,
    )  # fmt: skip


def _decided(
    disturbed: Equivalents,
    attitudes: Array,
    joints: Array,
    thresholds: Array,
    threads: int | None,
    progress: Progress | None,
    ranges: bool,
) -> tuple[EnsembleResult, npt.NDArray[np.int8]]:
    """Results of the nominal problem's motions, and what decided them."""
    required = thresholds / disturbed.magnifications

    def integrated(
        chosen: BoolArray | slice, tolerance: float, progress: Progress | None
    ) -> EnsembleResult:
        some = disturbed[chosen]
        integrator = EnsembleIntegrator(disturbed.problem, threads, tolerance=tolerance)
        return integrator.integrate(
            attitudes[chosen], joints[chosen], some.systems, progress=progress
        )

    first = integrated(slice(None), STEP_TOLERANCE, step_of(progress, 0.0, _FIRST_PASS))
    motions = EnsembleResult._make(values.copy() for values in first)
    nearly_singular = _PLANAR_RATIO if disturbed.problem.task.planar else _SINGULAR_RATIO
    again = (motions.endings != COMPLETED) | (motions.determinant_ratios < nearly_singular)
    again |= _is_near(motions.minimum, required, _NEAR)
    if ranges:
        shifts = _shifts_into_ranges(disturbed.problem, motions.lower, motions.upper)
        ratios = largest_range_ratio(
            disturbed.problem.model.joint_ranges, motions.lower + shifts, motions.upper + shifts
        )
        again |= (motions.minimum >= required) & (ratios > SAFE_RANGE)
    strict = integrated(again, _STRICT_TOLERANCE, step_of(progress, _FIRST_PASS, 1.0))
    doubtful = np.zeros(len(joints), dtype=bool)
    doubtful[again] = (
        (strict.endings != motions.endings[again])
        | (strict.endings == FAILED)
        | _is_near(strict.minimum, required[again], _STILL_NEAR)
    )
    motions.assign(again, strict)
    for k in np.flatnonzero(doubtful).tolist():
        _decide_precisely(disturbed.problem_of(k), attitudes[k], joints[k], motions, k)
    deciders = np.where(again, np.where(doubtful, MOTION, STRICT), NORMAL)
    return motions, deciders.astype(np.int8)


def _is_near(minimum: Array, required: Array, distance: float) -> BoolArray:
    return np.asarray(np.abs(minimum - required) < distance * required)


def _decide_precisely(
    problem: Problem, attitude: Array, joints: Array, motions: EnsembleResult, k: int
) -> None:
    """Write ending and minimum of a precise motion; one that fails keeps the ending FAILED."""
    try:
        motion = integrate_motion(problem, attitude, joints)
    except IntegrationError:
        motions.endings[k] = FAILED
        return
    approach = closest_approach(motion, problem.margin.measure)
    motions.endings[k] = _CODES[motion.ending]
    motions.ended_at[k] = motion.final.time
    motions.minimum[k] = 0.0 if motion.ending is Ending.SINGULAR else approach.value
    motions.minimum_at[k] = approach.time


def _best(owners: IntArray, motions: EnsembleResult, count: int) -> IntArray:
    """Of the motions of each of ``count`` owners the one that simulate prefers; -1 without any.

    Completion first, then the minimum margin; of nearly equal ones, such as those of mirrored arm
    branches, the first.
    """
    completed = motions.endings == COMPLETED
    anywhere, largest = np.zeros(count, dtype=bool), np.full(count, -np.inf)
    np.logical_or.at(anywhere, owners, completed)
    candidates = np.flatnonzero(completed == anywhere[owners])
    merits = np.where(completed, motions.minimum, motions.ended_at)[candidates]
    np.maximum.at(largest, owners[candidates], merits)
    candidates = candidates[merits >= (1.0 - _EQUAL) * largest[owners[candidates]]]
    best = np.full(count, -1)
    distinct, places = np.unique(owners[candidates], return_index=True)
    best[distinct] = candidates[places]
    return best


def _shifts_into_ranges(problem: Problem, low: Array, high: Array) -> Array:
    """Multiples of 2 pi that put joint values from low to high into their ranges, shape (K, n).

    The rule is that of :func:`~freefloat.motion.extrema.unwrapped`.
    """
    lower, upper = problem.chain().joint_ranges
    first, last = np.ceil((lower - low) / tau), np.floor((upper - high) / tau)
    inside = np.minimum(np.maximum(0.0, first), last)
    with np.errstate(invalid="ignore"):  # of joints without range
        middle = ((lower + upper) - (low + high)) / (2.0 * tau)
        choices = np.stack([np.floor(middle), np.ceil(middle), np.zeros_like(low)])
        excesses = np.maximum(lower - low - tau * choices, high + tau * choices - upper)
    outside = np.take_along_axis(choices, excesses.argmin(axis=0)[None], axis=0)[0]
    shifts = np.where(first <= last, inside, np.nan_to_num(outside))
    shifts = np.where(problem.chain().prismatic | ~np.isfinite(low), 0.0, shifts)
    return np.asarray(tau * shifts)
