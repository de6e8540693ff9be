"""The certificate of a motion: what can be told of it from its recorded configurations alone."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.momentum import inertia_matrices
from freefloat.motion.bounds import METHOD, lower_bounds
from freefloat.motion.closest_approach import closest_approach
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.panels import NODES
from freefloat.motion.second_integration import NAME, Comparison, follow_again
from freefloat.so3 import Array, rotation_vector_between

_NEARLY_STILL = 1e-2
"""Where time passes slower than this share of its pace in the panel, no rates are formed."""


@dataclass(frozen=True)
class Proven:
    """The least magnitude of a measure along a motion, and what it keeps between all points.

    Attributes:
        measure: Its name.
        value: The least magnitude found.
        time: When [s].
        bound: The magnitude is proven to be at least this everywhere; 0 where nothing is proven.
    """

    measure: str
    value: float
    time: float
    bound: float


@dataclass(frozen=True)
class Worst:
    """The largest of some errors along a motion.

    Attributes:
        value: How large.
        time: When [s].
    """

    value: float
    time: float


@dataclass(frozen=True)
class Certificate:
    """What was found of a motion; errors are largest magnitudes, zero is perfect.

    Attributes:
        least: |det S*| (``gjm``), the smallest singular value (``sigma``) and the margin's measure.
        method: How the bounds were found.
        intervals: How many it took.
        end_effector_position: Distance from the path [m].
        end_effector_attitude: Angle from the path's attitude [rad]; None where that is left free.
        momentum: Deviation of the angular momentum from the one given [N m s].
        momentum_scale: The largest angular momentum of the arm's own motion, or the one given
            [N m s]: with this the deviation is to be compared.
        centre_of_mass: Its distance from where it must stay [m].
        rates: Recorded joint rates less those of (4), in units of the largest.
        integration: The motion beside itself, followed by another integrator.
        integrator: Which one.
    """

    least: tuple[Proven, ...]
    method: str
    intervals: int
    end_effector_position: Worst
    end_effector_attitude: Worst | None
    momentum: Worst
    momentum_scale: float
    centre_of_mass: Worst
    rates: Worst
    integration: Comparison
    integrator: str = NAME

    def of(self, name: str) -> Proven:
        """What was found of a measure."""
        return next(one for one in self.least if one.measure == name)

    def to_dict(self) -> dict[str, Any]:
        """The certificate as a JSON document."""
        return {**asdict(self), "least": [asdict(one) for one in self.least]}


def certify(motion: Motion, base_positions: Array | None = None) -> Certificate:
    """Find what can be told of a motion from what is recorded of it.

    Args:
        motion: The motion.
        base_positions: Those recorded [m], shape (N, 3); the motion's own when left out.
    """
    places = np.sort(np.append(motion.node_parameters, _between(motion.node_parameters)))
    times, attitudes, joints = motion.evaluate(places)
    states = zip(times.tolist(), attitudes, joints, strict=True)
    poses = np.array([_pose_errors(motion, *state) for state in states])
    recorded = motion.base_positions if base_positions is None else base_positions
    base_position = motion.problem.model.base_position  # that keeps the centre of mass
    nodes = zip(recorded, motion.attitudes, motion.joints, strict=True)
    drift = [np.linalg.norm(place - base_position(*state)) for place, *state in nodes]
    rates, scale = _rate_errors(motion)
    proven, intervals = _least(motion)
    return Certificate(
        least=proven,
        method=METHOD,
        intervals=intervals,
        end_effector_position=_worst(poses[:, 0], times),
        end_effector_attitude=_worst(poses[:, 1], times)
        if motion.problem.task.prescribes_orientation
        else None,
        momentum=_worst(motion.momentum_errors(places), times),
        momentum_scale=scale,
        centre_of_mass=_worst(np.array(drift), motion.times),
        rates=rates,
        integration=follow_again(motion),
    )


def _between(places: Array) -> Array:
    return np.asarray((places[:-1] + places[1:]) / 2.0)


def _worst(errors: Array, times: Array) -> Worst:
    """The largest of errors (K,); what is not known does not count."""
    known = np.where(np.isnan(errors), 0.0, errors)
    place = int(known.argmax())
    return Worst(float(known[place]), float(times[place]))


def _pose_errors(motion: Motion, t: float, attitude: Array, joints: Array) -> tuple[float, float]:
    problem = motion.problem
    rows, wanted = problem.task.rows, problem.path.pose(t)
    found = problem.model.end_effector_pose(attitude, joints)
    off = (found.position - wanted.position)[[row for row in rows if row < 3]]
    turn = rotation_vector_between(found.rotation, wanted.rotation)[
        [row - 3 for row in rows if row > 2]
    ]
    return float(np.linalg.norm(off)), float(np.linalg.norm(turn))


def _rate_errors(motion: Motion) -> tuple[Worst, float]:
    """Joint rates of the record beside those of (4), and the scale of momentum [N m s]."""
    problem, found, times = motion.problem, [], []
    equation, fastest = problem.resolved_rate_solver(), 0.0
    scale = float(np.linalg.norm(problem.momentum))
    for panel in range(motion.panels):
        c = motion.coefficients[panel]
        slope = chebyshev.chebder(c)
        paces = np.abs(chebyshev.chebval(NODES, slope[:, 0]))
        for x in NODES[paces > _NEARLY_STILL * paces.max()]:
            value, change = chebyshev.chebval(x, c), chebyshev.chebval(x, slope)
            attitude = value[1:5] / np.linalg.norm(value[1:5])
            piece = problem.path.timing.segment_at(float(chebyshev.chebval(0.0, c[:, 0])))
            wish = problem.path.twist_and_speed(float(value[0]), piece)
            rates = change[5:] / change[0]
            right = equation.rates(attitude, value[5:], *wish)[1]
            fastest = max(fastest, float(np.abs(rates).max()))
            _, Dq = inertia_matrices(problem.model, value[5:])
            scale = max(scale, float(np.linalg.norm(Dq @ rates)))
            found.append(float(np.abs(rates - right).max()))
            times.append(float(value[0]))
    if not fastest:
        return Worst(0.0, float(motion.times[0])), scale
    return _worst(np.array(found) / fastest, np.array(times)), scale


def _least(motion: Motion) -> tuple[tuple[Proven, ...], int]:
    problem = motion.problem
    names = dict.fromkeys(("gjm", "sigma", problem.margin.measure.name))
    found = [
        closest_approach(motion, singularity_measure(problem.model, problem.task, name))
        for name in names
    ]
    values = {one.measure: one.value for one in found}
    if motion.ending is Ending.SINGULAR or not min(values.values()):
        proven, intervals = dict.fromkeys(values, 0.0), 0
    else:
        bounds = lower_bounds(motion, values)
        proven, intervals = dict(bounds.bounds), bounds.intervals
    return tuple(
        Proven(one.measure, one.value, one.time, proven[one.measure]) for one in found
    ), intervals
