"""The determinants of equations (5) and (6) as exact polynomials of the joints.

The entries of A in (5) are sums of products of rotations and strokes. So det A and det D are
trigonometric polynomials of each revolute joint and ordinary ones of each prismatic joint, of low
degrees. Samples on a grid determine their coefficients up to rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from freefloat.attitude_grids import low_discrepancy
from freefloat.dynamics.generalized_jacobian import system_matrix
from freefloat.dynamics.joint_space import joint_box
from freefloat.dynamics.tasks import Task, base_rotations, require_task
from freefloat.errors import InputError, finite_number
from freefloat.robot.model import FreeFloatingModel
from freefloat.singularities.joint_polynomial import JointBasis, JointPolynomial, along
from freefloat.so3 import Array, frozen

MOST_COEFFICIENTS = 5_000_000
"""Largest number of coefficients."""
_HIGHEST = 16
"""Highest degree in a joint that is looked for."""
_PROBES, _CHECKS = 4, 256
"""Numbers of configurations to determine degrees, and of configurations to check the result."""
_VANISHING_COEFFICIENT = 1e-13
"""Magnitude of coefficients that are rounding, relative to the largest value."""
_LARGEST_RESIDUAL, _VANISHING = 1e-9, 1e-11
"""Largest residual, and the largest value over Hadamard's bound that is rounding."""
_MOST_RADIANS = 4.0 * np.pi
"""Magnitude above which the value of a fixed joint is taken for degrees."""
_BATCH = 4096
"""Configurations of which matrices are held at a time."""


@dataclass(frozen=True, eq=False)
class SingularityPolynomial(JointPolynomial):
    """Det A of (5) as a polynomial of the joints, whose zeros are the dynamic singularities.

    Of a redundant arm it is det(S* S*ᵀ) det² D, which is nowhere negative.

    Example:
        >>> model = ff.FreeFloatingModel.from_urdf("planar_2dof")
        >>> polynomial = SingularityPolynomial.of(model, "planar-position")
        >>> polynomial.degrees, polynomial.coefficients.size
        ((2, 1), 15)
        >>> polynomial.values([[0.3, 0.7]]).round(6)
        array([3.753986])
        >>> polynomial.gradients([[0.3, 0.7]]).shape
        (1, 2)
    """

    @classmethod
    def of(
        cls,
        model: FreeFloatingModel,
        task: Task | str = Task.POSE,
        fixed: Mapping[str, float] | None = None,
    ) -> SingularityPolynomial:
        """The polynomial of a robot and a task.

        Args:
            model: Robot.
            task: Task or its value, such as ``"position"``.
            fixed: Joints that keep a value [rad or m], by name; the polynomial depends on the
                other joints.

        Raises:
            InputError: If there is no such task or joint, or the robot cannot have the task; if a
                prismatic joint has no finite range, or a joint is fixed outside of it; if det A
                vanishes everywhere, has more than five million coefficients or cannot be
                represented.
        """
        task = require_task(model, task)
        model.require_supported("polynomials of the joints")
        values = dict(_fixed_joint(model, *pair) for pair in (fixed or {}).items())
        _require_freedom(model, task, values)
        fit = fitted(lambda q: determinants(model, q, task), model, values)
        return cls(fit.bases, fit.coefficients, fit.residual)


def _fixed_joint(model: FreeFloatingModel, name: str, value: float) -> tuple[int, float]:
    """Index and value of a fixed joint."""
    if name not in model.joint_names:
        raise InputError("fixed", f"there is no joint {name}", ", ".join(model.joint_names))
    joint = model.joint_names.index(name)
    lower, upper = (float(ends[joint]) for ends in model.joint_ranges)
    if not model.prismatic[joint]:
        lower, upper = -_MOST_RADIANS, _MOST_RADIANS
    accepted = f"a value from {lower:g} to {upper:g} [rad or m]"
    return joint, finite_number(f"fixed {name}", value, accepted, lower, upper)


def _require_freedom(model: FreeFloatingModel, task: Task, fixed: Mapping[int, float]) -> None:
    """Raise an InputError where det A vanishes in all configurations, see Hadamard's inequality."""
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (_PROBES, model.dof))
    q[:, list(fixed)] = list(fixed.values())
    bounds = np.linalg.norm(system_matrix(model, q, task), axis=-1).prod(axis=-1)
    if model.dof > len(task.rows):
        bounds = bounds**2
    if (np.abs(determinants(model, q, task)) <= _VANISHING * bounds).all():
        problem = "det A vanishes in all configurations: the arm cannot follow the task"
        raise InputError("task", problem, "a task for which the arm has the freedom")


