"""Singularity measures: distances of a configuration from a dynamic singularity, and extremes.

They depend on the joints alone, not on the spacecraft's attitude or the momentum.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from freefloat.dynamics.in_plane_factor import in_plane_determinant, plane_axes
from freefloat.dynamics.momentum import (
    Task,
    determinant,
    generalized_determinant,
    generalized_jacobian,
    inertia_matrices,
    require_enough_joints,
    system_matrix,
)
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import InputError
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, frozen, low_discrepancy

NAMES = ("gjm", "system", "arm", "sigma")


@dataclass(frozen=True, eq=False)
class SingularityMeasure:
    """A scalar function of the joints that vanishes at dynamic singularities.

    Attributes:
        name: One of ``gjm``, ``system``, ``arm``, ``sigma``.
        definition: Definition with the paper's equation number.
        unit: Unit, as printed in tables.
        function: Measure of joint values of shape (n,); signed where it is a determinant.
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
    """The singularity measure of a robot and a task.

    Args:
        model: Robot.
        task: Task or its value, such as ``"position"``.
        name: ``gjm``: det S* (6); for redundant arms sqrt(det(S* S*ᵀ)). ``system``: det A (5),
            which is det D times ``gjm`` and the paper's planar S (21a). ``arm``: the factor of
            det A that belongs to the plane of an elbow arm under a spherical wrist, the paper's
            S(q2, q3) (40). ``sigma``: smallest singular value of S*, lengths in units of the reach.

    Raises:
        InputError: If there is no such task or measure, or the arm has no factor ``arm``.
    """
    task = Task.of(task)
    m, n = len(task.rows), model.dof
    require_enough_joints(model, task)
    prismatic = sum(body.prismatic for body in model.bodies[1:])
    lengths = sum(row < 3 for row in task.rows) - prismatic
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
        axes = plane_axes(model, task)
        words = "determinant of the in-plane block of (39): h, v normal and in the arm's plane"
        return SingularityMeasure(name, words, "m^4 kg", partial(in_plane_determinant, model, axes))
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


@dataclass(frozen=True, eq=False)
class Extremes:
    """Maximum and minimum of a measure over the joint space.

    Attributes:
        largest: Maximum S_max.
        largest_at: Joint values of the maximum, shape (n,).
        smallest: Minimum; negative for determinants.
        smallest_at: Joint values of the minimum, shape (n,).
    """

    largest: float
    largest_at: Array = field(repr=False)
    smallest: float
    smallest_at: Array = field(repr=False)

    @property
    def magnitude(self) -> float:
        """Largest magnitude, to which a margin's ``fraction`` refers."""
        return max(abs(self.largest), abs(self.smallest))


def joint_space_extremes(
    model: FreeFloatingModel, measure: SingularityMeasure, samples: int = 4096
) -> Extremes:
    """Search the joint space for the extremes of a measure.

    The best points of a low-discrepancy sequence are refined by a quasi-Newton method. Revolute
    joints range over a full revolution, prismatic joints over their limits.

    Args:
        model: Robot.
        measure: Singularity measure of the robot.
        samples: Length of the sequence.
    """
    points, _ = _sorted_samples(model, measure, samples)
    smallest, smallest_at = _minimized(model, measure, points[:_REFINED])
    largest, largest_at = _minimized(model, lambda q: -measure(q), points[-_REFINED:])
    return Extremes(-largest, frozen(largest_at), smallest, frozen(smallest_at))


def largest_magnitude(
    model: FreeFloatingModel, measure: SingularityMeasure, samples: int = 4096
) -> float:
    """:attr:`Extremes.magnitude`, faster for measures that are nowhere negative.

    The minimum of such a measure lies at a kink, where the refinement converges slowest.
    """
    points, values = _sorted_samples(model, measure, samples)
    magnitude, _ = _minimized(model, lambda q: -measure(q), points[-_REFINED:])
    if values[0] >= 0.0:
        return abs(magnitude)
    smallest, _ = _minimized(model, measure, points[:_REFINED])
    return max(abs(magnitude), abs(smallest))


def joint_box(model: FreeFloatingModel) -> tuple[Array, Array]:
    """Lower and upper bounds of the joint space: a full revolution or a prismatic joint's limits.

    Raises:
        InputError: If a prismatic joint has no finite limits.
    """
    arm = model.bodies[1:]
    for body in arm:
        if body.prismatic and not np.isfinite([body.lower, body.upper]).all():
            raise InputError(
                f"joint {body.joint}", "it is prismatic and has no limits", "a finite range"
            )
    lower = np.array([body.lower if body.prismatic else -np.pi for body in arm])
    return lower, np.array([body.upper if body.prismatic else np.pi for body in arm])


_REFINED = 8
"""Samples from which each extremum is refined."""


def _sorted_samples(
    model: FreeFloatingModel, measure: SingularityMeasure, samples: int
) -> tuple[Array, Array]:
    """Points of the joint space (K, n) and the measure there (K,), in ascending order."""
    lower, upper = joint_box(model)
    points = lower + (upper - lower) * low_discrepancy(samples, model.dof)
    values = np.array([measure(point) for point in points])
    order = np.argsort(values)
    return points[order], values[order]


def _minimized(
    model: FreeFloatingModel, function: Callable[[Array], float], starts: Array
) -> tuple[float, Array]:
    """The smallest local minimum of a function from several starts, and its joint values."""
    from scipy.optimize import minimize  # imported late: it takes a third of a second

    scale = max(abs(function(start)) for start in starts) or 1.0
    bounds = [
        (body.lower, body.upper) if body.prismatic else (None, None) for body in model.bodies[1:]
    ]
    minima = [
        # SLSQP: L-BFGS-B uses threaded BLAS for its tiny matrices, which takes ten times as long
        minimize(lambda q: function(q) / scale, start, method="SLSQP",
                 bounds=bounds, options={"ftol": 1e-15})
        for start in starts
    ]  # fmt: skip
    best = min(minima, key=lambda minimum: float(minimum.fun))
    return float(function(best.x)), best.x
