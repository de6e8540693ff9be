"""Motions repeated with MuJoCo: inverse dynamics, forward simulations with joint servos, checks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.polynomial import chebyshev

from freefloat.beyond.engines.mujoco_model import MuJoCoModel
from freefloat.dynamics.momentum import inertia_matrices
from freefloat.motion.motion import Ending, Motion
from freefloat.rotations import rotation_matrix
from freefloat.so3 import Array, angle_between
from freefloat.verification.check import EngineRuns
from freefloat.verification.comparisons import Check, error_check, path_tolerances

_INSTANTS = 61
_SAMPLES_AROUND = 15
"""Samples around an instant."""
_DEGREE = 6
"""Degree of the polynomials fitted to them."""
_WINDOW = 5e-3
"""Half the time over which a motion is differentiated, as a fraction of its duration."""
_WINDOW_ANGLE = 0.1
"""Largest displacement in that time [rad, m]."""
_WITHIN = 0.49
"""Half the time of differentiation as a fraction of a smooth segment, at most."""
_SHORTEST = 0.02
"""Fraction of that time that suffices for derivatives."""
_WRENCH = 1e-4
"""Allowed wrench on the base as a fraction of the largest torque."""
_ADDED_WRENCH = 1e-9
"""Wrench added to what is allowed, as a fraction of I / T² (I: trace of the system's inertia, T:
duration): rounding, for arms that hardly move."""
_MOMENTUM = 1e-6
"""Allowed deviation of MuJoCo's momentum, as a fraction of |h| + I / T."""
_DRIFT = 1e-3
"""Allowed deviation of the final attitude of a simulation [rad]."""
_FINER = 4
"""Factor on the steps of a simulation whose final attitude deviates too much."""
_STIFFNESS = 0.2
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
class InverseRun:
    """Inverse dynamics along the recorded motion."""

    wrench: float  # largest moment on the base, forces times the reach of the arm [N m]
    wrench_time: float  # [s]
    torque: float  # largest joint torque [N m or N]
    momentum: float  # largest deviation of the angular momentum [N m s]
    end_effector: float  # largest distance of the end-effector from its path [m]
    looks: int  # instants


@dataclass(frozen=True)
class ForwardRun:
    """End of an engine's own integration, with joint servos that follow the recorded joints."""

    attitude: float  # angle of the spacecraft from the recorded attitude at the end [rad]
    joints: float  # largest difference of a joint at the end [rad or m]
    position: float  # distance of the spacecraft from its recorded position [m]
    until: float  # time of the end [s]
    steps: int


def inverse_run(motion: Motion, engine: MuJoCoModel) -> InverseRun:
    """Inverse dynamics of the recorded positions, differentiated twice."""
    first, last = _known_span(motion)
    problem, window = motion.problem, _window(motion, first, last)
    reach = problem.reach()
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


def _known_span(motion: Motion) -> tuple[float, float]:
    """First and last time at which rates are bounded: not near a singular end."""
    first, last = float(motion.times.min()), float(motion.times.max())
    fraction = _BEFORE_SINGULAR if motion.ending is Ending.SINGULAR else 1.0
    return first, first + fraction * (last - first)


def _displacements(motion: Motion) -> Array:
    """Displacement of the spacecraft and the fastest joint between nodes [rad, m]."""
    rotated = angle_between(motion.attitudes[1:], motion.attitudes[:-1])
    return np.asarray(rotated + np.abs(np.diff(motion.joints, axis=0)).max(axis=1))


def _window(motion: Motion, first: float, last: float) -> float:
    """Half the time over which to differentiate [s], short if the system tumbles."""
    passed = np.abs(np.diff(motion.times))
    known = (motion.times[1:] <= last) & (motion.times[:-1] <= last) & (passed > 0.0)
    fastest = float((_displacements(motion)[known] / passed[known]).max(initial=0.0))
    return min(_WINDOW * (last - first), _WINDOW_ANGLE / max(fastest, 1e-300))


def _instants(
    motion: Motion, first: float, last: float, window: float
) -> list[tuple[float, float]]:
    """Instants [s], and half the time over which to differentiate there.

    Accelerations, or their slopes, jump where segments of the time law or of the path meet; an
    instant keeps to one segment.
    """
    breaks = motion.problem.breaks
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

    The position is the spacecraft's position in the frame of the path.
    """
    places = chebyshev.chebpts1(_SAMPLES_AROUND)
    states = motion.sample(t + window * places)
    drift = motion.setting.drift
    rows = np.array([
        np.concatenate([s.base_position + s.time * drift, s.attitude, s.joints]) for s in states
    ])  # fmt: skip
    fit = chebyshev.chebfit(places, rows, _DEGREE)
    value, rate, acceleration = (
        np.asarray(chebyshev.chebval(0.0, chebyshev.chebder(fit, k)) / window**k) for k in range(3)
    )
    return value, rate, acceleration


def _off_path(motion: Motion, engine: MuJoCoModel, t: float) -> float:
    """Largest distance of MuJoCo's end-effectors from their paths [m]."""
    rows = [row for row in motion.setting.task.rows if row < 3]
    places = [path.path.curve(path.timing.s(t)) for path in motion.problem.path.by_arm.values()]
    offsets = engine.end_effector_positions() - np.array(places)
    if motion.setting.has_headings:
        offsets = motion.setting.plane.seen(offsets)
    return float(np.linalg.norm(offsets[:, rows], axis=1).max())


