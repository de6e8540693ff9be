"""A limit: its name, its unit, what its bound is, and the value of a motion nearest to it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar, Generic, Self, TypeVar

from freefloat.limits.result import LimitResult
from freefloat.limits.values import Value
from freefloat.motion.margin import ROUNDING
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem

Bound = TypeVar("Bound")


class Limit(ABC, Generic[Bound]):
    """A limited quantity of motions; an instance is prepared for the motions of a problem.

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

    def __init__(self, problem: Problem, bound: Bound) -> None:
        """Prepare the limit for motions of a problem, whatever its duration."""
        self.bound = bound

    @classmethod
    def bound_of(cls, problem: Problem, limits: object) -> Bound | None:
        """The bound in a problem under some ``Limits``; None where the limit does not apply."""
        bound: Bound | None = getattr(limits, cls.name)
        return bound

    @classmethod
    def of(cls, problem: Problem, limits: object) -> Self | None:
        """The limit of a problem under some ``Limits``; None where it does not apply."""
        bound = cls.bound_of(problem, limits)
        return None if bound is None else cls(problem, bound)

    def places(self, problem: Problem) -> tuple[str, ...]:
        """What ``where`` of its results may be: joints, unless it is a limit of other things."""
        return problem.model.joint_names

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
        return LimitResult(
            limit=self.name, worst=float(worst), allowed=float(allowed), ratio=float(ratio),
            time=time, where=where, exponent=self.exponent, **values,
        )  # fmt: skip
