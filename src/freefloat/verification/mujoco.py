"""A motion repeated with MuJoCo: inverse dynamics, and a forward simulation with joint servos."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from scipy.interpolate import CubicSpline

from freefloat.dynamics.momentum import momentum_map
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.motion.motion import Ending, Motion
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, angle_between, rotation_matrix
from freefloat.verification.mujoco_model import Engine

_INSTANTS = 61
_SAMPLES = 15
"""Samples around an instant."""
_DEGREE = 6
"""Degree of the polynomials fitted to them."""
_WINDOW = 5e-3
"""Half the time over which a motion is differentiated, as a fraction of its duration."""
_WINDOW_ANGLE = 0.1
"""Largest displacement in that time [rad, m]."""
_WITHIN = 0.49
"""The same time as a fraction of a smooth segment, at most."""
_SHORTEST = 0.02
"""Fraction of that time that suffices for derivatives."""
_BEFORE_SINGULAR = 0.9
"""Fraction of a motion that is used if its end is singular."""
_STEPS = 4000
"""Smallest number of steps."""
_STEPS_PER_RADIAN = 150
"""Steps per radian or metre of motion."""
_STEPS_PER_SEGMENT = 40
"""Steps per smooth segment."""
_MAX_STEPS = 40_000
"""Largest number of steps."""
_SPLINE = 0.3
"""Knots per step of the splines that the servos follow."""
_STIFFNESS = 0.2
"""Natural frequency of the servos times the time step."""


@dataclass(frozen=True)
class InverseRun:
    """Inverse dynamics along the recorded motion.

    Attributes:
        wrench: Largest moment on the base, forces times the reach of the arm [N m].
        wrench_time: When [s].
        torque: Largest joint torque [N m or N].
        momentum: Largest deviation of the angular momentum [N m s].
        end_effector: Largest distance of the end-effector from its path [m].
        looks: Number of instants.
    """

    wrench: float
    wrench_time: float
    torque: float
    momentum: float
    end_effector: float
    looks: int


@dataclass(frozen=True)
class ForwardRun:
    """End of MuJoCo's own integration, with joint servos that follow the recorded joints.

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


def inverse_run(motion: Motion, engine: Engine) -> InverseRun:
    """Inverse dynamics of the recorded positions, differentiated twice."""
    first, last = _known(motion)
    problem, window = motion.problem, _window(motion, first, last)
    reach = VirtualManipulator.of(problem.model).reach
    rows = []
    for t, half in _instants(motion, first, last, window):
        wrench, torque = engine.inverse(*_differentiated(motion, t, half))
        rows.append((
            t,
            max(reach * np.abs(wrench[:3]).max(), np.abs(wrench[3:]).max()),
            np.abs(torque).max(),
            np.linalg.norm(engine.angular_momentum() - problem.momentum),
            _off_path(motion, engine, t),
        ))  # fmt: skip
    values = np.array(rows)
    _, wrench, torque, momentum, distance = values.max(axis=0).tolist()
    when = float(values[values[:, 1].argmax(), 0])
    return InverseRun(wrench, when, torque, momentum, distance, len(rows))


def _known(motion: Motion) -> tuple[float, float]:
    """First and last time at which rates are bounded: not near a singular end."""
    first, last = float(motion.times.min()), float(motion.times.max())
    fraction = _BEFORE_SINGULAR if motion.ending is Ending.SINGULAR else 1.0
    return first, first + fraction * (last - first)


def _moved(motion: Motion) -> Array:
    """Displacement of the spacecraft and the fastest joint between nodes [rad, m]."""
    rotated = angle_between(motion.attitudes[1:], motion.attitudes[:-1])
    return np.asarray(rotated + np.abs(np.diff(motion.joints, axis=0)).max(axis=1))


def _window(motion: Motion, first: float, last: float) -> float:
    """Half the time over which to differentiate [s], short if the system tumbles."""
    passed = np.abs(np.diff(motion.times))
    known = (motion.times[1:] <= last) & (motion.times[:-1] <= last) & (passed > 0.0)
    fastest = float((_moved(motion)[known] / passed[known]).max(initial=0.0))
    return min(_WINDOW * (last - first), _WINDOW_ANGLE / max(fastest, 1e-300))


def _instants(
    motion: Motion, first: float, last: float, window: float
) -> list[tuple[float, float]]:
    """Instants [s], and half the time over which to differentiate there.

    Accelerations, or their slopes, jump where segments of the time law or of the path meet; an
    instant keeps to one segment.
    """
    breaks = motion.problem.path.breaks
    edges = np.array([first, *breaks[(breaks > first) & (breaks < last)], last])
    instants = []
    for t in np.linspace(first, last, _INSTANTS).tolist():
        segment = min(int(np.searchsorted(edges, t, "right")), len(edges) - 1)
        low, high = edges[segment - 1 : segment + 1].tolist()
        half = min(window, _WITHIN * (high - low))
        instants.append((float(np.clip(t, low + half, high - half)), half))
    return [instant for instant in instants if instant[1] > _SHORTEST * window] or instants


