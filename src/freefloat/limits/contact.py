"""Contact along a motion, of a robot with itself or its scene, where it is no limit."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from freefloat.limits.kinds.clearance import ClearanceLimit, have_shapes
from freefloat.limits.result import LimitResult
from freefloat.motion.motion import Motion
from freefloat.robot.model import FreeFloatingModel
from freefloat.scene.scene import Scene


@dataclass(frozen=True)
class Contact:
    """The deepest contact of two bodies along a motion.

    Attributes:
        bodies: Links that overlap, the one nearer to the spacecraft first, or a link and a body of
            the scene.
        depth: Penetration depth [m].
        time: Its time [s].
        s: Path parameter at that time.
    """

    bodies: tuple[str, str]
    depth: float
    time: float
    s: float

    def __str__(self) -> str:
        first, second = self.bodies
        return f"{second} overlaps {first} by {self.depth:.3g} m at t = {self.time:.4f} s"

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        return {"bodies": [*self.bodies], "depth": self.depth, "time": self.time, "s": self.s}


def deepest_contact(motion: Motion, results: Iterable[LimitResult] = ()) -> Contact | None:
    """The deepest contact along a motion, of the pairs whose contact is a limit by default.

    None without contact of more than 0.1 mm, and where a limit of the clearance shows it.

    Args:
        motion: The motion.
        results: Limits along it.
    """
    if any(entry.limit == ClearanceLimit.name for entry in results):
        return None
    limit = ClearanceLimit.of_contact(motion.problem)
    if limit is None or not len(limit.pairs.pairs):
        return None
    from freefloat.limits.clearance import TOLERANCE, clearance  # coal and trimesh import slowly

    nearest = clearance(motion, limit.pairs, -TOLERANCE)
    if nearest.distance > -TOLERANCE:
        return None
    s = motion.problem.path.timing.s(nearest.time)
    return Contact(limit.pairs.links(nearest.pair), -nearest.distance, nearest.time, s)


def why_unchecked(model: FreeFloatingModel) -> str | None:
    """Reason why no motion of a robot is in contact with itself; None where one may be."""
    if not have_shapes(model, Scene()):
        return "fewer than two links have <collision> shapes; limits.clearance takes visuals, too"
    from freefloat.limits.pairs import CollisionPairs  # coal and trimesh import slowly

    pairs = CollisionPairs(model, stated=False)
    if len(pairs.pairs):
        return None
    return "; ".join(pairs.left_out) or (
        "joints connect all links with <collision> shapes, or <disable_collisions> has them"
    )
