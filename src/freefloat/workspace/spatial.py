"""Areas of spatial arms: elbow arms reduced to a plane, and samples of any arm's joint space."""

from __future__ import annotations

from functools import partial

import numpy as np

from freefloat.dynamics.joint_space import joint_box, joint_space_extremes, optimizer_bounds
from freefloat.dynamics.measures import SingularityMeasure, plane_axes, singularity_measure
from freefloat.dynamics.momentum import Task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import InputError
from freefloat.motion.problem import Problem
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, low_discrepancy
from freefloat.workspace.planar import Complex, Interval, PlanarArm, point_3, two_angles

_GRID = 8
"""Angles per joint; S is a trigonometric polynomial of degree two, which fewer determine."""
_LINES = 1024
"""Sweeps of one joint."""
_STEPS = 32
"""Intervals of each."""
_ENDS = 4
"""Singular configurations from which each end of an area is extended."""
_EXTENSION = 5.0
"""An end that moves by more gaps than this has left its area for another."""


def elbow_arm(model: FreeFloatingModel) -> PlanarArm:
    """The planar arm of two joints, q2 and q3, whose S is the ``arm`` measure (40) of an elbow arm.

    It lies in the plane that the first joint rotates, x across that joint and y along it. Its point
    3 is the wrist centre of the virtual manipulator, at the same distance from the centre of mass.
    Its inertia is one that gives this S and has no other meaning.

    Raises:
        InputError: For arms without that measure, see
            :func:`~freefloat.dynamics.measures.singularity_measure`.
    """
    axes = plane_axes(model, Task.POSE)
    virtual = VirtualManipulator.of(model)
    _, _, points, joint_axes = virtual.kinematics(np.zeros(6))
    corners = [points[1, 0], points[2, 0], _wrist(virtual)]
    links = np.diff([0.0, *(complex(axes[1] @ p, axes[2] @ p) for p in corners)])
    signs = np.sign(joint_axes[1:3, 0] @ axes[0])
    arm = PlanarArm(links, _inertia(model, links, signs), signs, 0.0)
    joints = np.pi * (2.0 * low_discrepancy(64, 6) - 1.0)
    positions, rotations, _, _ = virtual.kinematics(joints)
    distances = np.linalg.norm(positions + rotations @ wrist_in_tool(virtual), axis=1)
    if np.abs(np.abs(point_3(arm, joints[:, 1:3])) - distances).max() > 1e-9 * virtual.reach:
        raise InputError(
            "margin.measure", "the first joint changes the wrist's distance from the mass centre",
            "a first joint whose axis passes through the virtual manipulator's base",
        )  # fmt: skip
    return arm


def wrist_in_tool(virtual: VirtualManipulator) -> Array:
    """The virtual manipulator's wrist centre in the end-effector's frame [m], shape (3,)."""
    zero = virtual.pose(np.zeros(6))
    return np.asarray(zero.rotation.T @ (_wrist(virtual) - zero.position))


def _wrist(virtual: VirtualManipulator) -> Array:
    if virtual.wrist_centre is None:
        raise InputError("task", "the wrist is not spherical", "last three axes through one point")
    return virtual.wrist_centre


def _inertia(model: FreeFloatingModel, links: Complex, signs: Array) -> Complex:
    """The inertia, in which S is linear, by least squares on a grid; the fit must be exact."""
    measure = singularity_measure(model, Task.POSE, "arm")
    axis = 2.0 * np.pi * np.arange(_GRID) / _GRID
    joints = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    S = np.array([measure(np.array([0.0, q2, q3, 0.0, 0.0, 0.0])) for q2, q3 in joints.tolist()])
    units = _hermitian_units()
    arms = [PlanarArm(links, unit, signs, 0.0) for unit in units]
    matrix = np.stack([arm.determinant(two_angles(arm, joints)) for arm in arms], axis=1)
    coefficients = np.linalg.lstsq(matrix, S, rcond=None)[0]
    if np.abs(matrix @ coefficients - S).max() > 1e-9 * np.abs(S).max():
        raise InputError(
            "margin.measure", "this arm's S(q2, q3) is not that of an arm in a plane",
            "an elbow arm with a spherical wrist",
        )  # fmt: skip
    return np.asarray(np.einsum("k,kij->ij", coefficients, units))


