"""Reach and areas of any arm by sampling its joint space, where no form in two angles is known."""

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
_PUSH = 5.0
"""An end pushed by more gaps than these has left its area for another."""
_GAP = 0.01
"""Singular radii nearer than this share of the reach are taken for one area, and narrower rests for
none."""


def sampled_workspace(problem: Problem) -> Workspace:
    """Reach and areas of the end-effector, as far as a search of the joint space finds them.

    The joints sweep their ranges one at a time from many configurations. Where det S* changes its
    sign it vanishes in between, which is solved for; the ends of the areas so found are then pushed
    as far as they go. For arms with more joints than the task needs nothing changes sign: their
    areas are left open.

    Raises:
        InputError: If a joint slides without limits.
    """
    of = singularity_measure(problem.model, problem.task, "gjm")
    reach = _reach(problem)
    extremes = joint_space_extremes(problem.model, of)
    dependent, independent = None, None
    if not problem.redundant:
        dependent = _areas(problem, of, extremes.magnitude, _GAP * reach[1])
        rest = complement(dependent, reach)
        independent = tuple(one for one in rest if one[1] - one[0] > _GAP * reach[1])
    return Workspace(
        point="end-effector",
        tip=np.zeros(3),
        measure=of.name,
        reach=reach,
        path_dependent=dependent,
        path_independent=independent,
        exact=False,
        largest_s=extremes.largest,
        smallest_s=extremes.smallest,
    )


def _distance(problem: Problem, joints: Array) -> float:
    """Of the end-effector from the centre of mass, in the plane for planar tasks [m]."""
    place = problem.model.end_effector_pose((0.0, 0.0, 0.0, 1.0), joints).position
    return float(np.linalg.norm(place[:2] if problem.task.planar else place))


def _reach(problem: Problem) -> Interval:
    squared = SingularityMeasure("reach", "", "m^2", lambda joints: _distance(problem, joints) ** 2)
    extremes = joint_space_extremes(problem.model, squared)
    return float(np.sqrt(max(extremes.smallest, 0.0))), float(np.sqrt(extremes.largest))


def _areas(
    problem: Problem, of: SingularityMeasure, scale: float, gap: float
) -> tuple[Interval, ...]:
    singular = singular_configurations(problem, of)
    if len(singular) == 0:
        return ()
    radii = np.array([_distance(problem, joints) for joints in singular])
    order = np.argsort(radii)
    singular, radii = singular[order], radii[order]
    breaks = np.flatnonzero(np.diff(radii) > gap) + 1
    areas = []
    for first, last in zip([0, *breaks], [*breaks, len(radii)], strict=True):
        push = partial(_pushed, problem, of, scale)
        down = np.array([push(joints, 1.0) for joints in singular[first:last][:_ENDS]])
        up = np.array([push(joints, -1.0) for joints in singular[first:last][-_ENDS:]])
        inner = max(radii[first] - _PUSH * gap, radii[first - 1] if first else -1.0)
        outer = min(radii[last - 1] + _PUSH * gap, radii[last] if last < len(radii) else np.inf)
        low = np.min(down[down > inner], initial=radii[first])
        high = np.max(up[up < outer], initial=radii[last - 1])
        areas.append((float(low), float(high)))
    return merged(areas, 1e-3 * gap)


def singular_configurations(problem: Problem, of: SingularityMeasure) -> Array:
    """Joints at which a measure changes its sign along one joint, shape (K, n)."""
    lower, upper = joint_box(problem.model)
    n = problem.model.dof
    found = []
    for number, share in enumerate(low_discrepancy(_LINES, n)):
        joints, moving = lower + (upper - lower) * share, number % n

        def along(value: float, joints: Array = joints, moving: int = moving) -> float:
            joints = joints.copy()
            joints[moving] = value
            return of(joints)

        for root in _roots(along, np.linspace(lower[moving], upper[moving], _STEPS + 1)):
            joints[moving] = root
            found.append(joints.copy())
    return np.array(found).reshape(-1, n)


def _roots(function: Callable[[float], float], places: Array) -> list[float]:
    from scipy.optimize import brentq

    values = np.array([function(place) for place in places.tolist()])
    changes = np.flatnonzero(np.sign(values[1:]) * np.sign(values[:-1]) < 0.0)
    return [float(brentq(function, places[i], places[i + 1], xtol=1e-10)) for i in changes]


def _pushed(
    problem: Problem, of: SingularityMeasure, scale: float, joints: Array, sense: float
) -> float:
    """The radius, as small (sense 1) or as large (-1) as it gets on the singular surface nearby."""
    from scipy.optimize import minimize

    lower, upper = joint_box(problem.model)
    slides = [body.prismatic for body in problem.model.bodies[1:]]
    bounds = [
        (low, high) if slide else (None, None)
        for low, high, slide in zip(lower, upper, slides, strict=True)
    ]
    end = minimize(
        lambda q: sense * _distance(problem, q) ** 2, joints, method="SLSQP", bounds=bounds,
        constraints={"type": "eq", "fun": lambda q: of(q) / scale},
        options={"ftol": 1e-12, "maxiter": 100},
    )  # fmt: skip
    still = abs(of(end.x)) < 1e-8 * scale
    return _distance(problem, end.x if still else joints)