def _differentiated(motion: Motion, t: float, window: float) -> tuple[Array, Array, Array]:
    """Position, attitude and joints, and their first two derivatives: a fit of samples.

    The position is that of the spacecraft in the frame of the path.
    """
    places = chebyshev.chebpts1(_SAMPLES)
    states = motion.sample(t + window * places)
    drift = motion.problem.path.drift
    rows = np.array([
        np.concatenate([s.base_position + s.time * drift, s.attitude, s.joints]) for s in states
    ])  # fmt: skip
    fit = chebyshev.chebfit(places, rows, _DEGREE)
    value, rate, acceleration = (
        np.asarray(chebyshev.chebval(0.0, chebyshev.chebder(fit, k)) / window**k) for k in range(3)
    )
    return value, rate, acceleration


def _off_path(motion: Motion, engine: Engine, t: float) -> float:
    """Distance of MuJoCo's end-effector from the path [m]."""
    position, _ = engine.end_effector()
    rows = [row for row in motion.problem.task.rows if row < 3]
    path = motion.problem.path
    return float(np.linalg.norm((position - path.path.curve(path.timing.s(t)))[rows]))


def forward_run(motion: Motion, engine: Engine, *, steps: int | None = None) -> ForwardRun:
    """Simulate a free base with joint servos that follow the recorded joints.

    The number of steps is that given, or one that follows from the length of the motion.

    The servos are computed-torque controllers on MuJoCo's own mass matrix. Attitude and position
    of the spacecraft are not controlled: their deviations at the end are the result.
    """
    first, last = _known(motion)
    required_steps = max(
        _STEPS_PER_RADIAN * _moved(motion).sum(),
        _STEPS_PER_SEGMENT * len(motion.problem.path.breaks),
    )
    steps = steps or int(np.clip(required_steps, _STEPS, _MAX_STEPS))
    nodes = np.linspace(first, last, round(_SPLINE * steps) + 1)
    _, _, rows = motion.evaluate(motion.coordinate_at(nodes))
    reference = CubicSpline(nodes, rows)
    h = (last - first) / steps
    stiff, damp = (_STIFFNESS / h) ** 2, 2.0 * _STIFFNESS / h
    start(motion, engine, first, reference(first, 1), motion.problem.model)
    engine.rest(h)
    data = engine.data
    for step in range(steps):
        t = first + (step + 0.5) * h
        M, bias = engine.inertia()
        ahead = data.qpos[7:] + h / 2.0 * data.qvel[6:]
        acceleration = (
            reference(t, 2)
            + damp * (reference(t, 1) - data.qvel[6:])
            + stiff * (reference(t) - ahead)
        )
        base = -np.linalg.solve(M[:6, :6], M[:6, 6:] @ acceleration + bias[:6])
        engine.step(M[6:, :6] @ base + M[6:, 6:] @ acceleration + bias[6:])
    (state,), drift = motion.sample(last), motion.problem.path.drift
    return ForwardRun(
        attitude=float(angle_between(np.roll(data.qpos[3:7], -1), state.attitude)),
        joints=float(np.abs(data.qpos[7:] - state.joints).max()),
        position=float(np.linalg.norm(data.qpos[:3] - state.base_position - last * drift)),
        until=last,
        steps=steps,
    )


def start(motion: Motion, engine: Engine, t: float, rates: Array, model: FreeFloatingModel) -> None:
    """Set the state of the motion at a time, in the frame of the path, with its momentum.

    Args:
        motion: Motion.
        engine: MuJoCo's robot.
        t: Time [s].
        rates: Joint rates, shape (n,).
        model: The robot that the engine simulates.
    """
    (state,) = motion.sample(t)
    A = momentum_map(model, state.joints, state.attitude)
    wheels = rotation_matrix(state.attitude) @ motion.problem.wheel_momentum
    demanded = np.concatenate([np.zeros(3), motion.problem.momentum - wheels])
    twist = np.linalg.solve(A[:, :6], demanded - A[:, 6:] @ rates)
    data, drift = engine.data, motion.problem.path.drift
    position = state.base_position + t * drift
    data.qpos[:] = [*position, *np.roll(state.attitude, 1), *state.joints]
    data.qvel[:] = [*(rotation_matrix(state.attitude) @ twist[:3] + drift), *twist[3:], *rates]
    data.qacc[:] = 0.0
