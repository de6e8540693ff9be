"""Gravity gradient along a motion, the centre of mass on a circular orbit about the Earth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy

from freefloat.dynamics.momentum import inertia_matrices
from freefloat.dynamics.resolved_rates import ResolvedRateSolver
from freefloat.errors import finite_number
from freefloat.motion.motion import Motion, State
from freefloat.motion.problem import Problem
from freefloat.rotations import rotation_matrix
from freefloat.so3 import Array, angle_between

_EARTH = 3.986004418e14
"""Gravitational parameter of the Earth (WGS 84) [m³/s²]."""
LOWEST, HIGHEST = 6.4e6, 1e9
"""Accepted radii of orbits [m]."""
_TOLERANCE = 1e-9
"""Tolerance of the integrator, relative and absolute."""
_SAMPLES = 4000
"""Instants at which the margin is evaluated."""


@dataclass(frozen=True)
class CircularOrbit:
    """Orbit of the centre of mass in the inertial x-y plane; at time 0 the Earth is toward -x.

    Attributes:
        radius: Radius of the orbit [m].
    """

    radius: float

    def __post_init__(self) -> None:
        accepted = f"the radius of an orbit, {LOWEST:g} to {HIGHEST:g} m"
        finite_number("gravity", self.radius, accepted, LOWEST, HIGHEST)

    @property
    def rate(self) -> float:
        """Orbital rate [rad/s]."""
        return float(np.sqrt(_EARTH / self.radius**3))

    def direction(self, t: float) -> Array:
        """Unit vector from the Earth at a time [s], inertial axes."""
        angle = self.rate * t
        return np.array([np.cos(angle), np.sin(angle), 0.0])

    def torque(self, t: float, inertia: Array) -> Array:
        """Gravity-gradient torque on a body with an inertia about its centre of mass [N m].

        3 mu / r³ u x I u (Hughes, Spacecraft Attitude Dynamics, 1986), inertial axes; inertias and
        torques may be stacked.
        """
        u = self.direction(t)
        return np.asarray(3.0 * self.rate**2 * np.cross(u, inertia @ u))

    def forces(self, t: float, masses: Array, centres: Array) -> Array:
        """Differential gravity on bodies: gravity relative to that of the common centre of mass.

        Args:
            t: Time [s].
            masses: Masses of the bodies [kg], shape (K,).
            centres: Centres of mass, inertial axes [m], shape (K, 3).

        Returns:
            Forces [N], shape (K, 3).
        """
        u = self.direction(t)
        x = centres - masses @ centres / masses.sum()
        return np.asarray(self.rate**2 * masses[:, None] * (3.0 * np.outer(x @ u, u) - x))


@dataclass(frozen=True)
class GravityRun:
    """Effect of gravity gradient over a motion.

    Attributes:
        radius: Radius of the orbit [m].
        attitude: Change of the final attitude, the joints moving as recorded [rad].
        position: Change of the final position of the end-effector, the same [m].
        momentum: Change of the angular momentum, the end-effector being kept on the path [N m s].
        margin: Smallest margin, the same; zero if the arm becomes singular.
    """

    radius: float
    attitude: float
    position: float
    momentum: float
    margin: float


def gravity_run(
    motion: Motion, orbit: CircularOrbit, without: State, with_gravity: State
) -> GravityRun:
    """Compare two simulations of the recorded joints, and follow the path with gravity gradient.

    Args:
        motion: The recorded motion.
        orbit: Orbit of the centre of mass.
        without: Final state of a simulation without gravity.
        with_gravity: The same with gravity gradient.
    """
    ends = [
        motion.problem.model.end_effector_pose(state.attitude, state.joints).position
        for state in (without, with_gravity)
    ]
    momentum, margin = _on_the_path(motion, orbit)
    return GravityRun(
        radius=orbit.radius,
        attitude=float(angle_between(with_gravity.attitude, without.attitude)),
        position=float(np.linalg.norm(ends[1] - ends[0])),
        momentum=momentum,
        margin=margin,
    )


def _on_the_path(motion: Motion, orbit: CircularOrbit) -> tuple[float, float]:
    """Change of the momentum [N m s] and smallest margin if the whole path is followed."""
    problem, first = motion.problem, motion.initial
    y = np.concatenate([first.attitude, first.joints, problem.momentum])
    times = np.linspace(0.0, problem.path.duration, _SAMPLES + 1)
    edges = [0.0, *problem.path.breaks, problem.path.duration]
    margins = []
    for start, end in pairwise(edges):
        segment = problem.path.timing.segment_at((start + end) / 2.0)
        inner = times[(times > start) & (times < end)]
        with np.errstate(over="ignore", invalid="ignore"):  # rates have no bound at a singularity
            solution = scipy.integrate.solve_ivp(
                _slopes, (start, end), y, "DOP853", np.array([start, *inner, end]),
                args=(problem, orbit, segment), rtol=_TOLERANCE, atol=_TOLERANCE,
            )  # fmt: skip
        margins += [problem.margin.measure(q) for q in solution.y[4:-3].T]
        y = solution.y[:, -1]
        if not solution.success:
            break
    signed = np.array(margins) * np.sign(margins[0])
    smallest = float(signed.min()) if solution.success else 0.0
    return float(np.linalg.norm(y[-3:] - problem.momentum)), max(0.0, smallest)


def _slopes(t: float, y: Array, problem: Problem, orbit: CircularOrbit, segment: int) -> Array:
    """Derivative of attitude, joints and angular momentum by time."""
    attitude, joints, momentum = y[:4] / np.linalg.norm(y[:4]), y[4:-3], y[-3:]
    system = replace(problem.system, momentum=momentum)
    solver = ResolvedRateSolver(system, problem.task, problem.redundancy)
    omega, rates = solver.rates(attitude, joints, *problem.path.twist_and_speed(t, segment))
    vector, scalar = attitude[:3], attitude[3]
    turn = np.append(scalar * omega + np.cross(vector, omega), -vector @ omega) / 2.0
    R0, (D, _) = rotation_matrix(attitude), inertia_matrices(problem.model, joints)
    return np.concatenate([turn, rates, orbit.torque(t, R0 @ D @ R0.T)])
