"""The certificate of a motion: its errors and margins, from recorded configurations alone.

It includes a second integration by the reference engine: Pinocchio's matrices and SciPy's method of
eighth order, with a stricter tolerance. The kernels' motions come from other kinematics, and from
another method, of fifth order.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from freefloat.certificate.bounds import METHOD, Bounds, lower_bounds
from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.momentum import inertia_matrices
from freefloat.motion.extrema import closest_approach
from freefloat.motion.integration import motion_from
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.panels import DEGREE, NODES, with_slopes
from freefloat.motion.residuals import path_errors
from freefloat.so3 import Array, IntArray, angle_between, turned

_INTEGRATOR = "Pinocchio and SciPy's DOP853"
_TOLERANCE = 1e-11
_BEFORE_SINGULAR, _MOMENT = 2, 1e-3
"""Number of panels before a singularity that are omitted, and part of the duration in which others
are, too: the rates by time have no bound there."""


@dataclass(frozen=True)
class CertifiedMinimum:
    """The smallest magnitude of a measure along a motion, and a proven lower bound.

    Attributes:
        measure: Name of the measure.
        value: The smallest magnitude, by numerical search.
        time: Time of the smallest magnitude [s].
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
        time: Time of the error [s].
    """

    value: float
    time: float


@dataclass(frozen=True)
class SecondIntegration:
    """Differences between a motion and its second integration.

    Attributes:
        attitude: Largest angle between the attitudes [rad].
        attitude_time: Time of the largest angle [s].
        joints: Largest difference of a joint [rad or m].
        joints_time: Time of the largest difference [s].
        joint: Name of that joint.
        until: Time at which the comparison ends [s].
    """

    attitude: float
    attitude_time: float
    joints: float
    joints_time: float
    joint: str
    until: float


@dataclass(frozen=True)
class Certificate:
    """Margins and largest errors of a motion.

    Attributes:
        minima: Minima of |det S*| (``gjm``), of the smallest singular value (``sigma``) and of the
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
        rates: Joint rates differentiated from the panels' polynomials, minus rates of (4), relative
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
    integration: SecondIntegration
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
        if motion.setting.task.prescribes_orientation
        else None,
        momentum=_worst(motion.momentum_errors(u), times),
        momentum_scale=momentum_scale(motion),
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
    """Number of panels except the panels just before a singularity."""
    if motion.ending is not Ending.SINGULAR:
        return motion.panels
    left = motion.final.time - motion.times[:-1:DEGREE]
    before = int((left > _MOMENT * motion.law.timing.duration).sum())
    return max(0, min(before, motion.panels - _BEFORE_SINGULAR))


def momentum_scale(motion: Motion) -> float:
    """See :attr:`Certificate.momentum_scale`."""
    scale, n = motion.setting.system.momentum_bound, motion.setting.dof
    _, states, slopes = _with_slopes(motion)
    _, Dq = inertia_matrices(motion.model, states[:, 5:])
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


def integrate_again(motion: Motion) -> SecondIntegration:
    """Compare a motion, but its last panels before a singularity, with the reference engine's."""
    count = DEGREE * _regular_panels(motion) + 1
    times, first = motion.times[:count], motion.initial
    node = np.concatenate([times[:1], first.attitude, first.joints])
    again = motion_from(motion.problem, node, float(times[-1]), _TOLERANCE)
    known = np.clip(times, *sorted((times[0], again.times[-1])))
    _, attitudes, joints = again.evaluate(again.coordinates_at(known))
    angles = angle_between(attitudes, motion.attitudes[:count])
    differences = np.abs(joints - motion.joints[:count])
    latest, joint = np.unravel_index(int(differences.argmax()), differences.shape)
    return SecondIntegration(
        attitude=float(angles.max()),
        attitude_time=float(times[angles.argmax()]),
        joints=float(differences.max()),
        joints_time=float(times[latest]),
        joint=motion.model.joint_names[joint],
        until=float(times[-1]),
    )
