"""A motion proved again with MuJoCo: what pushes the base, and where servos take it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from scipy.interpolate import CubicSpline

from freefloat.dynamics.momentum import momentum_map
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.motion.motion import Ending, Motion
from freefloat.so3 import Array, angle_between, rotation_matrix
from freefloat.verification.mujoco_engine import Engine

_LOOKS = 61
_SAMPLES, _DEGREE = 15, 6
"""Samples of the motion about a time, and the degree of polynomials fitted to them."""
_WINDOW, _WINDOW_TURN = 5e-3, 0.1
"""Half the time over which a motion is differentiated: a share of it, in which no more is turned
at the motion's fastest [rad, m]."""
_WITHIN, _SHORTEST = 0.49, 0.02
"""The most of it, as a share of a smooth piece; the share of it over which rates can be told."""
_BEFORE_SINGULAR = 0.9
"""Share of a motion's time that is looked at when its end is singular."""
_STEPS, _STEPS_PER_TURN, _STEPS_PER_PIECE, _MOST_STEPS = 4000, 150, 40, 40_000
"""Least number, number per radian or metre that spacecraft and joints move, and per smooth piece of
the path, and largest."""
_SPLINE = 0.3
"""Joint values that a servo is given, as splines between them, per step."""
_STIFFNESS = 0.2
"""Of the servos: their frequency times the time step."""


@dataclass(frozen=True)
class InverseRun:
    """What inverse dynamics asks for along the recorded motion.

    Attributes:
        wrench: Largest moment on the base, forces counted at the end of the arm's reach [N m].
        wrench_time: When [s].
        torque: Largest joint torque [N m or N].
        momentum: Largest deviation of the angular momentum [N m s].
        end_effector: Largest distance of the end-effector from its path [m].
        looks: Number of times looked at.
    """

    wrench: float
    wrench_time: float
    torque: float
    momentum: float
    end_effector: float
    looks: int


@dataclass(frozen=True)
class ForwardRun:
    """Where MuJoCo's own integration ends when joint servos follow the recorded joints.

    Attributes:
        attitude: Angle of the spacecraft from the recorded attitude at the end [rad].
        joints: Largest difference of a joint at the end [rad or m].
        position: Of the spacecraft likewise [m].
        until: When that is [s].
        steps: Number of steps.
    """

    attitude: float
    joints: float
    position: float
    until: float
    steps: int


def inverse_run(motion: Motion, engine: Engine) -> InverseRun:
    """Inverse dynamics of what is recorded: positions differentiated twice, nothing solved.

    Args:
        motion: The motion.
        engine: Of the same robot.
    """
    first, last = _known(motion)
    problem, window = motion.problem, _window(motion, first, last)
    reach = VirtualManipulator.of(problem.model).reach
    wrenches, torques, momenta, hands, times = [], [], [], [], []
    for t, half in _looks(motion, first, last, window):
        state = _differentiated(motion, t, half)
        wrench, torque = engine.inverse(*state)
        momenta.append(np.linalg.norm(engine.momentum(*state)[2] - problem.momentum))
        hands.append(_off_path(motion, engine, t))
        wrenches.append(max(reach * np.abs(wrench[:3]).max(), np.abs(wrench[3:]).max()))
        torques.append(np.abs(torque).max())
        times.append(t)
    return InverseRun(
        wrench=float(np.max(wrenches)),
        wrench_time=times[int(np.argmax(wrenches))],
        torque=float(np.max(torques)),
        momentum=float(np.max(momenta)),
        end_effector=float(np.max(hands)),
        looks=len(times),
    )


def _known(motion: Motion) -> tuple[float, float]:
    """Times between which rates are of use: not near a singular end."""
    first, last = float(motion.times.min()), float(motion.times.max())
    share = _BEFORE_SINGULAR if motion.ending is Ending.SINGULAR else 1.0
    return first, first + share * (last - first)


def _moved(motion: Motion) -> Array:
    """By how much the spacecraft and the fastest joint move from node to node [rad, m]."""
    turned = angle_between(motion.attitudes[1:], motion.attitudes[:-1])
    return np.asarray(turned + np.abs(np.diff(motion.joints, axis=0)).max(axis=1))


def _window(motion: Motion, first: float, last: float) -> float:
    """Half the time over which to differentiate [s]: short where the system tumbles."""
    passed = np.abs(np.diff(motion.times))
    known = (motion.times[1:] <= last) & (motion.times[:-1] <= last) & (passed > 0.0)
    fastest = float((_moved(motion)[known] / passed[known]).max(initial=0.0))
    return min(_WINDOW * (last - first), _WINDOW_TURN / max(fastest, 1e-300))


