"""The certificate of a motion: its errors and margins, from recorded configurations alone.

It includes a second integration by an independent integrator: fixed steps in time, fourth order, on
the group of rotations itself (Munthe-Kaas 1998). The attitude is advanced by the exponential of a
rotation vector and needs no normalization. The main integrator takes adaptive steps of eighth order
along the arc length, in quaternions.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from freefloat.certificate.bounds import METHOD, Bounds, lower_bounds
from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.momentum import inertia_matrices
from freefloat.motion.extrema import closest_approach
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.panels import DEGREE, NODES, with_slopes
from freefloat.motion.problem import Prescribed
from freefloat.motion.residuals import path_errors
from freefloat.so3 import Array, IntArray, angle_between, rotated_in_body, rotation_vector_rate

_INTEGRATOR = "Munthe-Kaas Runge-Kutta of fourth order on SO(3), fixed steps in time"
_BEFORE_SINGULAR, _MOMENT = 2, 1e-3
"""Number of panels before a singularity that are omitted, and part of the duration in which others
are, too: the rates by time have no bound there."""


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
    solver = problem.resolved_rate_solver()
    segments = [motion.timing_segment(panel) for panel in range(motion.panels)]
    panels, states, slopes = _with_slopes(motion)
    regular = panels < _regular_panels(motion)
    panels, states, slopes = panels[regular], states[regular], slopes[regular]
    fastest = float(np.abs(slopes[:, 5:]).max(initial=0.0))
    if not fastest:
        return Worst(0.0, float(motion.times[0]))
    exact = []
    for panel, state in zip(panels, states, strict=True):
        prescribed = problem.prescribed(float(state[0]), segments[panel])
        exact.append(solver.rates(state[1:5], state[5:], *prescribed)[1])
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
    for joints, rates in zip(states[:, 5:], slopes[:, 5:], strict=True):
        _, Dq = inertia_matrices(motion.problem.model, joints)
        scale = max(scale, float(np.linalg.norm(Dq[:, :n] @ rates[:n])))
    return scale


def _certified_minima(motion: Motion) -> tuple[tuple[CertifiedMinimum, ...], int]:
    """Smallest magnitudes of the measures with their bounds, and the number of intervals."""
    problem = motion.problem
    names = dict.fromkeys(("gjm", "sigma", problem.margin.measure.name))
    approaches = [
        closest_approach(motion, singularity_measure(problem.model, problem.task, name))
        for name in names
    ]
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

    Args:
        motion: The motion; of one that ends singular, the last panels are omitted.
    """
    panels = _regular_panels(motion)
    whole = _integrated(motion, panels, 1)
    attitudes, joints = _integrated(motion, panels, 2)
    nodes = slice(0, DEGREE * panels + 1)
    times = motion.times[nodes]
    angles = angle_between(attitudes, motion.attitudes[nodes])
    differences = np.abs(joints - motion.joints[nodes])
    node, joint = np.unravel_index(int(differences.argmax()), differences.shape)
    return Comparison(
        attitude=float(angles.max()),
        attitude_time=float(times[angles.argmax()]),
        joints=float(differences.max()),
        joints_time=float(times[node]),
        joint=motion.problem.model.joint_names[joint],
        halving_attitude=float(angle_between(attitudes[-1], whole[0][-1])),
        halving_joints=float(np.abs(joints[-1] - whole[1][-1]).max()),
        steps=2 * DEGREE * panels,
        until=float(times[-1]),
    )


def _integrated(motion: Motion, panels: int, parts: int) -> tuple[Array, Array]:
    """Attitudes (N, 4) and joints (N, n) at the nodes, with ``parts`` steps between nodes."""
    problem = motion.problem
    solver = problem.resolved_rate_solver()

    def rates(attitude: Array, z: Array, prescribed: Prescribed) -> Array:
        """Rates of z: the rotation vector (the exponential's derivative inverted) and joints."""
        omega, joint_rates = solver.rates(rotated_in_body(attitude, z[:3]), z[3:], *prescribed)
        return np.concatenate([rotation_vector_rate(z[:3], omega), joint_rates])

    attitudes, joints = [motion.attitudes[0]], [motion.joints[0]]
    for panel in range(panels):
        nodes = motion.times[DEGREE * panel : DEGREE * (panel + 1) + 1]
        segment = motion.timing_segment(panel)
        last = problem.prescribed(float(nodes[0]), segment)
        for start, end in pairwise(nodes.tolist()):
            h = (end - start) / parts
            attitude = attitudes[-1]
            z = np.append(np.zeros(3), joints[-1])
            for part in range(parts):
                t = start + part * h
                before, middle = last, problem.prescribed(t + h / 2.0, segment)
                last = problem.prescribed(t + h, segment)
                k1 = np.concatenate(solver.rates(attitude, z[3:], *before))
                k2 = rates(attitude, z + h / 2.0 * k1, middle)
                k3 = rates(attitude, z + h / 2.0 * k2, middle)
                k4 = rates(attitude, z + h * k3, last)
                z = z + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
                attitude, z[:3] = rotated_in_body(attitude, z[:3]), 0.0
            attitudes.append(attitude)
            joints.append(z[3:])
    return np.array(attitudes), np.array(joints)
