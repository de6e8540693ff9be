"""A limit: its name, its unit, what its bound is, and how the value nearest to it is found.

Bounds are numbers, numbers for each joint, or axes with cones. Each is checked in the same way
whether it was given in Python or in a scenario file; ``freefloat.io.scenario.limits_section`` says
how a file states them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, Literal, Self, TypeVar

import numpy as np

from freefloat.dynamics.inverse_dynamics import Forces
from freefloat.errors import LARGEST_NUMBER, InputError, finite_number, number_array, require_type
from freefloat.limits.result import LimitResult
from freefloat.motion.extrema import Extremum, Function, at_nodes, maximum
from freefloat.motion.law import Rates
from freefloat.motion.margin import ROUNDING
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.pointing import PointingLimit
from freefloat.motion.setting import Setting
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, IntArray, frozen

_DIVERGENCE = 1e3
"""Ratio of a value at a singular end to values before it, from which rounding alone bounds it."""
Bound = TypeVar("Bound")
OFF: Literal["off"] = "off"
"""The value of a limit that does not apply although it would by default."""


def place_of_maximum(motion: Motion, values: Function) -> float:
    """Panel coordinate of the maximum of a function of states, which every motion has."""
    return maximum(at_nodes(motion, values), values).u if motion.panels else 0.0


def peak(motion: Motion, values: Function, nodes: Array | None = None) -> Extremum:
    """The maximum of functions of rates; infinite where they have no bound at a singular end.

    Args:
        motion: The motion.
        values: The functions.
        nodes: Values of the functions at the nodes of the motion, where they are known.
    """
    if not motion.panels:
        return Extremum(np.inf, 0, 0, -1.0)
    nodes = at_nodes(motion, values) if nodes is None else nodes
    if motion.ending is Ending.SINGULAR:
        *before, last = np.nan_to_num(nodes.reshape(-1, nodes.shape[2]), nan=np.inf)
        fastest = int(last.argmax())
        if last[fastest] > _DIVERGENCE * np.abs(before).max():
            return Extremum(np.inf, fastest, motion.panels - 1, 1.0)
    return maximum(nodes, values)


def largest_magnitude(
    motion: Motion, vectors: Function, nodes: Array | None = None
) -> tuple[float, float]:
    """The largest magnitude of a vector that depends on rates, and its time [s].

    Arguments as of :func:`peak`.
    """

    def squared(panel: IntArray, x: Array) -> Array:
        """Smooth also where the vector passes through zero."""
        return np.asarray((vectors(panel, x) ** 2).sum(axis=1, keepdims=True))

    squares = None if nodes is None else (nodes * nodes).sum(axis=2, keepdims=True)
    place = peak(motion, squared, squares)
    return float(np.sqrt(place.value)), motion.time_at(place.u)


def rates_along(motion: Motion) -> Callable[[IntArray, Array], Rates]:
    """The rates along a motion, by panels and their parameters."""
    law = motion.law
    return lambda panel, x: law.rates(*motion.at(panel, x), motion.timing_segment(panel))


def efforts_along(motion: Motion) -> Callable[[IntArray, Array], Forces]:
    """Rates, accelerations and forces along a motion, by panels and their parameters."""
    law = motion.law
    return lambda panel, x: law.effort(*motion.at(panel, x), motion.timing_segment(panel))


class Limit(ABC, Generic[Bound]):
    """A limited quantity of motions; an instance is prepared for the motions in a setting.

    Attributes:
        name: Attribute of :class:`~freefloat.limits.limits.Limits`, and key of scenario files.
        unit: Unit of the quantity.
        exponent: How its ratio falls with the duration, see
            :class:`~freefloat.limits.result.LimitResult`.
        value: What its bound is, of limits that are attributes of ``Limits``.
        description: Description of the key of scenario files, likewise.
        of_attitude: Whether it depends on the attitudes of bodies alone: ensembles of motions
            consider it, and the feasible set has only attitudes that keep it.
        decides_sooner: Whether ``decide`` ends before the extreme value is found.
        accuracy: Absolute error of the extreme value [unit].
        bound: The bound.
    """

    name: ClassVar[str]
    unit: ClassVar[str]
    exponent: ClassVar[int] = 0
    value: ClassVar[Value]
    description: ClassVar[str]
    of_attitude: ClassVar[bool] = False
    decides_sooner: ClassVar[bool] = False
    accuracy: ClassVar[float] = 1e-9

    def __init__(self, setting: Setting, bound: Bound) -> None:
        """Prepare the limit for motions in a setting."""
        self.bound = bound

    @classmethod
    def bound_of(cls, setting: Setting, limits: object) -> Bound | None:
        """The bound in a setting under some ``Limits``; None where the limit does not apply."""
        bound: Bound | None = getattr(limits, cls.name)
        return bound

    @classmethod
    def of(cls, setting: Setting, limits: object) -> Self | None:
        """The limit in a setting under some ``Limits``; None where it does not apply."""
        bound = cls.bound_of(setting, limits)
        return None if bound is None else cls(setting, bound)

    def places(self, setting: Setting) -> tuple[str, ...]:
        """What ``where`` of its results may be: joints, unless it is a limit of other things."""
        return setting.model.joint_names

    @abstractmethod
    def worst(self, motion: Motion) -> LimitResult:
        """The result at the instant at which a motion is nearest to the bound, or beyond it."""

    def decide(self, motion: Motion) -> LimitResult:
        """A result that shows whether the limit is kept; its value need not be the extreme one."""
        return self.worst(motion)

    def result(
        self, worst: float, allowed: float, ratio: float, time: float, where: str, **others: Any
    ) -> LimitResult:
        """A result of this limit, kept where its ratio is at most 1; others are its attributes."""
        values: dict[str, Any] = {"kept": bool(ratio <= 1.0 + ROUNDING), "unit": self.unit} | others
        values |= {"limit": self.name, "time": time, "where": where, "exponent": self.exponent}
        return LimitResult(worst=float(worst), allowed=float(allowed), ratio=float(ratio), **values)


class JointLimit(Limit[Bound]):
    """A limit of every joint; ``unit`` is the unit of revolute joints."""

    prismatic_unit: ClassVar[str] = ""  # unit of prismatic joints; empty where it is the same

    def of_joint(self, motion: Motion, joint: int, **values: Any) -> LimitResult:
        """The result of the joint with a number, with its unit and name."""
        model = motion.model
        unit = self.prismatic_unit if model.prismatic[joint] else ""
        return self.result(where=model.joint_names[joint], unit=unit or self.unit, **values)


class MagnitudeLimit(JointLimit[Array]):
    """A limit of the magnitude of a quantity of every joint; ``bound`` has the shape (n,)."""

    def largest(self, motion: Motion, values: Function, nodes: Array | None = None) -> LimitResult:
        """The result where the ratio of any joint is largest.

        Args:
            motion: The motion.
            values: The limited values, shape (K, n).
            nodes: Values at the nodes of the motion, where they are known, (panels, nodes, n).
        """
        allowed = self.bound

        def ratios(panel: IntArray, x: Array) -> Array:
            ratio = values(panel, x) / allowed
            return np.concatenate([ratio, -ratio], axis=1)

        if nodes is not None:
            nodes = np.concatenate([nodes / allowed, -nodes / allowed], axis=2)
        place = peak(motion, ratios, nodes)
        joint = place.index % len(allowed)
        worst = np.inf
        if np.isfinite(place.value):
            worst = values(np.array([place.panel]), np.array([place.x]))[0, joint]
        return self.of_joint(
            motion, joint, worst=worst, allowed=allowed[joint], ratio=place.value,
            time=motion.time_at(place.u),
        )  # fmt: skip


@dataclass(frozen=True)
class Number:
    """A number; an angle is in radians, and in scenario files in degrees."""

    zero: bool = False  # whether the number may be zero
    most: float = LARGEST_NUMBER  # the largest number that is accepted
    angle: bool = False  # whether the number is an angle

    def checked(self, key: str, value: Any) -> float:
        """The value as a float; an InputError that names a key unless it is such a number."""
        least = 0.0 if self.zero else float(np.finfo(float).tiny)
        accepted = f"a number {'from' if self.zero else 'above'} 0, up to {self.most:g}"
        return finite_number(key, value, accepted, least, self.most)

    def require_applicable(self, key: str, value: float, model: FreeFloatingModel) -> None:
        """Any number is one of any robot."""


@dataclass(frozen=True)
class NumberOrOff(Number):
    """A number, or ``"off"``: the limit applies by default, and can be switched off."""

    def checked(self, key: str, value: Any) -> Any:
        """The value as a float or ``"off"``, for which ``False`` stands, too; else an error."""
        if value is False or (isinstance(value, str) and value == OFF):
            return OFF
        try:
            return super().checked(key, value)
        except InputError as error:
            raise InputError(key, error.problem, f"{error.accepted}, or '{OFF}'") from None


@dataclass(frozen=True)
class PerJoint:
    """Magnitudes of the joints, infinite for joints without a limit, shape (n,), or of all, ().

    Attributes:
        rated: Attribute of :class:`~freefloat.robot.rigid_bodies.Body` with the value of the URDF.
    """

    rated: str

    def checked(self, key: str, value: Any) -> Array:
        """The values, read-only; an InputError that names a key unless they are magnitudes."""
        accepted = "a number above zero, or an array with one for each joint"
        values = number_array(key, value, accepted)
        if values.ndim > 1 or not (values > 0.0).all():
            raise InputError(key, f"{values.tolist()} was given", accepted)
        return frozen(values)

    def require_applicable(self, key: str, value: Array, model: FreeFloatingModel) -> None:
        """Raise an InputError that names a key unless there is one for each joint of a robot."""
        if value.shape not in ((), (model.dof,)):
            accepted = f"for {', '.join(model.joint_names)}"
            raise InputError(key, f"shape {value.shape} was given", accepted)


@dataclass(frozen=True)
class Axes:
    """Axes of links with the cones inside or outside which they stay; any number of them."""

    def checked(self, key: str, value: Any) -> tuple[PointingLimit, ...]:
        """The axes, also of a single one; an InputError unless they are limits of pointing."""
        axes = tuple(value) if isinstance(value, Iterable) else (value,)
        for number, axis in enumerate(axes):
            accepted = "PointingLimit(body, axis, angle, direction=...)"
            require_type(f"{key}.{number}", axis, PointingLimit, accepted)
        return axes

    def require_applicable(
        self, key: str, value: tuple[PointingLimit, ...], model: FreeFloatingModel
    ) -> None:
        """Raise an InputError that names a key unless the axes belong to a robot's links."""
        for number, axis in enumerate(value):
            axis.require_body(model, f"{key}.{number}.body")


Value = Number | PerJoint | Axes
"""What the bound of a limit is."""
