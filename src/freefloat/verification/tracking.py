"""Closed-loop tracking: a controller that knows the nominal robot follows a plan in MuJoCo.

Once per period the controller measures attitude, joints and the pose of the end-effector, and
solves (4) of the nominal robot for joint rates: resolved-rate control with the generalized Jacobian
(Umetani and Yoshida 1989), with the twist of the path plus a gain times the error of the pose.
Joint servos follow these rates on a simulated robot with other masses, other inertias and dry
friction.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from itertools import pairwise
from math import ceil
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.momentum import Task
from freefloat.errors import InputError, finite_number, require_extra, require_type, seed_number
from freefloat.motion.margin import keeps_threshold
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.planning.plan import Plan
from freefloat.planning.simulation import Simulation
from freefloat.robot.assembly import scaled
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, Pose, cross, frozen, rotation_vector_between
from freefloat.verification.engines.mujoco import start
from freefloat.verification.engines.mujoco_model import Engine
from freefloat.verification.engines.plant import Plant

_LARGEST_STEP = 0.5
"""Largest product of gain and period; the loop becomes unstable at 2."""
_FASTEST = 10.0
"""Largest commanded joint rate, in units of the largest planned one."""
_MAX_PERIODS = 1_000_000
"""Largest number of periods."""


@dataclass(frozen=True, eq=False)
class Tracking:
    """A plan followed by a controller, on a simulated robot that deviates from its model.

    Attributes:
        model: The simulated robot.
        threshold: Required margin.
        tolerance: Allowed distance from the path [m] and angle from its orientation [rad].
        times: Instants of control, and the end [s], shape (K,).
        attitudes: Of the spacecraft, unit quaternions x, y, z, w, shape (K, 4).
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
            "survived": self.survived,
            "margin": self.minimum_margin,
            "margin_time": self.margin_time,
            "margin_required": self.threshold,
            "peak_position_error": self.peak_position_error,
            "final_position_error": self.final_position_error,
            "peak_orientation_error": self.peak_orientation_error,
            "tolerance": self.tolerance,
        }


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
        seed: Of the random numbers.
        gain: Of the error of the pose [1/s].
        period: Of the controller [s].
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
    require_extra("mujoco", "mujoco")
    motion = _whole_motion(result)
    deviations = {"mass_error": mass_error, "noise": noise, "friction": friction}
    for name, value in {**deviations, "tolerance": tolerance}.items():
        finite_number(name, value, "a number, 0 or more", 0.0)
    problem = motion.problem
    times = _instants(problem.path.duration, gain, period)
    rng = np.random.default_rng(seed_number("seed", seed))
    model = _deviating(
        problem.model, np.exp(mass_error * rng.standard_normal(1 + problem.model.dof))
    )
    controller = _Controller(motion, noise, gain, rng)
    engine = Engine(replace(problem.system, model=model))
    start(motion, engine, 0.0, controller.planned_rates)
    plant = Plant(engine, problem.model, times[1], friction)
    rows = [_row(problem, plant, 0.0)]
    for t, following in pairwise(times.tolist()):
        plant.advance(controller.rates(plant, t, following))
        rows.append(_row(problem, plant, following))
    values = np.array(rows)
    measure = singularity_measure(model, problem.task, problem.margin.measure.name)
    margins = np.array([measure(joints) for joints in values[:, 6:]])
    return Tracking(
        model, problem.margin.threshold, tolerance, times, values[:, 2:6], values[:, 6:],
        margins * np.sign(margins[0]), values[:, 0], values[:, 1],
    )  # fmt: skip


def _whole_motion(result: Plan | Simulation) -> Motion:
    require_type("result", result, Plan | Simulation, "a Plan or a Simulation")
    if result.chosen is None or not result.chosen.motion.completed:
        raise InputError("result", "it has no motion along the whole path", "a feasible plan")
    return result.chosen.motion


