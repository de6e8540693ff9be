"""Limits of the joints, whose units depend on their types."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from freefloat.limits.extremes import peak
from freefloat.limits.limit import Bound, Limit
from freefloat.limits.result import LimitResult
from freefloat.motion.extrema import Function
from freefloat.motion.motion import Motion
from freefloat.so3 import Array, IntArray


class JointLimit(Limit[Bound]):
    """A limit of every joint; ``unit`` is that of revolute joints.

    Attributes:
        prismatic_unit: Unit of prismatic joints.
    """

    prismatic_unit: ClassVar[str]

    def of_joint(self, motion: Motion, joint: int, **values: Any) -> LimitResult:
        """The result of the joint with a number, with its unit and name."""
        model = motion.problem.model
        unit = self.prismatic_unit if model.prismatic[joint] else self.unit
        return self.result(where=model.joint_names[joint], unit=unit, **values)


class MagnitudeLimit(JointLimit[Array]):
    """A limit of the magnitude of a quantity of every joint; ``bound`` has the shape (n,)."""

    def largest(self, motion: Motion, values: Function, nodes: Array | None = None) -> LimitResult:
        """The result where the ratio of any joint is largest.

        Args:
            motion: The motion.
            values: The limited values, shape (K, n).
            nodes: Those at the nodes of the motion, where they are known, (panels, nodes, n).
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
