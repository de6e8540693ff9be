"""Poses and shapes of the bodies of a robot, as they are drawn."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from freefloat.motion.motion import Motion
from freefloat.robot.description import Colour, LinkShape
from freefloat.robot.meshes import Mesh, capsule_mesh, read_mesh
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.shapes import Box, Capsule, Cylinder, MeshFile, Sphere, corners
from freefloat.robot.source import MeshFileError, find_mesh
from freefloat.so3 import Array, Pose, axes_rotation

_SPACECRAFT: Colour = (0.72, 0.73, 0.76, 1.0)
_PANEL: Colour = (0.10, 0.20, 0.45, 1.0)
_LINKS: tuple[Colour, ...] = ((0.36, 0.66, 0.90, 1.0), (0.64, 0.86, 0.98, 1.0))
_JOINT: Colour = (0.45, 0.55, 0.68, 1.0)
_THIN, _ALIKE = 0.05, 0.22
"""Ratio of the edges of a panel; range of the red, green and blue of two greys that look alike."""
_ROD, _HUB = 0.015, 0.026
"""Radii of rods and of joints as fractions of the arm's length."""
_SMALLEST, _LARGEST = 0.05, 2.0
"""Limits of the edges of a spacecraft without visuals, as fractions of the arm's length."""
_DIRECTIONS = 400
"""View directions that are compared."""
_ELEVATIONS = (-0.1, 0.75)
"""Range of the sines of the view's elevation."""
_PATH_WEIGHT, _OTHERS_WEIGHT = 0.3, 2.0
"""Penalties on viewing a path end-on, and a body of the scene behind or before the robot, relative
to viewing the arm in front of the spacecraft."""

Shape = Box | Cylinder | Sphere | Mesh


@dataclass(frozen=True, eq=False)
class Visual:
    """A shape of a link, as it is drawn."""

    name: str  # name of the link, numbered where it has several shapes; unique in the robot
    body: int  # the rigid body that it is part of: 0 is the spacecraft, k is moved by joint k
    placement: Pose  # frame of the shape in the body's joint frame
    shape: Shape  # geometry of the shape
    colour: Colour  # colour of the whole shape


def body_poses(motion: Motion, parameters: Array) -> tuple[Array, Array]:
    """Poses in the inertial frame at panel coordinates of a motion, shape (K,).

    Returns:
        Positions [m], shape (K, n + 1 + E, 3), and rotation matrices, shape (K, n + 1 + E, 3, 3),
        of the spacecraft's root link, of every joint, and of the E end-effectors of
        :func:`tip_links`.
    """
    model = motion.model
    _, attitudes, joints = motion.evaluate(parameters)
    bodies = model.body_poses(attitudes, joints)
    tips = (model.link_places[link] for link in tip_links(model))
    poses = [*bodies, *(bodies[body] @ place for body, place in tips)]
    positions = np.stack([pose.position for pose in poses], axis=1)
    return positions, np.stack([pose.rotation for pose in poses], axis=1)


def tip_links(model: FreeFloatingModel) -> tuple[str, ...]:
    """The end-effectors of the arms that move, that on the problem's path last."""
    return (*model.further_arms.values(), model.end_effector_link)


def view_direction(motions: Sequence[Array], others: Sequence[Array] = ()) -> Array:
    """The direction to the eye with the arms in front and the paths across the picture.

    Bodies of the scene are beside the robots, neither before nor behind them.

    Args:
        motions: Positions of each motion, as of :func:`body_poses` [m], shape (K, n + 2, 3).
        others: Places of bodies of the scene [m], shape (3,) each.
    """
    arms = np.vstack([(bodies[:, 1:-1] - bodies[:, :1]).mean(axis=1) for bodies in motions])
    z = np.linspace(*_ELEVATIONS, _DIRECTIONS)
    angle = np.pi * (1.0 + np.sqrt(5.0)) * np.arange(_DIRECTIONS)
    level = np.sqrt(1.0 - z**2)
    eyes = np.column_stack([level * np.cos(angle), level * np.sin(angle), z])
    score = eyes @ (arms.mean(axis=0) / np.linalg.norm(arms, axis=1).max())
    for bodies in motions:
        path = bodies[-1, -1] - bodies[0, -1]
        length = float(np.linalg.norm(path))
        if length > 0.0:
            score = score - _PATH_WEIGHT / len(motions) * np.abs(eyes @ path) / length
    middle = np.mean([bodies.mean(axis=(0, 1)) for bodies in motions], axis=0)
    for other in others:
        aside = other - middle
        distance = max(float(np.linalg.norm(aside)), 1e-9)
        score = score - _OTHERS_WEIGHT / len(others) * np.abs(eyes @ aside) / distance
    return np.asarray(eyes[int(np.argmax(score))])


@dataclass(frozen=True, eq=False)
class Visuals:
    """Shapes of a robot, or of a body of the scene.

    Attributes:
        shapes: Shapes, each fixed to a body; shapes of a robot are named after their links.
        problems: Messages on visuals that cannot be drawn.
    """

    shapes: tuple[Visual, ...]
    problems: tuple[str, ...]


