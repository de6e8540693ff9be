"""Contact along a motion, of a robot with itself or its scene, also without a clearance."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from freefloat.errors import ModelError
from freefloat.limits.clearance import TOLERANCE, clearance
from freefloat.limits.kinds.clearance import ClearanceLimit
from freefloat.limits.pairs import CollisionPairs
from freefloat.limits.result import LimitResult
from freefloat.motion.motion import Motion
from freefloat.robot.description import LinkShape
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.shapes import MeshFile


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
    """The deepest contact along a motion of bodies that no joint connects; None without contact.

    Bodies of the problem's scene count. Less than 0.1 mm is no contact. Robots whose shapes cannot
    be used have none.

    Args:
        motion: The motion.
        results: Limits along it; a clearance that excludes contact saves the search.
    """
    clearances = (entry.worst for entry in results if entry.limit == ClearanceLimit.name)
    if any(worst > -TOLERANCE for worst in clearances):
        return None
    try:
        depth, time, bodies = _deepest(motion)
    except ModelError:
        return None
    if depth < TOLERANCE:
        return None
    return Contact(bodies, depth, time, motion.problem.path.timing.s(time))


def why_unchecked(model: FreeFloatingModel) -> str | None:
    """Reason why motions of a robot cannot be searched for contact; None where they can."""
    try:
        CollisionPairs(model, hulls=_links_with_meshes(model))
    except ModelError as error:
        return error.problem if error.key.startswith("limits.") else f"{error.key}: {error.problem}"
    return None


def _links_with_meshes(model: FreeFloatingModel) -> set[str]:
    return {link.name for link in model.description.links if _has_mesh(link.shapes)}


def _has_mesh(shapes: Iterable[LinkShape]) -> bool:
    return any(isinstance(shape.geometry, MeshFile) for shape in shapes)


def _deepest(motion: Motion) -> tuple[float, float, tuple[str, str]]:
    """Depth [m], time [s] and links of the deepest contact; a depth below zero without contact.

    Meshes count as their convex hulls, which are quick to compute, until they are in contact; only
    then are they divided into convex parts.
    """
    model, scene = motion.problem.model, motion.problem.scene
    hulls = _links_with_meshes(model) | {
        body.name for body in scene.bodies if _has_mesh(body.shapes("collision"))
    }
    while True:
        pairs = CollisionPairs(model, hulls=hulls, scene=scene)
        nearest = clearance(motion, pairs, -TOLERANCE)
        links = pairs.links(nearest.pair)
        touching = nearest.distance <= -TOLERANCE
        close = set(links) if touching else set()
        if hulls.isdisjoint(close | pairs.links_left_out):
            return -nearest.distance, nearest.time, links
        hulls -= close | pairs.links_left_out
