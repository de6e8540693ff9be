"""Shapes for links without visuals: rods, hubs, a gripper and a box, from joints and masses."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.shapes import Box, Colour, Cylinder, Shape, Sphere, Visual, along
from freefloat.so3 import Array, Pose

BUS: Colour = (0.75, 0.77, 0.80, 1.0)
ROD: Colour = (0.93, 0.94, 0.95, 1.0)
HUB: Colour = (0.95, 0.55, 0.15, 1.0)
TIP: Colour = (0.20, 0.60, 0.55, 1.0)

_ROD = 0.015
_HUB = 0.026
_HUB_LENGTH = 0.065
_FINGER = 0.045
"""Radii and lengths as shares of the arm's length."""


@dataclass(frozen=True, eq=False)
class Connection:
    """A joint of the URDF, moving, held or fixed.

    Attributes:
        parent: Name of a link.
        child: Name of the link behind the joint.
        place: Of the joint's frame in the parent's, the joint at zero.
        axis: Unit vector in the joint's frame, shape (3,); None for a fixed joint.
        stroke: Ends of a sliding joint's range [m]; None for every other joint.
    """

    parent: str
    child: str
    place: Pose
    axis: Array | None
    stroke: tuple[float, float] | None


@dataclass(frozen=True, eq=False)
class Mass:
    """Mass of a link.

    Attributes:
        mass: [kg].
        centre: Frame of the inertia, its origin the centre of mass, in the link's frame.
        inertia: About the centre of mass [kg m²], shape (3, 3).
    """

    mass: float
    centre: Pose
    inertia: Array


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A robot as joints and masses.

    Attributes:
        model: The robot.
        connections: All joints of its URDF.
        masses: Of every link that has one, by name.
    """

    model: FreeFloatingModel
    connections: Sequence[Connection]
    masses: dict[str, Mass]

    @cached_property
    def length(self) -> float:
        """Length of the arm [m], from which all sizes follow."""
        first, *others = self.model.bodies[1:]
        steps = [*(body.placement.position for body in others), self.model.tool.position]
        strokes = [abs(end) for body in self.model.bodies[1:] if body.prismatic
                   for end in (body.lower, body.upper) if np.isfinite(end)]  # fmt: skip
        length = float(sum(np.linalg.norm(step) for step in steps) + sum(strokes))
        return length or float(np.linalg.norm(first.placement.position)) or 1.0

    @cached_property
    def bus(self) -> str:
        """The heaviest link of the spacecraft."""
        places = self.model.link_places
        links = [link for link, (body, _) in places.items() if body == 0]
        return max(links, key=lambda link: self.masses[link].mass if link in self.masses else 0.0)

    @cached_property
    def hand(self) -> str:
        """The end-effector's link; where it is a joint's frame, the link behind that joint."""
        places, end, last = self.model.link_places, self.model.end_effector, self.model.dof
        if end in places:
            return end
        tool = self.model.tool.position
        near = {link: float(np.linalg.norm(place.position - tool))
                for link, (body, place) in places.items() if body == last}  # fmt: skip
        return min(near, key=lambda link: near[link])

    @cached_property
    def bearing(self) -> frozenset[str]:
        """Links that matter: with mass, moved, or the hand; and all between them and the root."""
        above = {one.child: one.parent for one in self.connections}
        wanted = {link for link, mass in self.masses.items() if mass.mass > 0.0} | {self.hand}
        stack = [*wanted, *(one.child for one in self.connections if one.axis is not None)]
        for link in stack:
            wanted.add(link)
            if link in above and above[link] not in wanted:
                stack.append(above[link])
        return frozenset(wanted)

    @cached_property
    def palm(self) -> Pose:
        """Where the gripper's fingers begin, z along them, in the last body's frame."""
        tool, finger = self.model.tool, _FINGER * self.length
        distance = float(np.linalg.norm(tool.position))
        direction = tool.position if distance > 2.0 * finger else tool.rotation[:, 2]
        back = finger * direction / np.linalg.norm(direction) if distance > 2.0 * finger else 0.0
        return along(tool.position - back, direction)


def made_visuals(skeleton: Skeleton, links: Iterable[str]) -> Iterator[Visual]:
    """Shapes that stand for links; each of them gets one at least if it has mass or moves.

    Args:
        skeleton: The robot.
        links: Names of links.

    Returns:
        Visuals that bear their link's name, several the same.
    """
    for link in links:
        body, place = skeleton.model.link_places[link]
        shapes = list(_shapes(skeleton, link, place))
        if not shapes and link in skeleton.masses:
            at = place @ skeleton.masses[link].centre
            shapes = [(at, Sphere(2.0 * _ROD * skeleton.length), ROD)]
        for placement, shape, colour in shapes:
            yield Visual(link, body, placement, shape, colour)


def _shapes(skeleton: Skeleton, link: str, place: Pose) -> Iterator[tuple[Pose, Shape, Colour]]:
    start = place.position
    if link == skeleton.bus:
        box, at = _bus(skeleton, place)
        start = at.position
        yield at, box, BUS
    for one in skeleton.connections:
        if one.child == link and one.axis is not None:
            size = skeleton.length
            yield (
                along(place.position, place.rotation @ one.axis),
                Cylinder(_HUB * size, _HUB_LENGTH * size), HUB,
            )  # fmt: skip
        if one.parent == link and one.child in skeleton.bearing:
            yield from _towards(skeleton, start, place @ one.place, one)
    if link == skeleton.hand:
        yield from _gripper(skeleton)


def _towards(
    skeleton: Skeleton, start: Array, end: Pose, joint: Connection
) -> Iterator[tuple[Pose, Shape, Colour]]:
    """A rod to a joint, and the rail on which a sliding one runs."""
    radius, target = _ROD * skeleton.length, end.position
    if joint.child == skeleton.hand and joint.axis is None:
        target = skeleton.palm.position
    yield from _rod(start, target, radius)
    if joint.axis is not None and joint.stroke is not None:
        ends = np.clip(joint.stroke, -skeleton.length, skeleton.length)
        low, high = (end.position + s * (end.rotation @ joint.axis) for s in ends)
        yield from _rod(low, high, 0.5 * radius)


def _rod(start: Array, end: Array, radius: float) -> Iterator[tuple[Pose, Shape, Colour]]:
    length = float(np.linalg.norm(end - start))
    if length > radius:  # a shorter one would hide in the hub
        yield along((start + end) / 2.0, end - start), Cylinder(radius, length), ROD


def _gripper(skeleton: Skeleton) -> Iterator[tuple[Pose, Shape, Colour]]:
    """A palm and two fingers, their tips at the end-effector where the last link is long enough."""
    finger, palm = _FINGER * skeleton.length, skeleton.palm
    width, depth = 0.9 * finger, 0.45 * finger
    yield palm, Box(np.array([width + 0.3 * finger, depth, 0.3 * finger])), TIP
    for side in (-0.5, 0.5):
        at = palm @ Pose(np.array([side * width, 0.0, 0.5 * finger]), np.eye(3))
        yield at, Box(np.array([0.2 * finger, depth, finger])), TIP


def _bus(skeleton: Skeleton, place: Pose) -> tuple[Box, Pose]:
    """The box of uniform density with the mass and inertia of the spacecraft's heaviest link.

    It is cut down to bounds set by the arm, and to where it leaves the first joint in the open.
    """
    size = skeleton.length
    if skeleton.bus not in skeleton.masses:
        return Box(np.full(3, 0.15 * size)), place
    mass = skeleton.masses[skeleton.bus]
    inertia = mass.inertia.copy()
    inertia[np.abs(inertia) < 1e-6 * np.trace(inertia)] = 0.0  # axes of a cube are its link's
    moments, axes = np.linalg.eigh(inertia)
    axes[:, 2] *= np.linalg.det(axes)
    squares = 6.0 * (moments.sum() - 2.0 * moments) / max(mass.mass, 1e-12)
    edges = np.clip(np.sqrt(np.maximum(squares, 0.0)), 0.05 * size, 2.0 * size)
    at = place @ mass.centre @ Pose(np.zeros(3), axes)
    first = at.rotation.T @ (skeleton.model.bodies[1].placement.position - at.position)
    share = np.abs(first) / (edges / 2.0)
    nearest = int(np.argmax(share))
    if share[nearest] < 1.0:
        edges[nearest] *= max(share[nearest], 0.1)
    return Box(edges), at
