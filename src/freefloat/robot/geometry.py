"""How large the links of a URDF are: rigid bodies, the joints that leave them, drawn shapes."""

from __future__ import annotations

import itertools
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from freefloat.robot.urdf_text import UrdfText, plain_number, plain_numbers
from freefloat.robot.validation_errors import MOVING, end_of, mass_of
from freefloat.so3 import Array, Pose

_HERE = Pose(np.zeros(3), np.eye(3))


@dataclass(frozen=True, eq=False)
class RigidGroup:
    """Links that are fixed to each other: one rigid body.

    Attributes:
        places: Every link and where it stands in the frame of the first one.
        ends: Where moving joints leave it, in that frame [m], by the link that each moves.
    """

    places: dict[str, Pose]
    ends: dict[str, Array]

    @property
    def first(self) -> str:
        """The link that the joint above it moves."""
        return next(iter(self.places))

    @property
    def span(self) -> Array:
        """From its own joint to the farthest next one, else to the farthest frame [m], (3,)."""
        points = list(self.ends.values()) or [place.position for place in self.places.values()]
        return max(points, key=lambda point: float(np.linalg.norm(point)))


@dataclass(frozen=True, eq=False)
class RobotGeometry:
    """The lengths of a robot, as far as its URDF tells them; wrong numbers count as zero."""

    urdf: UrdfText

    @cached_property
    def links(self) -> dict[str, ET.Element]:
        """By name."""
        return {str(link.get("name")): link for link in self.urdf.links}

    @cached_property
    def _joints_below(self) -> dict[str, list[ET.Element]]:
        below: dict[str, list[ET.Element]] = {}
        for joint in self.urdf.joints:
            below.setdefault(str(end_of(joint, "parent")), []).append(joint)
        return below

    @cached_property
    def roots(self) -> list[str]:
        """Links that no joint carries."""
        carried = {end_of(joint, "child") for joint in self.urdf.joints}
        return [link for link in self.links if link not in carried]

    @cached_property
    def fixtures(self) -> dict[str, RigidGroup]:
        """Every rigid body by its first link: those of the roots, then those that joints move."""
        moved = [str(end_of(joint, "child")) for joint in self.urdf.joints
                 if joint.get("type") in MOVING]  # fmt: skip
        return {link: self._fixture(link) for link in (*self.roots, *moved) if link in self.links}

    def _fixture(self, first: str) -> RigidGroup:
        places, ends = {first: _HERE}, {}
        todo = [first]
        for link in todo:
            for joint in self._joints_below.get(link, []):
                child, place = str(end_of(joint, "child")), places[link] @ placed(joint)
                if joint.get("type") in MOVING:
                    ends[child] = place.position
                elif child in self.links and child not in places:
                    places[child] = place
                    todo.append(child)
        return RigidGroup(places, ends)

    @cached_property
    def longest_arm(self) -> float:
        """Sum of the distances between the joints of the longest arm, to its last frame [m]."""
        reaches = [self._reach(end, root) for root in self.roots
                   for end in self.fixtures[root].ends]  # fmt: skip
        return max(reaches, default=0.0)

    def _reach(self, first: str, root: str) -> float:
        longest, todo, seen = 0.0, [(first, 0.0)], {root}
        while todo:
            link, way = todo.pop()
            if link in seen or link not in self.fixtures:
                longest = max(longest, way)
                continue
            seen.add(link)
            body = self.fixtures[link]
            if not body.ends:
                longest = max(longest, way + float(np.linalg.norm(body.span)))
            for end, point in body.ends.items():
                todo.append((end, way + float(np.linalg.norm(point))))
        return longest

    def mass(self, body: RigidGroup) -> float:
        """Mass of a rigid body [kg]."""
        return sum(mass_of(self.links[link]) for link in body.places)

    def centre(self, body: RigidGroup) -> Array:
        """Centre of mass of a rigid body in the frame of its first link [m], shape (3,)."""
        moment = np.zeros(3)
        for link, place in body.places.items():
            own = placed(self.links[link].find("inertial")).position
            moment += mass_of(self.links[link]) * (place @ Pose(own, np.eye(3))).position
        return np.asarray(moment / self.mass(body))

    def known_points(self, link: str) -> list[Array]:
        """Where a link certainly is, in its frame [m]: the next joints, corners of drawn shapes.

        A link that ends where it begins reaches back to the joint before.
        """
        points = [placed(joint).position for joint in self._joints_below.get(link, [])]
        for part in ("visual", "collision"):
            for drawn in self.links[link].findall(part):
                points += _corners(drawn)
        if not np.any(points):
            own = [joint for joint in self.urdf.joints if end_of(joint, "child") == link]
            points = [-placed(joint).rotation.T @ placed(joint).position for joint in own]
        return [np.zeros(3), *points]


def placed(owner: ET.Element | None) -> Pose:
    """The ``<origin>`` of a joint, an inertial or a shape."""
    origin = None if owner is None else owner.find("origin")
    if origin is None:
        return _HERE
    position, turn = (plain_numbers(origin, key, "0 0 0") for key in ("xyz", "rpy"))
    position[np.isnan(position)] = 0.0
    turned = np.isfinite(turn).all() and turn.any()
    return Pose(position, Rotation.from_euler("xyz", turn).as_matrix() if turned else np.eye(3))


def _corners(drawn: ET.Element) -> Iterator[Array]:
    """Corners of the box around a plain shape; a mesh has none before its file is read."""
    place = placed(drawn)
    half = _half_edges(drawn)
    if half is not None and np.isfinite(half).all():
        for signs in itertools.product((-1.0, 1.0), repeat=3):
            yield place.position + place.rotation @ (np.array(signs) * half)


def _half_edges(drawn: ET.Element) -> Array | None:
    box, cylinder, sphere = (drawn.find(f"geometry/{tag}") for tag in ("box", "cylinder", "sphere"))
    if box is not None:
        return plain_numbers(box, "size", "0 0 0") / 2.0
    if cylinder is not None:
        radius = plain_number(cylinder, "radius")
        return np.array([radius, radius, plain_number(cylinder, "length") / 2.0])
    return None if sphere is None else np.full(3, plain_number(sphere, "radius"))
