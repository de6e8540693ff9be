"""Singularity measures: scalar functions of the joints whose zeros are dynamic singularities.

They do not depend on the spacecraft's attitude or the momentum. ``arm`` vanishes at the
singularities of its own factor only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Literal, get_args

import numpy as np

from freefloat.dynamics.arm_factor import ArmPlane
from freefloat.dynamics.denavit_hartenberg import link_frames
from freefloat.dynamics.generalized_jacobian import (
    generalized_determinant,
    generalized_jacobian,
    system_matrix,
)
from freefloat.dynamics.tasks import (
    Task,
    base_rotations,
    prescribed_rows,
    require_task,
    required_plane,
)
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import InputError, require_type
from freefloat.robot.joint_values import finite_after
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array

MeasureName = Literal["det S*", "det A", "in-plane factor", "sigma", "gjm", "system", "arm"]
"""What scenarios may say: names, and the keys of three of them."""
_TITLES = {"gjm": "det S*", "system": "det A", "arm": "in-plane factor", "sigma": "sigma"}
KEYS = tuple(_TITLES)
"""Keys of the measures in files; kernels have their codes in this order."""
_POWERS = 8.0, 64.0, 512.0
"""Powers of the norms that approach the smallest singular value."""


@dataclass(frozen=True, eq=False)
class SingularityMeasure:
    """A scalar function of the joints whose zeros are dynamic singularities.

    Attributes:
        name: Key of the measure in files, see :func:`singularity_measure`.
        definition: Definition with the paper's equation number.
        unit: Unit, as printed in tables.
        function: Measure of joint values of shape (n,), or K of (K, n); signed where it is a
            determinant.
        mass_power: Power of a factor on all masses with which it grows.
        smooth: Functions of the joints that approach the measure from below, each closer than the
            one before, where it has kinks: its maximum is found by their maxima.
    """

    name: str
    definition: str
    unit: str
    function: Callable[[Array], Any] = field(repr=False)
    mass_power: int = 0
    smooth: tuple[Callable[[Array], Any], ...] = field(default=(), repr=False)

    @property
    def title(self) -> str:
        """The measure's name for people."""
        return measure_title(self.name)

    def __call__(self, joints: Array) -> Any:
        """Value at joint values of shape (n,), or values (K,) at joint values of shape (K, n)."""
        return self.function(joints)


def measure_title(key: str) -> str:
    """The name for people of a measure: what it is."""
    return _TITLES[key]


def measure_key(name: str) -> str:
    """The key of a measure in files, of its name or key; other texts as they are."""
    return {title: key for key, title in _TITLES.items()}.get(name, name)


def singularity_measure(
    model: FreeFloatingModel, task: Task | str, name: str
) -> SingularityMeasure:
    """The singularity measure of a robot and a task.

    Args:
        model: Robot.
        task: Task or its value, such as ``"position"``.
        name: ``det S*`` or ``gjm``: det S* (6); for redundant arms sqrt(det(S* S*ᵀ)). ``det A`` or
            ``system``: det A (5), which is det D times det S* and the paper's planar S (21a).
            ``in-plane factor`` or ``arm``: the factor of det A that belongs to the plane of an
            elbow arm under a spherical wrist; S0 of the paper's Example 2 is a value of it.
            ``sigma``: smallest singular value of S*, lengths in units of the reach. (The null-space
            objective ``sigma`` is the product of all singular values.)

    Raises:
        InputError: If there is no such task or measure, the robot cannot have the task, or the arm
            has no factor ``arm``.

    Example:
        >>> model = ff.FreeFloatingModel.from_urdf("planar_2dof")
        >>> measure = ff.singularity_measure(model, "planar-position", "gjm")
        >>> round(float(measure(np.array([0.5, 1.0]))), 4)
        0.2759
    """
    require_type("measure", name, str, "a name")
    task, name = require_task(model, task), measure_key(name)
    if name == "arm" and not model.has_one_arm:
        raise InputError("measure", "arm, but another arm moves", "gjm, system or sigma")
    rows, n = prescribed_rows(model, task), model.arm_dof
    m = len(rows)
    lengths = sum(row % 6 < 3 for row in rows) - int(model.prismatic[:n].sum())
    gjm_definition = "det S* (6)" if m == n else "sqrt(det(S* S*^T)) of S* (7)"
    if name == "gjm":
        return SingularityMeasure(name, gjm_definition, _unit(lengths), partial(_gjm, model, task))
    if name == "system":
        k = base_rotations(model, task)
        definition = "det A (5)" if m == n else f"det D times {gjm_definition}"
        unit = f"{_unit(lengths + 2 * k)} kg" + ("^3" if k == 3 else "")
        return SingularityMeasure(name, definition, unit, partial(_system, model, task), k)
    if name == "sigma":
        reach = unit_of_length(model, task)
        definition = f"smallest singular value of S* (7), in units of the reach {reach:.4g} m"
        function = partial(_sigma, model, task, unit_factors(model, task))
        smooth = tuple(partial(function, power=power) for power in _POWERS)
        return SingularityMeasure(name, definition, "1", function, smooth=smooth)
    if name == "arm":
        plane_axes(model, task)
        function = partial(_arm, trigonometric_terms(model))
        definition = "determinant of the in-plane block of (39): h, v normal and in the arm's plane"
        return SingularityMeasure(name, definition, "m^4 kg", function, 1)
    raise InputError("measure", f"{name!r} was given", ", ".join(get_args(MeasureName)))


