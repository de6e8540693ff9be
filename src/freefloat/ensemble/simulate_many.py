"""The arrays of many disturbed motions, checked and integrated at once."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from freefloat.concurrency import Progress
from freefloat.ensemble.disturbed_verdicts import ManyMotions, integrate_disturbed
from freefloat.ensemble.robots import Robots
from freefloat.ensemble.systems import FACTORS, broadcast, equivalents
from freefloat.errors import InputError, number_array, whole_number
from freefloat.motion.problem import Problem, require_problem
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array


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
    number of motions, their order or the number of threads. Limits are not considered, not even
    limits of the problem; studies consider them.

    Args:
        problem: Robot, path, momentum and margin without disturbances.
        attitudes: Initial attitudes of the spacecraft, quaternions x, y, z, w, (4,) or (K, 4).
        headings: In their place, in a plane or on a table: angles about its normal [rad].
        branch: Integrate the arm branch with this number.
        joints: Integrate the arm branch nearest to these joint values at each attitude, shape (n,);
            of a redundant arm the configuration to which Newton's method converges from them, if
            it lies inside the joint ranges. With neither argument all arm branches are integrated,
            and the one with the largest minimum margin counts.
        momenta: Angular momenta [N m s], shape (3,) or (K, 3).
        wheels: Momenta stored in wheels [N m s], likewise.
        drifts: Velocities of the centre of mass [m/s], likewise.
        durations: Durations of the path [s]; the time law is stretched.
        scale_mass: Factors on mass and inertia of every link, or a map from links to their factors.
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
        joints = problem.solved_joints(problem.model.joint_vector(joints))
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
    if headings is not None and attitudes is None and problem.has_headings:
        angles = number_array("headings", headings, "angles [rad]")
        if angles.ndim > 1 or not angles.size or not np.isfinite(angles).all():
            raise InputError("headings", f"{angles.tolist()} was given", "finite angles [rad]")
        return problem.plane.attitudes(angles)
    if headings is not None or attitudes is None:
        return problem.attitude(attitudes, heading=headings)  # type: ignore[arg-type]  # an error
    q0 = number_array("attitudes", attitudes, "quaternions x, y, z, w")
    if q0.ndim < 2:
        return problem.attitude(q0, key="attitudes")
    checked = [problem.attitude(attitude, key=f"attitudes.{k}") for k, attitude in enumerate(q0)]
    return np.array(checked).reshape(-1, 4)
