"""The limit of the distance between bodies."""

from __future__ import annotations

import numpy as np

from freefloat.limits.limit import Limit
from freefloat.limits.result import LimitResult
from freefloat.limits.values import Number
from freefloat.motion.margin import ROUNDING
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem


class ClearanceLimit(Limit[float]):
    """Distance between bodies that no joint connects, and between robot and scene.

    Attributes:
        pairs: The pairs of shapes that may collide.
    """

    name = "clearance"
    unit = "m"
    value = Number(zero=True)
    description = (
        "Smallest distance [m] between bodies that are not neighbours, and between the robot and "
        "the bodies of the scene; 0: no contact."
    )
    decides_sooner = True
    accuracy = 2e-4

    def __init__(self, problem: Problem, bound: float) -> None:
        """Prepare the pairs; a ModelError where the robot's shapes cannot be used."""
        from freefloat.limits.pairs import CollisionPairs  # coal and trimesh import slowly

        super().__init__(problem, bound)
        self.pairs = CollisionPairs(problem.model, bound, scene=problem.scene)

    def worst(self, motion: Motion) -> LimitResult:
        """The smallest distance."""
        return self._smallest(motion, decide_only=False)

    def decide(self, motion: Motion) -> LimitResult:
        """The smallest distance, or, of a violated limit, one that is too small."""
        return self._smallest(motion, decide_only=True)

    def _smallest(self, motion: Motion, *, decide_only: bool) -> LimitResult:
        from freefloat.limits.clearance import clearance  # coal and trimesh import slowly

        threshold = self.bound * (1.0 - ROUNDING)
        below = threshold if decide_only else np.inf
        nearest = clearance(motion, self.pairs, below, decide_only=decide_only)
        distance = nearest.distance
        ratio = np.inf if distance <= 0.0 else self.bound / distance
        return self.result(
            distance, self.bound, ratio, nearest.time, self.pairs.name(nearest.pair),
            kept=distance > 0.0 and distance >= threshold, at_least=True,
            notes=self.pairs.left_out,
        )  # fmt: skip
