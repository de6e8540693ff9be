"""The certificate of a motion: its errors and margins, from recorded configurations alone.

It includes a second integration by an independent integrator: fixed steps in time, fourth order, on
the group of rotations itself (Munthe-Kaas 1998). The attitude is advanced by the exponential of a
rotation vector and needs no normalization. The main integrator takes adaptive steps of eighth order
along the arc length, in quaternions.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from freefloat.certificate.bounds import METHOD, Bounds, lower_bounds
from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.momentum import inertia_matrices
from freefloat.motion.extrema import closest_approach
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.panels import DEGREE, NODES, with_slopes
from freefloat.motion.residuals import path_errors
from freefloat.rotations import rotation_matrix
from freefloat.so3 import (
    Array,
    IntArray,
    rotated_in_body,
    rotation_vector_between,
    rotation_vector_rate,
    turned,
)

_INTEGRATOR = "Munthe-Kaas Runge-Kutta of fourth order on SO(3), fixed steps in time"
_BEFORE_SINGULAR, _MOMENT = 2, 1e-3
"""Number of panels before a singularity that are omitted, and part of the duration in which others
are, too: the rates by time have no bound there."""
_DIFFERENCE = 1e-6
"""Difference of attitude or joints [rad, m] by which rates are differentiated."""


@dataclass(frozen=True)
class CertifiedMinimum:
    """The smallest magnitude of a measure along a motion, and a proven lower bound.

    Attributes:
        measure: Its name.
        value: The smallest magnitude, by numerical search.
        time: Its time [s].
        bound: Lower bound of the magnitude everywhere; 0 where nothing is proven.
    """

    measure: str
    value: float
    time: float
    bound: float


@dataclass(frozen=True)
class Worst:
    """The largest of some errors along a motion.

    Attributes:
        value: The error.
        time: Its time [s].
    """

    value: float
    time: float


@dataclass(frozen=True)
class Comparison:
    """Differences between a motion and its second integration.

    Attributes:
        attitude: Largest angle between the attitudes [rad].
        attitude_time: Its time [s].
        joints: Largest difference of a joint [rad or m].
        joints_time: Its time [s].
        joint: Name of that joint.
        halving_attitude: Change of the last attitude when steps are halved [rad].
        halving_joints: Change of the last joint values [rad or m].
        steps: Number of the halved steps.
        until: Time at which the comparison ends [s].
    """

    attitude: float
    attitude_time: float
    joints: float
    joints_time: float
    joint: str
    halving_attitude: float
    halving_joints: float
    steps: int
    until: float


@dataclass(frozen=True)
class Certificate:
    """Margins and largest errors of a motion.

    Attributes:
        minima: Those of |det S*| (``gjm``), of the smallest singular value (``sigma``) and of the
            measure of the margin.
        method: Method of the proof of bounds.
        intervals: Number of intervals of the proof.
        end_effector_position: Distance from the path [m].
        end_effector_orientation: Angle from the path's orientation [rad]; None where the task
            leaves the orientation free.
        momentum: Deviation of the angular momentum from the prescribed one [N m s]; not evaluated
            where time nearly stands still, or in panels without motion.
        momentum_scale: Scale of that deviation [N m s]: the largest angular momentum of the arm
            on the path relative to the spacecraft, or the prescribed one if larger.
        rates: Joint rates differentiated from the panels' polynomials, minus those of (4), relative
            to the largest rate; not evaluated where time nearly stands still, or just before a
            singularity.
        integration: Comparison with a second integrator.
        integrator: Name of that integrator.
    """

    minima: tuple[CertifiedMinimum, ...]
    method: str
    intervals: int
    end_effector_position: Worst
    end_effector_orientation: Worst | None
    momentum: Worst
    momentum_scale: float
    rates: Worst
    integration: Comparison
    integrator: str = _INTEGRATOR

    def to_dict(self) -> dict[str, Any]:
        """The certificate as a JSON document."""
        keys = {"minima": "least", "end_effector_orientation": "end_effector_attitude"}
        document = {keys.get(name, name): value for name, value in asdict(self).items()}
        return {**document, "least": list(document["least"])}


def certify(motion: Motion) -> Certificate:
    """The certificate of a motion."""
    nodes = motion.node_coordinates
    u = np.sort(np.append(nodes, (nodes[:-1] + nodes[1:]) / 2.0))
    times, attitudes, joints = motion.evaluate(u)
    poses = path_errors(motion.problem, times, attitudes, joints)
    minima, intervals = _certified_minima(motion)
    return Certificate(
        minima=minima,
        method=METHOD,
        intervals=intervals,
        end_effector_position=_worst(poses[:, 0], times),
        end_effector_orientation=_worst(poses[:, 1], times)
        if motion.problem.task.prescribes_orientation
        else None,
        momentum=_worst(motion.momentum_errors(u), times),
        momentum_scale=_momentum_scale(motion),
        rates=_rate_errors(motion),
        integration=integrate_again(motion),
    )


def _worst(errors: Array, times: Array) -> Worst:
    """The largest of errors (K,); nan, where an error was not evaluated, is skipped."""
    known = np.where(np.isnan(errors), 0.0, errors)
    index = int(known.argmax())
    return Worst(float(known[index]), float(times[index]))


def _with_slopes(motion: Motion) -> tuple[IntArray, Array, Array]:
    """Panels (K,), states (K, 5 + n) and derivatives by time at nodes where time passes."""
    panel = np.repeat(np.arange(motion.panels), DEGREE + 1)
    moving, states, slopes = with_slopes(motion.coefficients, panel, np.tile(NODES, motion.panels))
    states[:, 1:5] /= np.linalg.norm(states[:, 1:5], axis=1, keepdims=True)
    return panel[moving], states, slopes


def _rate_errors(motion: Motion) -> Worst:
    """The largest of :attr:`Certificate.rates`."""
    problem = motion.problem
    panels, states, slopes = _with_slopes(motion)
    regular = panels < _regular_panels(motion)
    panels, states, slopes = panels[regular], states[regular], slopes[regular]
    fastest = float(np.abs(slopes[:, 5:]).max(initial=0.0))
    if not fastest:
        return Worst(0.0, float(motion.times[0]))
    prescribed = problem.prescribed(states[:, 0], motion.timing_segment(panels))
    _, exact = problem.resolved_rate_solver().rates(states[:, 1:5], states[:, 5:], *prescribed)
    return _worst(np.abs(slopes[:, 5:] - exact).max(axis=1) / fastest, states[:, 0])


def _regular_panels(motion: Motion) -> int:
    """Number of panels without those just before a singularity."""
    if motion.ending is not Ending.SINGULAR:
        return motion.panels
    left = motion.final.time - motion.times[:-1:DEGREE]
    before = int((left > _MOMENT * motion.problem.path.duration).sum())
    return max(0, min(before, motion.panels - _BEFORE_SINGULAR))


def _momentum_scale(motion: Motion) -> float:
    """See :attr:`Certificate.momentum_scale`."""
    scale, n = motion.problem.system.momentum_bound, motion.problem.model.arm_dof
    _, states, slopes = _with_slopes(motion)
    _, Dq = inertia_matrices(motion.problem.model, states[:, 5:])
    carried = turned(Dq[..., :n], slopes[:, 5 : 5 + n])
    return float(np.linalg.norm(carried, axis=1).max(initial=scale))


def _certified_minima(motion: Motion) -> tuple[tuple[CertifiedMinimum, ...], int]:
    """Smallest magnitudes of the measures with their bounds, and the number of intervals."""
    problem = motion.problem
    measures = {
        name: singularity_measure(problem.model, problem.task, name) for name in ("gjm", "sigma")
    }
    measures[problem.margin.measure.name] = problem.margin.measure
    approaches = [closest_approach(motion, measure) for measure in measures.values()]
    values = {approach.measure: approach.value for approach in approaches}
    bounds = Bounds(dict.fromkeys(values, 0.0), 0)
    if motion.ending is not Ending.SINGULAR and min(values.values()):
        bounds = lower_bounds(motion, values)
    return tuple(
        CertifiedMinimum(
            approach.measure, approach.value, approach.time, bounds.bounds[approach.measure]
        )
        for approach in approaches
    ), bounds.intervals


def integrate_again(motion: Motion) -> Comparison:
    """Integrate a motion from its first state with steps from node to node, whole and halved.

    The steps begin at the recorded nodes, all at once. Their errors are carried on to later nodes
    by the linearized equations, which errors far below one follow.

    Args:
        motion: The motion; of one that ends singular, the last panels are omitted.
    """
    panels = _regular_panels(motion)
    carried = _transitions(motion, panels)
    whole, halved = (_carried(carried, _step_errors(motion, panels, parts)) for parts in (1, 2))
    times = motion.times[: DEGREE * panels + 1]
    angles, differences = np.linalg.norm(halved[:, :3], axis=1), np.abs(halved[:, 3:])
    node, joint = np.unravel_index(int(differences.argmax()), differences.shape)
    change = halved[-1] - whole[-1]
    return Comparison(
        attitude=float(angles.max()),
        attitude_time=float(times[angles.argmax()]),
        joints=float(differences.max()),
        joints_time=float(times[node]),
        joint=motion.problem.model.joint_names[joint],
        halving_attitude=float(np.linalg.norm(change[:3])),
        halving_joints=float(np.abs(change[3:]).max()),
        steps=2 * DEGREE * panels,
        until=float(times[-1]),
    )


def _carried(transitions: Array, errors: Array) -> Array:
    """Errors at the nodes (N, 3 + n) that errors of the steps between them add up to."""
    total = [np.zeros(transitions.shape[2])]
    for transition, error in zip(transitions, errors, strict=True):
        total.append(transition @ total[-1] + error)
    return np.array(total)


def _step_errors(motion: Motion, panels: int, parts: int) -> Array:
    """Errors of every node when ``parts`` steps lead to it from the node before, (N - 1, 3 + n).

    They are rotation vectors of the spacecraft in its own axes and differences of joints.
    """
    problem, last = motion.problem, DEGREE * panels
    solver = problem.resolved_rate_solver()
    segments = np.repeat(motion.timing_segment(np.arange(panels)), DEGREE)
    h = np.diff(motion.times[: last + 1])[:, None] / parts
    attitudes = motion.attitudes[:last]
    z = np.hstack([np.zeros((last, 3)), motion.joints[:last]])

    def rates(part: float, z: Array) -> Array:
        """Rates of z: the rotation vector (the exponential's derivative inverted) and joints."""
        prescribed = problem.prescribed(motion.times[:last] + part * h[:, 0], segments)
        states = rotated_in_body(attitudes, z[:, :3])
        omega, joint_rates = solver.rates(states, z[:, 3:], *prescribed)
        return np.hstack([rotation_vector_rate(z[:, :3], omega), joint_rates])

    for part in range(parts):
        k1 = rates(part, z)
        k2 = rates(part + 0.5, z + h / 2.0 * k1)
        k3 = rates(part + 0.5, z + h / 2.0 * k2)
        k4 = rates(part + 1.0, z + h * k3)
        z = z + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        attitudes, z[:, :3] = rotated_in_body(attitudes, z[:, :3]), 0.0
    recorded = slice(1, last + 1)
    turns = rotation_vector_between(*map(rotation_matrix, (motion.attitudes[recorded], attitudes)))
    turns = turned(rotation_matrix(attitudes).swapaxes(1, 2), turns)
    return np.hstack([turns, z[:, 3:] - motion.joints[recorded]])


def _transitions(motion: Motion, panels: int) -> Array:
    """Derivatives of the errors at nodes by those at the nodes before, shape (N - 1, d, d).

    They follow from the derivatives F of the rates by the errors: (1 - h F / 2)^-1 (1 + h F / 2).
    """
    problem, count = motion.problem, DEGREE * panels + 1
    times, attitudes, joints = (x[:count] for x in (motion.times, motion.attitudes, motion.joints))
    n, base = joints.shape[1], np.zeros((1, 3 + joints.shape[1]))
    moved = np.concatenate([base, _DIFFERENCE * np.eye(3 + n)])
    moved = np.repeat(moved, count, axis=0)
    attitudes = rotated_in_body(np.tile(attitudes, (4 + n, 1)), moved[:, :3])
    joints = np.tile(joints, (4 + n, 1)) + moved[:, 3:]
    prescribed = problem.prescribed(np.tile(times, 4 + n))
    solved = problem.resolved_rate_solver().rates(attitudes, joints, *prescribed)
    rates = np.hstack(solved).reshape(4 + n, count, 3 + n)
    F = np.moveaxis((rates[1:] - rates[0]) / _DIFFERENCE, 0, -1)
    F[:, :3, :3] -= np.cross(np.eye(3), rates[0, :, None, :3])
    half = np.diff(times)[:, None, None] / 4.0 * (F[1:] + F[:-1])
    return np.asarray(np.linalg.solve(np.eye(3 + n) - half, np.eye(3 + n) + half))
