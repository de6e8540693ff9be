"""Measures of how far a configuration is from a dynamic singularity, and their extremes.

All depend on the joints alone: neither the spacecraft's attitude nor its momentum enters.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from freefloat.brief import brief
from freefloat.dynamics.momentum import (
    Task,
    determinant,
    generalized_determinant,
    generalized_jacobian,
    inertia_matrices,
    refuse_too_few_joints,
    system_matrix,
)
from freefloat.dynamics.virtual_manipulator import VirtualManipulator, meeting_point
from freefloat.errors import InputError
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, frozen, low_discrepancy

NAMES = ("gjm", "system", "arm", "sigma")


@dataclass(frozen=True, eq=False)
class SingularityMeasure:
    """A scalar function of the joints that vanishes at dynamic singularities.

    Attributes:
        name: One of ``gjm``, ``system``, ``arm``, ``sigma``.
        definition: In words, with the paper's equation number.
        unit: As printed in tables.
        function: The measure at joint values of shape (n,); signed where it is a determinant.
    """

    name: str
    definition: str
    unit: str
    function: Callable[[Array], float] = field(repr=False)

    def __call__(self, joints: Array) -> float:
        """Value at joint values of shape (n,)."""
        return self.function(joints)


def singularity_measure(
    model: FreeFloatingModel, task: Task | str, name: str
) -> SingularityMeasure:
    """One of the four measures for a robot and a task.

    Args:
        model: Robot.
        task: What of the end-effector is prescribed, or its value, such as ``"position"``.
        name: ``gjm``: det S* (6); for redundant arms sqrt(det(S* S*ᵀ)). ``system``: det A (5),
            which is det D times ``gjm`` and the paper's planar S (21a). ``arm``: the factor of
            det A that belongs to the plane of an elbow arm under a spherical wrist, the paper's
            S(q2, q3) (40). ``sigma``: smallest singular value of S*, lengths in units of the reach.

    Raises:
        InputError: If there is no such task or measure, or ``arm`` is asked of an arm that has no
            such factor.
    """
    task = Task.of(task)
    m, n = len(task.rows), model.dof
    refuse_too_few_joints(model, task)
    slides = sum(body.prismatic for body in model.bodies[1:])
    lengths = sum(row < 3 for row in task.rows) - slides
    virtual = VirtualManipulator.of(model)
    determinant = "det S* (6)" if m == n else "sqrt(det(S* S*^T)) of S* (7)"
    if name == "gjm":
        return SingularityMeasure(name, determinant, _unit(lengths), partial(_gjm, model, task))
    if name == "system":
        k = 1 if task.planar else 3
        words = "det A (5)" if m == n else f"det D times {determinant}"
        unit = f"{_unit(lengths + 2 * k)} kg" + ("^3" if k == 3 else "")
        return SingularityMeasure(name, words, unit, partial(_system, model, task))
    if name == "sigma":
        words = f"smallest singular value of S* (7), in units of the reach {virtual.reach:.4g} m"
        return SingularityMeasure(name, words, "1", partial(_sigma, model, task, virtual.reach))
    if name == "arm":
        axes = arm_axes(model, task)
        words = "determinant of the in-plane block of (39): h, v normal and in the arm's plane"
        return SingularityMeasure(name, words, "m^4 kg", partial(_arm, model, axes))
    raise InputError("margin.measure", f"{name!r} was given", ", ".join(NAMES))


def _unit(power: int) -> str:
    return {0: "1", 1: "m"}.get(power, f"m^{power}")


def _gjm(model: FreeFloatingModel, task: Task, joints: Array) -> float:
    if len(task.rows) == model.dof:
        return generalized_determinant(model, joints, task)
    S = generalized_jacobian(model, joints, task)
    return float(np.prod(np.linalg.svd(S, compute_uv=False)))


def _system(model: FreeFloatingModel, task: Task, joints: Array) -> float:
    A = system_matrix(model, joints, task)
    if A.shape[0] == A.shape[1]:
        return determinant(A)
    D, _ = inertia_matrices(model, joints)
    return float(np.linalg.det(D[2:, 2:] if task.planar else D)) * _gjm(model, task, joints)


def _sigma(model: FreeFloatingModel, task: Task, reach: float, joints: Array) -> float:
    S = generalized_jacobian(model, joints, task)
    S[[i for i, row in enumerate(task.rows) if row < 3]] /= reach
    S[:, [body.prismatic for body in model.bodies[1:]]] *= reach
    return float(np.linalg.svd(S, compute_uv=False)[-1])


_BENT_WRIST = (0.0, np.pi / 2, 0.0)
"""Wrist angles for evaluating (37), which does not depend on them: far from straight."""

_IN_PLANE, _ACROSS = [0, 4, 5], [1, 2, 3]


def _shoulder_system(model: FreeFloatingModel, joints: Array, axes: Array) -> Array:
    """The 6x6 system (37) of shoulder and elbow: wrist eliminated, end-effector not turning.

    Args:
        model: Robot.
        joints: Shape (6,).
        axes: Rows are the axes in which the system is written, spacecraft frame, shape (3, 3).

    Returns:
        Rows ``h, v`` and columns ``w, q1 q2 q3``.
    """
    A = system_matrix(model, joints)
    R = A[:6, :6] - A[:6, 6:] @ np.linalg.solve(A[6:, 6:], A[6:, :6])
    R[:3], R[3:] = axes @ R[:3], axes @ R[3:]
    R[:, :3] = R[:, :3] @ axes.T
    return R


def _plane_axes(virtual: VirtualManipulator, joints: Array) -> Array:
    """Normal of the arm's plane (joint 2), joint 1 x joint 2, joint 1: rows, shape (3, 3)."""
    k, normal = virtual.axes_at(joints)[:2]
    return np.array([normal, np.cross(k, normal), k])