def determinants(model: FreeFloatingModel, joints: Array, task: Task) -> Array:
    """Det A at joint values (K, n); of redundant arms det(S* S*ᵀ) det² D."""
    A = system_matrix(model, joints, task)
    if A.shape[-1] == A.shape[-2]:
        return np.asarray(np.linalg.det(A))
    k = base_rotations(model, task)
    D = A[:, :k, :k]
    S = A[:, k:, k:] - A[:, k:, :k] @ np.linalg.solve(D, A[:, :k, k:])
    return np.asarray(np.linalg.det(S @ S.swapaxes(1, 2)) * np.linalg.det(D) ** 2)


def locked_inertia_polynomial(model: FreeFloatingModel, task: Task) -> JointPolynomial:
    """Det D, which is positive, as a polynomial of the joints."""
    k = base_rotations(model, task)
    return fitted(lambda q: np.linalg.det(system_matrix(model, q, task)[:, :k, :k]), model)


def fitted(
    function: Callable[[Array], Array],
    model: FreeFloatingModel,
    fixed: Mapping[int, float] | None = None,
) -> JointPolynomial:
    """The polynomial that a function of the joints is.

    Args:
        function: Values of the function at joint values (K, n); shape (K,).
        model: Robot.
        fixed: Joints that keep a value, by index.

    Raises:
        InputError: See :meth:`SingularityPolynomial.of`.
    """
    lower, upper = joint_box(model, fixed)
    joints, values = list(fixed or {}), list((fixed or {}).values())

    def evaluated(q: Array) -> Array:
        q = q.copy()
        q[:, joints] = values
        return function(q)

    checks = lower + (upper - lower) * low_discrepancy(_CHECKS, model.dof)
    exact = evaluated(checks)
    scale = np.abs(exact).max() or 1.0
    kinds = zip(model.prismatic.tolist(), lower.tolist(), upper.tolist(), strict=True)
    bases = []
    for joint, kind in enumerate(kinds):
        highest = JointBasis(_HIGHEST, *kind)
        degree = _degree(
            evaluated, highest, joint, checks[:_PROBES], _VANISHING_COEFFICIENT * scale
        )
        bases.append(JointBasis(degree, *kind))
    count = int(np.prod([float(basis.size) for basis in bases]))
    if count > MOST_COEFFICIENTS:
        degrees = ", ".join(str(basis.degree) for basis in bases)
        raise InputError(
            "robot", f"a polynomial of degrees {degrees} in the joints has {count:,} coefficients",
            f"at most {MOST_COEFFICIENTS:,}",
        )  # fmt: skip
    nodes = np.meshgrid(*(basis.nodes for basis in bases), indexing="ij")
    grid = np.stack(nodes, axis=-1).reshape(count, -1)
    samples = [evaluated(grid[first : first + _BATCH]) for first in range(0, count, _BATCH)]
    coefficients = np.concatenate(samples).reshape([basis.size for basis in bases])
    for axis, basis in enumerate(bases):
        coefficients = along(axis, basis.coefficients, coefficients)
    coefficients = frozen(np.ascontiguousarray(coefficients))
    deviations = JointPolynomial(tuple(bases), coefficients, 0.0).values(checks) - exact
    residual = float(np.abs(deviations).max() / scale)
    if not residual < _LARGEST_RESIDUAL:
        problem = f"its determinants cannot be represented: residual {residual:.1g}"
        raise InputError("robot", problem, "lengths and ranges of like magnitudes")
    return JointPolynomial(tuple(bases), coefficients, residual)


def _degree(
    function: Callable[[Array], Array], basis: JointBasis, joint: int, at: Array, rounding: float
) -> int:
    """The degree of a function in a joint, from values along it at some configurations (K, n)."""
    degree = 0
    for q in at:
        line = np.tile(q, (basis.size, 1))
        line[:, joint] = basis.nodes
        magnitudes = np.abs(basis.coefficients(function(line)))
        last = int(np.flatnonzero(magnitudes > rounding).max(initial=0))
        degree = max(degree, last if basis.prismatic else (last + 1) // 2)
    return degree
