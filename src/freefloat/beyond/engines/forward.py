"""Forward simulations of a motion by another engine, with joint servos that follow its joints."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy

from freefloat.dynamics.system import System
from freefloat.motion.motion import Ending, Motion, State
from freefloat.rotations import rotation_matrix
from freefloat.so3 import Array, angle_between

STIFFNESS = 0.2
"""Natural frequency of the servos times the time step."""
_BEFORE_SINGULAR = 0.9
"""Fraction of a motion that is used if its end is singular."""
_FEWEST_STEPS = 4000
"""Smallest number of steps."""
_STEPS_PER_RADIAN = 150
"""Steps per radian or metre of motion."""
_STEPS_PER_SEGMENT = 40
"""Steps per smooth segment."""
_MAX_STEPS = 40_000
"""Largest number of steps."""
_SPLINE = 0.3
"""Knots per step of the splines that the servos follow."""


@dataclass(frozen=True)
class ForwardRun:
    """End of an engine's own integration, with joint servos that follow the recorded joints.

    Attributes:
        attitude: Angle of the spacecraft from the recorded attitude at the end [rad].
        joints: Largest difference of a joint at the end [rad or m].
        position: Distance of the spacecraft from its recorded position [m].
        until: Time of the end [s].
        steps: Number of steps.
    """

    attitude: float
    joints: float
    position: float
    until: float
    steps: int

    @classmethod
    def of(cls, motion: Motion, state: State, steps: int) -> ForwardRun:
        """Compare the state at the end of a simulation with the motion."""
        (recorded,) = motion.sample(state.time)
        return cls(
            attitude=float(angle_between(state.attitude, recorded.attitude)),
            joints=float(np.abs(state.joints - recorded.joints).max()),
            position=float(np.linalg.norm(state.base_position - recorded.base_position)),
            until=state.time,
            steps=steps,
        )


@dataclass(frozen=True, eq=False)
class Reference:
    """Joints that servos follow, by time.

    Attributes:
        first: Time at which the simulation begins [s].
        last: Time at which it ends [s].
        steps: Number of its steps.
    """

    first: float
    last: float
    steps: int
    _spline: scipy.interpolate.CubicSpline = field(repr=False)

    @classmethod
    def of(cls, motion: Motion, steps: int | None = None) -> Reference:
        """The joints of a motion; the number of steps follows from its length if not given."""
        first, last = known_span(motion)
        if steps is None:
            required_steps = max(
                _STEPS_PER_RADIAN * displacements(motion).sum(),
                _STEPS_PER_SEGMENT * len(motion.problem.breaks),
            )
            steps = int(np.clip(required_steps, _FEWEST_STEPS, _MAX_STEPS))
        nodes = np.linspace(first, last, round(_SPLINE * steps) + 1)
        _, _, rows = motion.evaluate(motion.coordinates_at(nodes))
        return cls(first, last, steps, scipy.interpolate.CubicSpline(nodes, rows))

    @property
    def step(self) -> float:
        """Length of a step [s]."""
        return (self.last - self.first) / self.steps

    def __call__(self, t: float, order: int = 0) -> Array:
        """Joints (n,) at a time [s], or their first or second derivative."""
        return np.asarray(self._spline(t, order))


def base_velocity(system: System, state: State, rates: Array) -> Array:
    """Velocity of the spacecraft in the frame of the path.

    Args:
        system: Robot, momenta and drift.
        state: Attitude and joints.
        rates: Joint rates, shape (n,).

    Returns:
        Linear velocity in inertial axes, angular velocity in axes of the spacecraft, shape (6,).
    """
    twist = system.base_twist(state.attitude, state.joints, rates)
    return np.concatenate([rotation_matrix(state.attitude) @ twist[:3], twist[3:]])


def known_span(motion: Motion) -> tuple[float, float]:
    """First and last time at which rates are bounded: not near a singular end."""
    first, last = float(motion.times.min()), float(motion.times.max())
    fraction = _BEFORE_SINGULAR if motion.ending is Ending.SINGULAR else 1.0
    return first, first + fraction * (last - first)


def displacements(motion: Motion) -> Array:
    """Displacement of the spacecraft and the fastest joint between nodes [rad, m]."""
    rotated = angle_between(motion.attitudes[1:], motion.attitudes[:-1])
    return np.asarray(rotated + np.abs(np.diff(motion.joints, axis=0)).max(axis=1))
