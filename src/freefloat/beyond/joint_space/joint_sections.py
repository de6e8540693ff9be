"""Sections of the joint space: some joints vary, the others keep a value."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from freefloat.attitude_grids import low_discrepancy
from freefloat.beyond.joint_space.singularity_map import SingularityMap
from freefloat.errors import finite_vector
from freefloat.singularities.joint_polynomial import JointPolynomial
from freefloat.so3 import Array
from freefloat.visualization.figure_style import digits

_JOINT_SAMPLES = 4096
_STEP = np.radians(5.0)
"""Revolute joints of the reference configuration are multiples of this [rad]."""


@dataclass(frozen=True, eq=False)
class JointSection:
    """The joint space with all joints but a few at constant values.

    Attributes:
        found: Map of the joint space.
        joints: Indices of the joints that vary.
        at: Values of all joints [rad or m], of which those of other joints count, shape (n,).
    """

    found: SingularityMap
    joints: tuple[int, ...]
    at: Array = field(repr=False)

    @cached_property
    def polynomial(self) -> JointPolynomial:
        """Det A by the joints that vary."""
        polynomial: JointPolynomial = self.found.polynomial
        for joint in set(polynomial.moving) - set(self.joints):
            polynomial = polynomial.fixed(joint, float(self.at[joint]))
        return polynomial

    @property
    def lower(self) -> Array:
        """Lower ends of the ranges of the joints that vary [rad or m]."""
        return np.array([self.found.polynomial.bases[joint].lower for joint in self.joints])

    @property
    def upper(self) -> Array:
        """Upper ends of these ranges."""
        return np.array([self.found.polynomial.bases[joint].upper for joint in self.joints])

    def ticks(self, fractions: Array) -> tuple[Array, ...]:
        """Values of each joint that varies [rad or m] at fractions (K,) of its range."""
        ranges = zip(self.lower, self.upper, strict=True)
        return tuple(low + (high - low) * fractions for low, high in ranges)

    def configurations(self, values: Array) -> Array:
        """All joints (K, n) from those that vary (K, m)."""
        q = np.tile(self.at, (len(values), 1))
        q[:, self.joints] = values
        return q

    def grid(self, ticks: Sequence[Array]) -> Array:
        """Configurations of a grid over the joints that vary, the last one running fastest."""
        nodes = np.meshgrid(*ticks, indexing="ij")
        return self.configurations(np.stack(nodes, axis=-1).reshape(-1, len(ticks)))

    def signs_differ(self, values: Array) -> bool:
        """Whether values of det A have either sign, rounding errors aside."""
        rounding = self.found.polynomial.rounding
        return bool(values.min() < -rounding and values.max() > rounding)

    def constants(self) -> str:
        """The joints that do not vary but matter, with their values; empty if there are none."""
        found, names = self.found, self.found.model.joint_names
        fixed = {names.index(name): value for name, value in found.fixed.items()}
        values = {joint: float(self.at[joint]) for joint in found.joints} | fixed
        others = sorted(set(values) - set(self.joints))
        return ", ".join(joint_value(found, joint, values[joint]) for joint in others)


def section(
    found: SingularityMap, joints: Sequence[int], at: npt.ArrayLike | None = None
) -> JointSection:
    """The section over some joints; ``at`` is by default :func:`reference_configuration`.

    Raises:
        InputError: If ``at`` is not a finite value for each joint.
    """
    if at is None:
        values = reference_configuration(found)
    else:
        values = finite_vector("at", at, len(found.model.joint_names))
    return JointSection(found, tuple(joints), values)


def joint_unit(found: SingularityMap, joint: int) -> tuple[str, float]:
    """Unit in which a joint is shown, degrees or metres, and its number per rad or m."""
    return ("m", 1.0) if found.polynomial.bases[joint].prismatic else ("deg", 180.0 / np.pi)


def joint_value(found: SingularityMap, joint: int, value: float) -> str:
    """A joint's name and value, such as ``q1 = 30°``."""
    unit, factor = joint_unit(found, joint)
    name = found.model.joint_names[joint]
    return f"{name} = {digits(factor * value)}" + ("°" if unit == "deg" else " m")


def influential_joints(found: SingularityMap, count: int) -> list[int]:
    """The joints with the largest influence on det A, in order of the arm.

    A joint's influence is the mean square of the part of det A that depends on it. If det A depends
    on fewer joints, others are added.
    """
    polynomial = found.polynomial
    squares = polynomial.coefficients**2
    for axis, basis in enumerate(polynomial.bases):
        weights = np.where(np.arange(basis.size) > 0, 0.5, 1.0)
        shape = np.ones(squares.ndim, dtype=int)
        shape[axis] = basis.size
        squares = squares * weights.reshape(shape)
    influences = [
        squares.sum() - squares.take(0, joint).sum() if basis.degree else -np.inf
        for joint, basis in enumerate(polynomial.bases)
    ]
    return sorted(np.argsort(-np.array(influences), kind="stable")[:count].tolist())


def reference_configuration(found: SingularityMap) -> Array:
    """A configuration far from singularities, revolute joints at multiples of 5 degrees.

    It has the largest magnitude of det A of 4096 samples; joints on which det A does not depend are
    at zero, or in the middle of a prismatic joint's range, those of fixed values have these.
    """
    bases = found.polynomial.bases
    lower, upper = (np.array([getattr(b, end) for b in bases]) for end in ("lower", "upper"))
    q = np.tile((lower + upper) / 2.0, (_JOINT_SAMPLES, 1))
    joints = found.joints
    samples = low_discrepancy(_JOINT_SAMPLES, len(joints))
    q[:, joints] = lower[joints] + (upper - lower)[joints] * samples
    revolute = [joint for joint in joints if not bases[joint].prismatic]
    q[:, revolute] = _STEP * np.round(q[:, revolute] / _STEP)
    best: Array = q[int(np.argmax(np.abs(found.polynomial.values(q))))]
    for name, value in found.fixed.items():
        best[found.model.joint_names.index(name)] = value
    return best
