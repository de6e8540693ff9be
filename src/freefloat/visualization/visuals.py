"""What a robot looks like: the visuals of its URDF, and made shapes where it has none."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial

from freefloat.robot.meshes import Part, read_mesh
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.names import MeshFileError, find_mesh
from freefloat.robot.shapes import Colour, MeshFile, Shape, Visual
from freefloat.robot.urdf import LinkShape
from freefloat.visualization.robot_shapes import LINK, SPACECRAFT, default_visuals


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
    robot = model.description
    load = cache(partial(_load, robot.source))
    visuals: list[Visual] = []
    missing: list[tuple[str, str]] = []
    for link in robot.links:
        body, place = model.link_places[link.name]
        for number, shown in enumerate(link.visuals, 1):
            try:
                shapes = list(_shapes(shown, number, load))
            except MeshFileError as error:
                missing.append((link.name, str(error)))
                continue
            default = shown.colour or (SPACECRAFT if body == 0 else LINK)
            at = place @ shown.origin
            visuals += [Visual(link.name, body, at, shape, own or default) for shape, own in shapes]
    parts = [link for link, (body, _) in model.link_places.items() if body == 0]
    heaviest = max(parts, key=lambda link: robot.link[link].mass)
    drawn = {one.body for one in visuals if one.body > 0 or one.name == heaviest}
    visuals += default_visuals(model, drawn)
    problems = tuple(f"link {link}: {problem}; not drawn" for link, problem in missing)
    return Look(tuple(_named(visuals)), problems)


def _shapes(
    shown: LinkShape, number: int, load: Callable[..., tuple[Part, ...]]
) -> Iterator[tuple[Shape, Colour | None]]:
    """Shapes, and the colours that a mesh file has."""
    geometry = shown.geometry
    if geometry is None or geometry == MeshFile(""):
        raise MeshFileError(f"its <visual> {number} cannot be read")
    if not isinstance(geometry, MeshFile):
        yield geometry, None
        return
    try:
        parts = load(geometry.filename, *geometry.scale)
    except MeshFileError as error:
        raise MeshFileError(f"mesh {geometry.filename}: {error}") from None
    for part in parts:
        yield part.mesh, part.colour


def _load(source: str, name: str, *scale: float) -> tuple[Part, ...]:
    """The parts of a mesh file; the very same ones wherever the robot shows it again."""
    return read_mesh(find_mesh(name, source), scale)


def _named(visuals: Iterable[Visual]) -> Iterator[Visual]:
    """The same with names that differ: a number follows where there are several."""
    names = Counter(visual.name for visual in visuals)
    taken: Counter[str] = Counter()
    for visual in visuals:
        taken[visual.name] += 1
        name = f"{visual.name} {taken[visual.name]}"
        yield visual if names[visual.name] == 1 else replace(visual, name=name)