def drawn_parts(
    owner: str, shapes: Iterable[LinkShape], source: str, problems: list[str]
) -> Iterator[tuple[LinkShape, Shape, Colour | None]]:
    """Yield geometries of a link's or a body's shapes, with the colours that mesh files state.

    Messages on shapes that cannot be drawn are added to problems.
    """
    for number, shape in enumerate(shapes, start=1):
        geometry, name = shape.geometry, f"{owner}: <{shape.kind}> {number}"
        if geometry is None or geometry == MeshFile(""):
            problems.append(f"{name} cannot be read")
        elif isinstance(geometry, MeshFile):
            try:
                parts = read_mesh(find_mesh(geometry.filename, source), geometry.scale)
                yield from ((shape, part.mesh, part.colour) for part in parts)
            except MeshFileError as error:
                problems.append(f"{name}: mesh {geometry.filename}: {error}")
        else:
            yield shape, capsule_mesh(geometry) if isinstance(geometry, Capsule) else geometry, None


def robot_visuals(model: FreeFloatingModel) -> Visuals:
    """The visuals of all links, with a mesh per colour.

    A link with mass but without visuals has its collision shapes. Arm bodies without either get
    rods; a spacecraft whose heaviest link has none gets a box.
    """
    spacecraft = max(
        (link for link in model.description.links if model.link_places[link.name][0] == 0),
        key=lambda link: link.mass,
    )
    grey = next((shape.colour for shape in spacecraft.visuals if shape.colour), _SPACECRAFT)
    shapes: list[Visual] = []
    problems: list[str] = []
    drawn: set[int] = set()
    for link in model.description.links:
        body, place = model.link_places[link.name]
        seen = link.visuals or (link.collisions if link.mass > 0.0 else ())
        parts = [*drawn_parts(f"link {link.name}", seen, model.description.file, problems)]
        for number, (visual, geometry, own) in enumerate(parts, start=1):
            colour = visual.colour or _default_colour(body, visual.geometry)
            if body > 0 and np.ptp([colour[:3], grey[:3]]) < _ALIKE:
                colour = _LINKS[body % 2]
            name = link.name if len(parts) == 1 else f"{link.name} {number}"
            shapes.append(Visual(name, body, place @ visual.origin, geometry, own or colour))
        if parts and (body > 0 or link is spacecraft):
            drawn.add(body)
    shapes += _default_visuals(model, drawn, spacecraft.name)
    return Visuals(tuple(shapes), tuple(problems))


def _default_colour(body: int, geometry: object) -> Colour:
    """The colour of a shape by its role: arm link, panel or spacecraft."""
    thin = isinstance(geometry, Box) and min(geometry.size) < _THIN * max(geometry.size)
    return _LINKS[body % 2] if body > 0 else _PANEL if thin else _SPACECRAFT


def _default_visuals(
    model: FreeFloatingModel, drawn: set[int], spacecraft: str
) -> Iterator[Visual]:
    """Yield shapes for bodies without visuals.

    The spacecraft becomes the uniform box of its mass and inertia, an arm body a cylinder about
    its joint axis; a rod connects either with the next joint.
    """
    ends: list[list[Array]] = [[] for _ in model.bodies]
    for body in model.bodies[1:]:
        ends[body.parent].append(body.placement.position)
    for link in tip_links(model):
        number, place = model.link_places[link]
        ends[number].append(place.position)
    size = float(sum(np.linalg.norm(end) for end in itertools.chain(*ends[1:]))) or 1.0
    for index, (body, name) in enumerate(zip(model.bodies, model.body_names, strict=True)):
        if index in drawn:
            continue
        if index == 0:
            moments = np.diag(body.inertia)
            squares = 6.0 * (moments.sum() - 2.0 * moments) / max(body.mass, 1e-12)
            edges = np.clip(np.sqrt(np.maximum(squares, 0.0)), _SMALLEST * size, _LARGEST * size)
            yield Visual(spacecraft, 0, Pose(body.centre, np.eye(3)), Box(edges), _SPACECRAFT)
            start, name = body.centre, f"{spacecraft} mount"
        else:
            hub = Cylinder(_HUB * size, 2.5 * _HUB * size)
            start = np.zeros(3)
            yield Visual(f"{name} joint", index, Pose(start, frame_along(body.axis)), hub, _JOINT)
        for step in (end - start for end in ends[index]):
            length = float(np.linalg.norm(step))
            if length > _ROD * size:
                rod = Cylinder(_ROD * size, length)
                middle = Pose(start + step / 2.0, frame_along(step))
                yield Visual(name, index, middle, rod, _LINKS[index % 2])


def frame_along(direction: Array) -> Array:
    """A frame (3, 3) with its z axis along a direction (3,) of any length but zero."""
    across = np.eye(3)[int(np.argmin(np.abs(direction)))]
    return axes_rotation("direction", ("z", direction), ("x", across))


def bounding_box(visual: Visual) -> Array:
    """The corners of a shape's bounding box in its body's frame [m], shape (8, 3).

    z changes fastest, then y.
    """
    shape, at = visual.shape, visual.placement
    if isinstance(shape, Mesh):
        low, high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
        points = (low + high) / 2.0 + corners(Box(high - low))
    else:
        points = corners(shape)
    return np.asarray(at.position + points @ at.rotation.T)


def largest_box(visuals: Visuals, body: int) -> Array:
    """The corners of a body's largest box in its frame [m], as :func:`bounding_box`.

    Without a box among its visuals: the bounding box of the largest other shape.
    """
    shapes = [visual for visual in visuals.shapes if visual.body == body]
    boxes = [visual for visual in shapes if isinstance(visual.shape, Box)]
    return max(
        map(bounding_box, boxes or shapes),
        key=lambda box: float(np.prod(np.linalg.norm(box[[1, 2, 4]] - box[0], axis=1))),
    )
