"""Reach and areas of any arm by sampling its joint space."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from freefloat.dynamics.measures import (
    SingularityMeasure,
    joint_box,
    joint_space_extremes,
    singularity_measure,
)
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, low_discrepancy
from freefloat.workspace.margin_curves import Interval, Workspace, complement, merged

_LINES = 1024
_STEPS = 32
_ENDS = 4
_EXTENSION = 5.0
"""An end that moves by more gaps than this has left its area for another."""
_GAP = 0.01
"""Singular radii closer than this fraction of the reach belong to one area; narrower gaps are
ignored."""


def sampled_workspace(problem: Problem) -> Workspace:
    """Reach and areas of the end-effector from samples of the joint space.

    One joint at a time sweeps its range from many configurations. Between samples of different
    sign, the root of det S* is solved for; the ends of the areas are then extended along the
    singular surface by optimization. The areas of redundant arms, whose measure has no sign, are
    unknown.

    Raises:
        InputError: If a prismatic joint has no limits.
    """
    measure = singularity_measure(problem.model, problem.task, "gjm")
    reach = _reach(problem)
    extremes = joint_space_extremes(problem.model, measure)
    dependent, independent = None, None
    if not problem.redundant:
        dependent = _areas(problem, measure, extremes.magnitude, _GAP * reach[1])
        rest = complement(dependent, reach)
        independent = tuple(gap for gap in rest if gap[1] - gap[0] > _GAP * reach[1])
    return Workspace(
        point="end-effector",
        tip=np.zeros(3),
        measure=measure.name,
        reach=reach,
        path_dependent=dependent,
        path_independent=independent,
        exact=False,
        largest_s=extremes.largest,
        smallest_s=extremes.smallest,
    )


def _distance(problem: Problem, joints: Array) -> float:
    """Distance of the end-effector from the centre of mass, in the plane for planar tasks [m]."""
    position = problem.model.end_effector_pose((0.0, 0.0, 0.0, 1.0), joints).position
    return float(np.linalg.norm(position[:2] if problem.task.planar else position))


def _reach(problem: Problem) -> Interval:
    squared = SingularityMeasure("reach", "", "m^2", lambda joints: _distance(problem, joints) ** 2)
    extremes = joint_space_extremes(problem.model, squared)
    return float(np.sqrt(max(extremes.smallest, 0.0))), float(np.sqrt(extremes.largest))


def _areas(
    problem: Problem, measure: SingularityMeasure, scale: float, gap: float
) -> tuple[Interval, ...]:
    singular = singular_configurations(problem, measure)
    if len(singular) == 0:
        return ()
    radii = np.array([_distance(problem, joints) for joints in singular])
    order = np.argsort(radii)
    singular, radii = singular[order], radii[order]
    breaks = np.flatnonzero(np.diff(radii) > gap) + 1
    areas = []
    for first, last in zip([0, *breaks], [*breaks, len(radii)], strict=True):
        extend = partial(_extended, problem, measure, scale)
        down = np.array([extend(joints, 1.0) for joints in singular[first:last][:_ENDS]])
        up = np.array([extend(joints, -1.0) for joints in singular[first:last][-_ENDS:]])
        inner = max(radii[first] - _EXTENSION * gap, radii[first - 1] if first else -1.0)
        outer = min(
            radii[last - 1] + _EXTENSION * gap, radii[last] if last < len(radii) else np.inf
        )
        low = np.min(down[down > inner], initial=radii[first])
        high = np.max(up[up < outer], initial=radii[last - 1])
        areas.append((float(low), float(high)))
    return merged(areas, 1e-3 * gap)


def singular_configurations(problem: Problem, measure: SingularityMeasure) -> Array:
    """Joints at which a measure changes its sign along one joint, shape (K, n)."""
    lower, upper = joint_box(problem.model)
    n = problem.model.dof
    singular = []
    for number, fraction in enumerate(low_discrepancy(_LINES, n)):
        joints, moving = lower + (upper - lower) * fraction, number % n

        def along(value: float, joints: Array = joints, moving: int = moving) -> float:
            joints = joints.copy()
            joints[moving] = value
            return measure(joints)

        for root in _roots(along, np.linspace(lower[moving], upper[moving], _STEPS + 1)):
            joints[moving] = root
            singular.append(joints.copy())
    return np.array(singular).reshape(-1, n)


def _roots(function: Callable[[float], float], samples: Array) -> list[float]:
    from scipy.optimize import brentq

    values = np.array([function(value) for value in samples.tolist()])
    changes = np.flatnonzero(np.sign(values[1:]) * np.sign(values[:-1]) < 0.0)
    return [float(brentq(function, samples[i], samples[i + 1], xtol=1e-10)) for i in changes]


def _extended(
    problem: Problem, measure: SingularityMeasure, scale: float, joints: Array, sense: float
) -> float:
    """Smallest (sense 1) or largest (-1) radius nearby on the singular surface [m]."""
    from scipy.optimize import minimize

    lower, upper = joint_box(problem.model)
    prismatic = [body.prismatic for body in problem.model.bodies[1:]]
    bounds = [
        (low, high) if bounded else (None, None)
        for low, high, bounded in zip(lower, upper, prismatic, strict=True)
    ]
    end = minimize(
        lambda q: sense * _distance(problem, q) ** 2, joints, method="SLSQP", bounds=bounds,
        constraints={"type": "eq", "fun": lambda q: measure(q) / scale},
        options={"ftol": 1e-12, "maxiter": 100},
    )  # fmt: skip
    singular = abs(measure(end.x)) < 1e-8 * scale
    return _distance(problem, end.x if singular else joints)