def _instants(duration: float, gain: float, period: float) -> Array:
    """Equidistant instants of control, and the end [s]."""
    accepted = f"a time from {duration / _MAX_PERIODS:.3g} to {duration:.6g} s"
    finite_number("period", period, accepted, duration / _MAX_PERIODS, duration)
    highest = _LARGEST_STEP / period
    finite_number("gain", gain, f"a number from 0 to {highest:.6g} 1/s", 0.0, highest)
    return np.linspace(0.0, duration, 1 + ceil(duration / period))


def _deviating(model: FreeFloatingModel, factors: Array) -> FreeFloatingModel:
    """The robot with mass and inertia of every body multiplied by factors (1 + n,)."""
    places = model.link_places.items()
    by_link = {link: float(factors[number]) for link, (number, _) in places}
    description = scaled(model.description, by_link)
    return FreeFloatingModel(description, model.end_effector, model.fixed_joints)


class _Controller:
    """Resolved-rate control with the nominal robot and noisy measurements."""

    def __init__(self, motion: Motion, noise: float, gain: float, rng: np.random.Generator) -> None:
        self._problem = problem = motion.problem
        self._solver = problem.resolved_rate_solver()
        self._noise, self._gain, self._rng = noise, gain, rng
        twist, speed = problem.path.twist_and_speed(0.0)
        initial = motion.initial
        _, self.planned_rates = self._solver.rates(initial.attitude, initial.joints, twist, speed)
        moved = np.abs(np.diff(motion.joints, axis=0)).max(axis=1)
        self._fastest = _FASTEST * float((moved / np.diff(motion.times)).max())
        self._rates = self.planned_rates

    def rates(self, plant: Plant, t: float, following: float) -> Array:
        """The joint rates to command from one instant to the following one [s], shape (n,)."""
        path = self._problem.path
        pose = plant.end_effector
        measured = Pose(pose.position + self._random(3), self._turned() @ pose.rotation)
        attitude = Rotation.from_matrix(self._turned()) * Rotation.from_quat(plant.attitude)
        error = _pose_error(self._problem, measured, t)
        twist, speed = path.twist_and_speed((t + following) / 2.0)
        joints = plant.joints + self._random(self._problem.model.dof)
        _, rates = self._solver.rates(attitude.as_quat(), joints, twist + self._gain * error, speed)
        largest = np.abs(rates).max()
        if np.isfinite(largest):  # at a singularity the last command holds
            self._rates = rates * min(1.0, self._fastest / max(largest, self._fastest))
        return self._rates

    def _random(self, count: int) -> Array:
        return self._noise * self._rng.standard_normal(count)

    def _turned(self) -> Array:
        return np.asarray(Rotation.from_rotvec(self._random(3)).as_matrix())


def _pose_error(problem: Problem, pose: Pose, t: float) -> Array:
    """Displacement and rotation vector from a pose to the path, inertial axes, shape (6,).

    Components that the task leaves free are zero; the rotation of ``pointing`` is that of the z
    axis.
    """
    target = problem.path.path.pose(problem.path.timing.s(t))
    rows = problem.task.rows
    if problem.task is Task.POINTING:
        axes = pose.rotation[:, 2], target.rotation[:, 2]
        sine = cross(*axes)
        angle = np.arctan2(np.linalg.norm(sine), axes[0] @ axes[1])
        turn, rows = sine / np.sinc(angle / np.pi), list(range(6))
    else:
        turn = rotation_vector_between(pose.rotation, target.rotation)
    error = np.zeros(6)
    error[rows] = np.concatenate([target.position - pose.position, turn])[rows]
    return error


def _row(problem: Problem, plant: Plant, t: float) -> Array:
    """Distance from the path, angle from its orientation, attitude and joints."""
    error = _pose_error(problem, plant.end_effector, t)
    sizes = np.linalg.norm(error[:3]), np.linalg.norm(error[3:])
    return np.concatenate([sizes, plant.attitude, plant.joints])