def _looks(motion: Motion, first: float, last: float, window: float) -> list[tuple[float, float]]:
    """Times to differentiate at [s], and half the time over which to do so.

    Where pieces of the time law or of the path meet accelerations, or their slopes, jump: a look
    keeps to one side.
    """
    breaks = motion.problem.path.breaks
    edges = np.array([first, *breaks[(breaks > first) & (breaks < last)], last])
    found = []
    for t in np.linspace(first, last, _LOOKS).tolist():
        piece = min(int(np.searchsorted(edges, t, "right")), len(edges) - 1)
        low, high = float(edges[piece - 1]), float(edges[piece])
        half = min(window, _WITHIN * (high - low))
        found.append((float(np.clip(t, low + half, high - half)), half))
    return [look for look in found if look[1] > _SHORTEST * window] or found


def _differentiated(motion: Motion, t: float, window: float) -> tuple[Array, Array, Array]:
    """Position, attitude, joints at a time and their first two derivatives: a fit of samples."""
    places = chebyshev.chebpts1(_SAMPLES)
    states = motion.sample(t + window * places)
    rows = np.array([np.concatenate([s.base_position, s.attitude, s.joints]) for s in states])
    fit = chebyshev.chebfit(places, rows, _DEGREE)
    value, rate, bend = (
        np.asarray(chebyshev.chebval(0.0, chebyshev.chebder(fit, k)) / window**k) for k in range(3)
    )
    return value, rate, bend


def _off_path(motion: Motion, engine: Engine, t: float) -> float:
    """How far the end-effector is from its path where MuJoCo puts it [m]."""
    position, _ = engine.end_effector()
    rows = [row for row in motion.problem.task.rows if row < 3]
    return float(np.linalg.norm((position - motion.problem.path.pose(t).position)[rows]))


def forward_run(motion: Motion, engine: Engine) -> ForwardRun:
    """Let MuJoCo drift: servos turn the joints as recorded, nothing holds the spacecraft.

    A servo asks for the acceleration of the joints' spline, and more where they lag; the torques
    that give it to a free base come from MuJoCo's own mass matrix. Attitude and position are fed
    nowhere: where they end is the answer.

    Args:
        motion: The motion.
        engine: Of the same robot.
    """
    first, last = _known(motion)
    wanted_steps = max(
        _STEPS_PER_TURN * _moved(motion).sum(), _STEPS_PER_PIECE * len(motion.problem.path.breaks)
    )
    steps = int(np.clip(wanted_steps, _STEPS, _MOST_STEPS))
    nodes = np.linspace(first, last, round(_SPLINE * steps) + 1)
    _, _, rows = motion.evaluate(motion.parameter_at(nodes))
    wanted = CubicSpline(nodes, rows)
    h = (last - first) / steps
    stiff, damp = (_STIFFNESS / h) ** 2, 2.0 * _STIFFNESS / h
    _start(motion, engine, first, wanted(first, 1))
    engine.rest(h)
    data = engine.data
    for step in range(steps):
        t = first + (step + 0.5) * h
        M, bias = engine.inertia()
        ahead = data.qpos[7:] + h / 2.0 * data.qvel[6:]
        bend = wanted(t, 2) + damp * (wanted(t, 1) - data.qvel[6:]) + stiff * (wanted(t) - ahead)
        base = -np.linalg.solve(M[:6, :6], M[:6, 6:] @ bend + bias[:6])
        engine.step(M[6:, :6] @ base + M[6:, 6:] @ bend + bias[6:])
    (state,) = motion.sample(last)
    return ForwardRun(
        attitude=float(angle_between(np.roll(data.qpos[3:7], -1), state.attitude)),
        joints=float(np.abs(data.qpos[7:] - state.joints).max()),
        position=float(np.linalg.norm(data.qpos[:3] - state.base_position)),
        until=last,
        steps=steps,
    )


def _start(motion: Motion, engine: Engine, t: float, rates: Array) -> None:
    """Put the system where the motion begins, drifting with its momentum."""
    (state,) = motion.sample(t)
    A = momentum_map(motion.problem.model, state.joints, state.attitude)
    demanded = np.concatenate([np.zeros(3), motion.problem.momentum])
    twist = np.linalg.solve(A[:, :6], demanded - A[:, 6:] @ rates)
    data = engine.data
    data.qpos[:] = [*state.base_position, *np.roll(state.attitude, 1), *state.joints]
    data.qvel[:] = [*(rotation_matrix(state.attitude) @ twist[:3]), *twist[3:], *rates]
    data.qacc[:] = 0.0