def forward_run(motion: Motion, engine: MuJoCoModel, *, steps: int | None = None) -> ForwardRun:
    """Simulate a free base with joint servos that follow the recorded joints.

    The servos are computed-torque controllers on MuJoCo's own mass matrix. Attitude and position of
    the spacecraft are not controlled: their deviations at the end are the result. The number of
    steps follows from the length of the motion unless it is given.
    """
    first, last = _known_span(motion)
    if steps is None:
        needed = _STEPS_PER_RADIAN * _displacements(motion).sum()
        needed = max(needed, _STEPS_PER_SEGMENT * len(motion.problem.breaks))
        steps = int(np.clip(needed, _FEWEST_STEPS, _MAX_STEPS))
    nodes = np.linspace(first, last, round(_SPLINE * steps) + 1)
    _, _, rows = motion.evaluate(motion.coordinates_at(nodes))
    followed = scipy.interpolate.CubicSpline(nodes, rows)
    h, data = (last - first) / steps, engine.data
    b, n = engine.base_rates, motion.model.dof
    stiff, damp = (_STIFFNESS / h) ** 2, 2.0 * _STIFFNESS / h
    start(motion, engine, first, followed(first, 1))
    engine.rest(h)
    for step in range(steps):
        t = first + (step + 0.5) * h
        M, bias = engine.inertia()
        ahead = data.qpos[-n:] + h / 2.0 * data.qvel[b:]
        acceleration = (
            followed(t, 2) + damp * (followed(t, 1) - data.qvel[b:]) + stiff * (followed(t) - ahead)
        )
        base = -np.linalg.solve(M[:b, :b], M[:b, b:] @ acceleration + bias[:b])
        engine.step(M[b:, :b] @ base + M[b:, b:] @ acceleration + bias[b:])
    (recorded,) = motion.sample(last)
    position = engine.base_position - last * motion.setting.drift
    return ForwardRun(
        attitude=float(angle_between(engine.attitude, recorded.attitude)),
        joints=float(np.abs(data.qpos[-n:] - recorded.joints).max()),
        position=float(np.linalg.norm(position - recorded.base_position)),
        until=last,
        steps=steps,
    )


def start(motion: Motion, engine: MuJoCoModel, t: float, rates: Array) -> None:
    """Set the state of a motion at a time [s], in the frame of the path, with joint rates (n,).

    The robot has the engine's momentum.
    """
    (state,), data, system = motion.sample(t), engine.data, engine.system
    position = state.base_position + t * motion.setting.drift
    engine.set_positions(position, state.attitude, state.joints)
    twist = system.base_twist(state.attitude, state.joints, rates)
    velocity = np.concatenate([rotation_matrix(state.attitude) @ twist[:3], twist[3:]])
    engine.set_rates(data.qvel, velocity, rates)
    data.qacc[:] = 0.0


class MuJoCo:
    """MuJoCo as the engine that repeats motions."""

    def repeated(self, motion: Motion) -> EngineRuns:
        """See :class:`~freefloat.verification.check.Engine`."""
        robot = MuJoCoModel(motion.setting.system)
        inverse, forward = inverse_run(motion, robot), forward_run(motion, robot)
        checks = *_inverse_checks(motion, inverse), _attitude_check(forward, _DRIFT)
        return EngineRuns(inverse, forward, checks)

    def simulated(self, motion: Motion, steps: int, allowed: float) -> Iterator[Check]:
        """See :class:`~freefloat.verification.check.Engine`.

        A deviation that is too large is computed with more steps: errors of the servos become
        smaller then, errors of the motion do not.
        """
        robot = MuJoCoModel(motion.setting.system)
        run = forward_run(motion, robot, steps=steps)
        if run.attitude > allowed:
            run = forward_run(motion, robot, steps=_FINER * steps)
        yield _attitude_check(run, allowed)


def _inverse_checks(motion: Motion, inverse: InverseRun) -> Iterator[Check]:
    problem = motion.problem
    duration = problem.path.duration
    inertia = float(np.trace(inertia_matrices(problem.model, motion.initial.joints)[0]))
    momentum = _MOMENTUM * (float(np.linalg.norm(problem.momentum)) + inertia / duration)
    wrench = _WRENCH * inverse.torque + _ADDED_WRENCH * inertia / duration**2
    place = path_tolerances(motion)[0]
    yield error_check("mujoco: end-effector position", inverse.end_effector, place, "m", None)
    yield error_check("mujoco: angular momentum", inverse.momentum, momentum, "N m s", None)
    words = "inverse dynamics has a wrench on the free base"
    at = inverse.wrench_time
    yield error_check("mujoco: wrench on the base", inverse.wrench, wrench, "N m", at, words)


def _attitude_check(run: ForwardRun, allowed: float) -> Check:
    words = "with joint servos the final attitude differs"
    return error_check("mujoco: final attitude", run.attitude, allowed, "rad", run.until, words)