def _arm(model: FreeFloatingModel, axes: Array, joints: Array) -> float:
    """At q1 = 0, where ``axes`` were taken: by (39) the first joint only turns the plane."""
    R = _shoulder_system(model, np.array([0.0, joints[1], joints[2], *_BENT_WRIST]), axes)
    return float(np.linalg.det(R[np.ix_(_IN_PLANE, _IN_PLANE)]))


def arm_axes(model: FreeFloatingModel, task: Task) -> Array:
    """Axes of the arm's plane at q1 = 0, for arms whose system splits in two blocks as in (39).

    The hand moves with the wrist's velocity v and adds m d x v to the momentum, d from the wrist to
    its centre of mass: a multiple of other rows, which only where d leaves the plane mixes the
    blocks; it is taken off before judging them.

    Raises:
        InputError: For every other arm.
    """
    refusal = InputError(
        "margin.measure",
        "this arm's system (5) has no in-plane factor",
        "gjm, system or sigma; arm wants six joints, the second and third parallel and normal to "
        "the first, the last three meeting in a point, and a spacecraft symmetric about the first",
    )
    virtual = VirtualManipulator.of(model)
    if task is not Task.POSE or not virtual.has_elbow_and_spherical_wrist:
        raise refusal
    hand = _hand(model, virtual.reach)
    if hand is None:
        raise refusal
    level = _plane_axes(virtual, np.zeros(6))
    for fraction in low_discrepancy(8, 6):
        joints = np.pi * (2.0 * fraction - 1.0)
        joints[4] = 0.5 + 2.0 * fraction[4]
        R = _shoulder_system(model, joints, axes := _plane_axes(virtual, joints))
        d = axes @ virtual.pose(joints).rotation @ virtual.tool.T @ hand
        R[:3] -= model.bodies[-1].mass * np.cross(d, R[3:].T).T
        mixed = np.abs([R[np.ix_(_IN_PLANE, _ACROSS)], R[np.ix_(_ACROSS, _IN_PLANE)]]).max()
        factor = float(np.linalg.det(R[np.ix_(_IN_PLANE, _IN_PLANE)]))
        unsteady = abs(factor - _arm(model, level, joints))
        scale = np.abs(R).max()
        if max(abs(axes[0] @ axes[2]), mixed / scale, unsteady / scale**3) > 1e-6:
            raise refusal
    return level