def _unit(power: int) -> str:
    return {0: "1", 1: "m"}.get(power, f"m^{power}")


def _gjm(model: FreeFloatingModel, task: Task, joints: Array) -> Any:
    if len(prescribed_rows(model, task)) == model.arm_dof:
        return generalized_determinant(model, joints, task)
    S = generalized_jacobian(model, joints, task)
    return np.linalg.svd(S, compute_uv=False).prod(axis=-1)


def _system(model: FreeFloatingModel, task: Task, joints: Array) -> Any:
    A = system_matrix(model, joints, task)
    if A.shape[-2] == A.shape[-1]:
        return np.linalg.det(A)
    k = base_rotations(model, task)
    return np.linalg.det(A[..., :k, :k]) * _gjm(model, task, joints)


def unit_factors(model: FreeFloatingModel, task: Task) -> tuple[Array, Array]:
    """Factors of the rows (m,) and columns (n,) of S* that put lengths in units of the reach."""
    reach = unit_of_length(model, task)
    rows = np.where(np.array(prescribed_rows(model, task)) % 6 < 3, 1.0 / reach, 1.0)
    return rows, np.where(model.prismatic[: model.arm_dof], reach, 1.0)


def unit_of_length(model: FreeFloatingModel, task: Task) -> float:
    """The reach that is the measures' unit of length [m], further arms fixed at zero.

    For planar tasks on a table it is the reach in the plane, whatever the height of the arm.
    """
    virtual = VirtualManipulator.of(model.single_arms[0])
    if not (task.planar and model.on_table):
        return virtual.reach
    in_plane = virtual.lengths(required_plane(model, task).normal)
    return virtual.reach - float((virtual.lengths() - in_plane).sum())


def _sigma(
    model: FreeFloatingModel, task: Task, factors: tuple[Array, Array], joints: Array,
    power: float = np.inf,
) -> Any:  # fmt: skip
    """The smallest singular value; with a power one over the norm of their inverses, smooth."""
    rows, columns = factors
    S = rows[:, None] * generalized_jacobian(model, joints, task) * columns
    values = np.linalg.svd(S, compute_uv=False)
    positive = np.maximum(values, np.finfo(float).tiny)
    return values[..., -1] / np.linalg.norm(positive[..., -1:] / positive, power, axis=-1)


_TOLERANCE = 1e-6
"""Cosine of the angle between axes that are normal to each other."""


def plane_axes(model: FreeFloatingModel, task: Task) -> Array:
    """Axes of an elbow arm's plane at q1 = 0: its normal and two in it, rows of shape (3, 3).

    With the spherical wrist eliminated and the end-effector not rotating, shoulder and elbow
    satisfy the 6x6 system (37). In these axes it splits into two blocks as in (39): momentum about
    the normal and velocities in the plane on one side, the rest on the other, where the masses are
    symmetric, see :meth:`.ArmPlane.is_symmetric`.

    Raises:
        InputError: If the system of the arm does not split into the two blocks.
    """
    virtual = VirtualManipulator.of(model)
    if task is Task.POSE and virtual.has_elbow_and_spherical_wrist and not model.on_table:
        k, normal = virtual.axes_at(np.zeros(6))[:2]
        frames = link_frames(model)
        plane = ArmPlane.of(frames)
        if abs(k @ normal) < _TOLERANCE and plane.is_symmetric(frames.bodies[None])[0]:
            return np.array([normal, np.cross(k, normal), k])
    raise InputError(
        "measure",
        "this arm's system (5) has no in-plane factor",
        "gjm, system or sigma; arm requires six joints, the second and third parallel and normal "
        "to the first, the last three meeting in a point, a spacecraft symmetric about the first",
    )


def trigonometric_terms(model: FreeFloatingModel) -> Array:
    """The factor S(q2, q3) (40) of det A of an elbow arm, see :mod:`.arm_factor`.

    Rows are k, l, a, b of the terms a cos(k q2 + l q3) + b sin(k q2 + l q3), shape (5, 4).
    """
    frames = link_frames(model)
    plane = ArmPlane.of(frames)
    return np.column_stack([plane.multiples, plane.coefficients(frames.bodies)])


def _arm(terms: Array, joints: Array) -> Any:
    if np.ndim(joints) != 2:
        joints = finite_after(np.zeros(0), "joints", joints, 6)
    angles = joints[..., 1:3] @ terms[:, :2].T
    return np.cos(angles) @ terms[:, 2] + np.sin(angles) @ terms[:, 3]