def _hermitian_units() -> Complex:
    """A basis of the Hermitian matrices, shape (9, 3, 3)."""
    units = []
    for i, j in zip(*np.triu_indices(3), strict=True):
        for factor in (1.0,) if i == j else (1.0, 1.0j):
            unit = np.zeros((3, 3), dtype=complex)
            unit[i, j], unit[j, i] = factor, np.conj(factor)
            units.append(unit)
    return np.array(units)


def sampled_reach(problem: Problem) -> Interval:
    """Smallest and largest distance of the end-effector from the centre of mass [m].

    Raises:
        InputError: If a prismatic joint has no limits.
    """
    extremes = joint_space_extremes(problem.model, lambda joints: _distance(problem, joints) ** 2)
    return float(np.sqrt(max(extremes.smallest, 0.0))), float(np.sqrt(extremes.largest))


def sampled_areas(
    problem: Problem, measure: SingularityMeasure, scale: float, gap: float
) -> list[Interval]:
    """Intervals of the end-effector's distance at which a measure can vanish [m].

    The ends of the areas of :func:`singular_configurations` are extended along the singular surface
    by optimization.

    Args:
        problem: The problem.
        measure: A measure with a sign.
        scale: Its largest magnitude.
        gap: Distances closer than this belong to one area [m].
    """
    singular = singular_configurations(problem, measure)
    if len(singular) == 0:
        return []
    radii = np.array([_distance(problem, joints) for joints in singular])
    order = np.argsort(radii)
    singular, radii = singular[order], radii[order]
    breaks = np.flatnonzero(np.diff(radii) > gap) + 1
    extend = partial(_extended, problem, measure, scale)
    areas = []
    for first, last in zip([0, *breaks], [*breaks, len(radii)], strict=True):
        down = np.array([extend(joints, 1.0) for joints in singular[first:last][:_ENDS]])
        up = np.array([extend(joints, -1.0) for joints in singular[first:last][-_ENDS:]])
        before = radii[first - 1] if first else -1.0
        beyond = radii[last] if last < len(radii) else np.inf
        down = down[down > max(radii[first] - _EXTENSION * gap, before)]
        up = up[up < min(radii[last - 1] + _EXTENSION * gap, beyond)]
        areas.append(
            (float(down.min(initial=radii[first])), float(up.max(initial=radii[last - 1])))
        )
    return areas


def singular_configurations(problem: Problem, measure: SingularityMeasure) -> Array:
    """Joints at which a measure changes its sign, shape (K, n).

    One joint at a time sweeps its range from many configurations; between samples of different sign
    the root is solved for.
    """
    from scipy.optimize import brentq  # imported late: it takes a third of a second

    lower, upper = joint_box(problem.model)
    n = problem.model.dof
    singular = []
    for number, fraction in enumerate(low_discrepancy(_LINES, n)):
        start = lower + (upper - lower) * fraction
        moving = np.arange(n) == number % n

        def along(value: float, start: Array = start, moving: Array = moving) -> float:
            return measure(np.where(moving, value, start))

        samples = np.linspace(lower[moving], upper[moving], _STEPS + 1).ravel()
        signs = np.sign([along(value) for value in samples.tolist()])
        for i in np.flatnonzero(signs[1:] * signs[:-1] < 0.0):
            root = brentq(along, samples[i], samples[i + 1], xtol=1e-10)
            singular.append(np.where(moving, root, start))
    return np.array(singular).reshape(-1, n)


def _distance(problem: Problem, joints: Array) -> float:
    """Distance of the end-effector from the centre of mass, in the plane for planar tasks [m]."""
    position = problem.model.end_effector_pose((0.0, 0.0, 0.0, 1.0), joints).position
    return float(np.linalg.norm(position[:2] if problem.task.planar else position))


def _extended(
    problem: Problem, measure: SingularityMeasure, scale: float, joints: Array, sense: float
) -> float:
    """Smallest (sense 1) or largest (-1) radius nearby on the singular surface [m]."""
    from scipy.optimize import minimize

    end = minimize(
        lambda q: sense * _distance(problem, q) ** 2, joints, method="SLSQP",
        bounds=optimizer_bounds(problem.model),
        constraints={"type": "eq", "fun": lambda q: measure(q) / scale},
        options={"ftol": 1e-12, "maxiter": 100},
    )  # fmt: skip
    singular = abs(measure(end.x)) < 1e-8 * scale
    return _distance(problem, end.x if singular else joints)