def _hand(model: FreeFloatingModel, reach: float) -> Array | None:
    """From the wrist centre of the real arm to the last body's centre of mass, in that body."""
    _, five, six = model.bodies[4:]
    turn = five.placement.rotation @ six.placement.rotation
    last = five.placement.position + five.placement.rotation @ six.placement.position
    points = np.array([np.zeros(3), five.placement.position, last])
    axes = np.array([model.bodies[4].axis, five.placement.rotation @ five.axis, turn @ six.axis])
    centre = meeting_point(points, axes, 1e-9 * reach)
    return None if centre is None else six.centre - turn.T @ (centre - last)


@dataclass(frozen=True, eq=False)
class Extremes:
    """The largest and smallest values of a measure over the joint space.

    Attributes:
        largest: S_max.
        largest_at: Joints where it is taken, shape (n,).
        smallest: S_min; negative for determinants.
        smallest_at: Joints where it is taken, shape (n,).
    """

    __repr__ = brief

    largest: float
    largest_at: Array
    smallest: float
    smallest_at: Array

    @property
    def magnitude(self) -> float:
        """The largest magnitude, to which a margin's ``fraction`` refers."""
        return max(abs(self.largest), abs(self.smallest))


def joint_space_extremes(
    model: FreeFloatingModel, of: SingularityMeasure, samples: int = 4096
) -> Extremes:
    """Search the joint space for the extremes of a measure.

    A low-discrepancy sweep, its best points polished by a quasi-Newton method. Turning joints range
    over a full turn, sliding ones over their limits.

    Args:
        model: Robot.
        of: SingularityMeasure of this robot.
        samples: Size of the sweep.
    """
    points, _ = _swept(model, of, samples)
    smallest, smallest_at = _polished(model, of, points[:_POLISHED])
    largest, largest_at = _polished(model, lambda q: -of(q), points[-_POLISHED:])
    return Extremes(-largest, frozen(largest_at), smallest, frozen(smallest_at))


def largest_magnitude(
    model: FreeFloatingModel, of: SingularityMeasure, samples: int = 4096
) -> float:
    """As :attr:`Extremes.magnitude`; quicker for measures without a sign.

    What is nowhere negative has its smallest value at a kink, where polishing takes longest.
    """
    points, values = _swept(model, of, samples)
    magnitude, _ = _polished(model, lambda q: -of(q), points[-_POLISHED:])
    if values[0] >= 0.0:
        return abs(magnitude)
    smallest, _ = _polished(model, of, points[:_POLISHED])
    return max(abs(magnitude), abs(smallest))


_POLISHED = 8


def _swept(model: FreeFloatingModel, of: SingularityMeasure, samples: int) -> tuple[Array, Array]:
    """Evenly spread points of the joint space (K, n) and the measure there, the smallest first."""
    lower, upper = joint_box(model)
    points = lower + (upper - lower) * low_discrepancy(samples, model.dof)
    values = np.array([of(point) for point in points])
    order = np.argsort(values)
    return points[order], values[order]


def joint_box(model: FreeFloatingModel) -> tuple[Array, Array]:
    """Where to look for joint values: a full turn, or the range of a sliding joint."""
    arm = model.bodies[1:]
    for body in arm:
        if body.prismatic and not np.isfinite([body.lower, body.upper]).all():
            raise InputError(f"joint {body.joint}", "it slides without limits", "a finite range")
    lower = np.array([body.lower if body.prismatic else -np.pi for body in arm])
    return lower, np.array([body.upper if body.prismatic else np.pi for body in arm])


def _polished(
    model: FreeFloatingModel, function: Callable[[Array], float], starts: Array
) -> tuple[float, Array]:
    from scipy.optimize import minimize  # a third of a second that most commands need not pay

    scale = max(abs(function(start)) for start in starts) or 1.0
    bounds = [
        (body.lower, body.upper) if body.prismatic else (None, None) for body in model.bodies[1:]
    ]
    ends = [
        # L-BFGS-B would have BLAS put both cores to its tiny matrices: ten times the time
        minimize(lambda q: function(q) / scale, start, method="SLSQP",
                 bounds=bounds, options={"ftol": 1e-15})
        for start in starts
    ]  # fmt: skip
    best = min(ends, key=lambda end: float(end.fun))
    return float(function(best.x)), best.x
