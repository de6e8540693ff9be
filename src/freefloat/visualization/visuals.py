"""What a robot looks like: the visuals of its URDF, and made shapes where it has none."""

from __future__ import annotations

import io
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np
import yourdfpy

from freefloat.robot.meshes import MeshFileError, Part, find_mesh, read_mesh
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.shapes import Box as Box
from freefloat.robot.shapes import Colour as Colour
from freefloat.robot.shapes import Cylinder as Cylinder
from freefloat.robot.shapes import Mesh as Mesh
from freefloat.robot.shapes import Shape as Shape
from freefloat.robot.shapes import Sphere as Sphere
from freefloat.robot.shapes import Visual as Visual
from freefloat.so3 import Array, Pose
from freefloat.visualization.robot_shapes import LINK, SPACECRAFT, default_visuals

_DRAWN = ("material", "link", "joint")


@dataclass(frozen=True, eq=False)
class Look:
    """All that is drawn of a robot.

    Attributes:
        visuals: Each fixed to one moving body.
        missing: What the URDF shows but could not be read, a sentence each.
    """

    visuals: tuple[Visual, ...]
    missing: tuple[str, ...]


def look_of(model: FreeFloatingModel) -> Look:
    """What a robot looks like.

    Bodies without visuals get boxes and rods.

    Args:
        model: Robot.

    Returns:
        Visuals of all links, those of held arms too; meshes in one piece for each colour.
    """
    robot, missing = _read(model.description.text)
    palette = _palette(robot)
    load = cache(partial(_load, model.description.source))
    visuals: list[Visual] = []
    for link in robot.links:
        body, place = model.link_places[link.name]
        for shown in link.visuals:
            try:
                shapes = list(_shapes(shown.geometry, load))
            except MeshFileError as error:
                missing.append((link.name, f"mesh {shown.geometry.mesh.filename}: {error}"))
                continue
            at = place @ _pose(shown.origin)
            told = _told(shown.material, palette) or (SPACECRAFT if body == 0 else LINK)
            visuals += [Visual(link.name, body, at, shape, own or told) for shape, own in shapes]
    masses = {link.name: link.inertial.mass for link in robot.links if link.inertial is not None}
    parts = [link for link, (body, _) in model.link_places.items() if body == 0]
    heaviest = max(parts, key=lambda link: masses.get(link, 0.0))
    drawn = {one.body for one in visuals if one.body > 0 or one.name == heaviest}
    visuals += default_visuals(model, drawn)
    problems = tuple(f"link {link}: {problem}; not drawn" for link, problem in missing)
    return Look(tuple(_named(visuals)), problems)


def _read(text: str) -> tuple[Any, list[tuple[str, str]]]:
    """The robot without what is not drawn, and by link the visuals that make no sense."""
    root = ET.fromstring(text)
    for element in [one for one in root if one.tag not in _DRAWN]:
        root.remove(element)
    for link in root.findall("link"):
        for collision in link.findall("collision"):
            link.remove(collision)
    try:
        return _parsed(root), []
    except Exception:  # the parser takes what it expects for granted
        return _without_nonsense(root)


def _without_nonsense(root: ET.Element) -> tuple[Any, list[tuple[str, str]]]:
    missing = []
    for link in root.findall("link"):
        for number, shown in enumerate(link.findall("visual"), 1):
            alone = ET.Element("robot", name="visual")
            ET.SubElement(alone, "link", name="link").append(shown)
            try:
                _parsed(alone)
            except Exception:  # likewise
                link.remove(shown)
                missing.append((str(link.get("name")), f"its <visual> {number} cannot be read"))
    for material in root.findall("material"):
        alone = ET.Element("robot", name="material")
        alone.append(material)
        try:
            _parsed(alone)
        except Exception:  # likewise
            root.remove(material)
    return _parsed(root), missing


def _parsed(root: ET.Element) -> Any:
    stream = io.BytesIO(ET.tostring(root))
    urdf = yourdfpy.URDF.load(stream, load_meshes=False, build_scene_graph=False)
    for link in urdf.robot.links:
        for shown in link.visuals:
            _check(shown.geometry)
    return urdf.robot


def _check(geometry: Any) -> None:
    """Refuse what the parser lets through: sizes that are none, meshes without a name."""
    sizes: list[Any] = [1.0]
    if geometry.box is not None:
        sizes += np.asarray(geometry.box.size, dtype=float).tolist()
    elif geometry.cylinder is not None:
        sizes += [geometry.cylinder.radius, geometry.cylinder.length]
    elif geometry.sphere is not None:
        sizes += [geometry.sphere.radius]
    elif geometry.mesh is None or not geometry.mesh.filename:
        raise ValueError("no mesh")
    if min(float(size) for size in sizes) <= 0.0:
        raise ValueError("no size")


def _palette(robot: Any) -> dict[str, Colour]:
    """Colours by the names of materials, wherever in the URDF they are told."""
    shown = [one.material for link in robot.links for one in link.visuals if one.material]
    told = [(one.name, _rgba(one)) for one in [*shown, *robot.materials]]
    return {str(name): colour for name, colour in told if colour is not None}


def _rgba(material: Any) -> Colour | None:
    if material is None or material.color is None:
        return None
    rgba = np.asarray(material.color.rgba, dtype=float)
    if rgba.shape != (4,) or not np.isfinite(rgba).all():
        return None
    red, green, blue, opacity = np.clip(rgba, 0.0, 1.0).tolist()
    return red, green, blue, opacity


def _told(material: Any, palette: dict[str, Colour]) -> Colour | None:
    return None if material is None else _rgba(material) or palette.get(str(material.name))


def _shapes(geometry: Any, load: Any) -> Iterator[tuple[Shape, Colour | None]]:
    """Shapes, and the colours that a mesh file tells itself."""
    if geometry.box is not None:
        yield Box(geometry.box.size), None
    elif geometry.cylinder is not None:
        yield Cylinder(float(geometry.cylinder.radius), float(geometry.cylinder.length)), None
    elif geometry.sphere is not None:
        yield Sphere(float(geometry.sphere.radius)), None
    else:
        scale = 1.0 if geometry.mesh.scale is None else geometry.mesh.scale
        for part in load(geometry.mesh.filename, *np.broadcast_to(scale, 3).tolist()):
            yield part.mesh, part.colour


def _load(source: str, name: str, *scale: float) -> tuple[Part, ...]:
    """The parts of a mesh file; the very same ones wherever the robot shows it again."""
    return read_mesh(find_mesh(name, source), scale)


def _pose(origin: Array | None) -> Pose:
    return Pose(np.zeros(3), np.eye(3)) if origin is None else Pose(origin[:3, 3], origin[:3, :3])


def _named(visuals: Iterable[Visual]) -> Iterator[Visual]:
    """The same with names that differ: a number follows where there are several."""
    names = Counter(visual.name for visual in visuals)
    taken: Counter[str] = Counter()
    for visual in visuals:
        taken[visual.name] += 1
        name = f"{visual.name} {taken[visual.name]}"
        yield visual if names[visual.name] == 1 else replace(visual, name=name)
