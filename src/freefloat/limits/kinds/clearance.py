"""The limit of the distance between bodies: the one stated, else none may touch."""

from __future__ import annotations

from typing import Any, Self

import numpy as np

from freefloat.limits.limit import OFF, Limit, NumberOrOff
from freefloat.limits.result import LimitResult
from freefloat.motion.margin import ROUNDING
from freefloat.motion.motion import Motion
from freefloat.motion.setting import Setting
from freefloat.robot.model import FreeFloatingModel
from freefloat.scene.scene import Scene

_NO_PAIR = "no pair"
"""What is compared where no two bodies can touch."""


class ClearanceLimit(Limit[float]):
    """Distance between bodies that no joint connects, and between robot and scene.

    Attributes:
        pairs: The pairs of shapes that may collide.
    """

    name = "clearance"
    unit = "m"
    value = NumberOrOff(zero=True)
    description = (
        "Smallest distance [m] between bodies that are not neighbours, and between the robot and "
        "the bodies of the scene; 0: no contact, which is the default for collision shapes; "
        "``off`` or ``false``: contact is no limit."
    )
    decides_sooner = True
    accuracy = 2e-4

    def __init__(self, setting: Setting, bound: float, *, stated: bool = True) -> None:
        """Prepare the pairs.

        Args:
            setting: Robot and scene.
            bound: The smallest distance [m].
            stated: Whether it was asked for: then visuals of links without collision shapes count,
                and a ModelError is raised where the robot's shapes cannot be used.
        """
        from freefloat.limits.pairs import CollisionPairs  # coal and trimesh import slowly

        super().__init__(setting, bound)
        self.pairs = CollisionPairs(setting.model, bound, setting.scene, stated=stated)

    @classmethod
    def of(cls, setting: Setting, limits: Any) -> Self | None:
        """See :class:`~freefloat.limits.limit.Limit`."""
        stated = limits.clearance
        if stated is None:
            return cls.of_contact(setting)
        return None if stated == OFF else cls(setting, stated)

    @classmethod
    def of_contact(cls, setting: Setting) -> Self | None:
        """The limit where none is stated: no contact; None where nothing has collision shapes."""
        if not have_shapes(setting.model, setting.scene):
            return None
        limit = cls(setting, 0.0, stated=False)
        return limit if len(limit.pairs.pairs) or limit.pairs.left_out else None

    def places(self, setting: Setting) -> tuple[str, ...]:
        """See :class:`~freefloat.limits.limit.Limit`."""
        return tuple(map(self.pairs.name, range(len(self.pairs.pairs)))) or (_NO_PAIR,)

    def worst(self, motion: Motion) -> LimitResult:
        """The smallest distance."""
        return self._smallest(motion, decide_only=False)

    def decide(self, motion: Motion) -> LimitResult:
        """The smallest distance, or, of a violated limit, one that is too small."""
        return self._smallest(motion, decide_only=True)

    def _smallest(self, motion: Motion, *, decide_only: bool) -> LimitResult:
        from freefloat.limits.clearance import clearance  # coal and trimesh import slowly

        pairs, notes = self.pairs, self.pairs.left_out
        if not len(pairs.pairs):
            start = motion.time_at(0.0)
            return self.result(np.inf, self.bound, 0.0, start, _NO_PAIR, at_least=True, notes=notes)
        threshold = self.bound * (1.0 - ROUNDING)
        below = threshold if decide_only else np.inf
        nearest = clearance(motion, pairs, below, decide_only=decide_only)
        distance = nearest.distance
        ratio = np.inf if distance <= 0.0 else self.bound / distance
        return self.result(
            distance, self.bound, ratio, nearest.time, pairs.name(nearest.pair),
            kept=distance > 0.0 and distance >= threshold, at_least=True, notes=notes,
        )  # fmt: skip


def have_shapes(model: FreeFloatingModel, scene: Scene) -> bool:
    """Whether two bodies have collision shapes, one of them a link of the robot."""
    links = sum(bool(link.collisions) for link in model.description.links)
    return links > 0 and links + len(scene.bodies) > 1
