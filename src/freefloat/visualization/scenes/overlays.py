"""Geometry around the robot: path, trail, areas, momentum, axes, mark of an early end."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt
from meshcat import geometry as g
from trimesh.creation import icosphere, revolve

from freefloat.motion.motion import Ending, Motion
from freefloat.motion.setting import Setting
from freefloat.regions.workspace import Workspace
from freefloat.so3 import Array, IntArray, Pose
from freefloat.visualization.scenes.description import Label
from freefloat.visualization.scenes.scene_builder import SceneBuilder

PATH, TRAIL, AREAS = "End-effector path", "Trail", "Areas"
CENTRE, MOMENTUM = "Centre of mass", "Momentum"
TABLE = "Table"
BASE_AXES, END_EFFECTOR_AXES, SINGULARITY = "Spacecraft axes", "End-effector axes", "Singularity"
ITEMS = (PATH, TRAIL, AREAS, CENTRE, MOMENTUM, BASE_AXES, END_EFFECTOR_AXES, SINGULARITY)
"""Nodes of the scene tree that can be hidden, and their names on the page."""

_PALE = (0.85, 0.88, 0.92, 0.55)
_GOLD = (1.0, 0.84, 0.2, 1.0)
_RED = (0.95, 0.25, 0.1, 1.0)
_DEPENDENT = (0.62, 0.66, 0.75)
_INDEPENDENT = (0.0, 0.62, 0.45)
_GRANITE = (0.36, 0.38, 0.42, 1.0)
_AXES = (0.90, 0.25, 0.20, 1.0), (0.25, 0.75, 0.30, 1.0), (0.30, 0.50, 1.00, 1.0)

Surface = tuple[Array, IntArray]
"""Vertices (V, 3) [m] and faces (F, 3)."""
_WAY_POINTS = 201
"""Points of the line of a path."""
SIDES = 10
"""Corners of the cross-section of a tube."""
_AROUND = 96
"""Corners of the cross-section of a surface of revolution."""


def thickness(setting: Setting) -> float:
    """The radius of lines [m]."""
    return 0.006 * setting.reach()


def draw_path(builder: SceneBuilder, root: str, motion: Motion) -> list[Label]:
    """Draw paths as thin tubes; return the labels of their ends."""
    labels = []
    for name, poses in motion.ways(_WAY_POINTS).items():
        points = poses.position
        if not np.ptp(points, axis=0).any():
            labels.append(Label(f"{name} path".strip(), points[0].tolist(), PATH))
            continue
        line = tube(points, 0.5 * thickness(motion.setting))
        builder.mesh(f"{root}/{PATH}/{name}".rstrip("/"), line, _PALE, shaded=False)
        for text, point in (("start", points[0]), ("end", points[-1])):
            labels.append(Label(f"{name} {text}".strip(), point.tolist(), PATH))
    return labels


def draw_trail(
    builder: SceneBuilder, path: str, size: float, points: Array, colours: Array
) -> None:
    """Draw positions of an end-effector [m], shape (K, 3), as a thick tube, unless it rests.

    The tube has the radius ``size`` [m].
    """
    if np.ptp(points, axis=0).max() > 1e-4 * size:
        vertices, faces = tube(points, size)
        builder.coloured_mesh(path, vertices, faces, np.repeat(colours, SIDES, axis=0))


def draw_areas(builder: SceneBuilder, root: str, motion: Motion, areas: Workspace) -> None:
    """Draw path-dependent and path-independent areas: rings in the plane, spheres in space."""
    kinds = [(areas.path_dependent, _DEPENDENT), (areas.path_independent, _INDEPENDENT)]
    parts = [(interval, colour) for intervals, colour in kinds for interval in intervals or ()]
    setting, first = motion.setting, motion.initial
    start = setting.model.end_effector_pose(first.attitude, first.joints)
    for number, ((inner, outer), colour) in enumerate(sorted(parts), start=1):
        path = f"{root}/{AREAS}/{number}"
        if setting.has_headings:
            plane = setting.plane
            level = float(plane.normal @ start.position) - 3.0 * thickness(setting)
            vertices, faces = surface_of_revolution([level, level], [inner, outer])
            builder.mesh(path, (vertices @ plane.axes.T, faces), (*colour, 0.25), shaded=False)
        else:
            ball = icosphere(subdivisions=4, radius=outer)
            builder.mesh(path, (ball.vertices, ball.faces), (*colour, 0.10))


def draw_table(builder: SceneBuilder, root: str, corners: Array) -> None:
    """Draw the table on which a body stands that has corners (K, 3) along its way."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    width = 2.0 * float((high - low)[:2].max())
    thick = 0.04 * width
    middle = np.array([*(low + high)[:2] / 2.0, low[2] - thick / 2.0])
    builder.place(f"{root}/{TABLE}", Pose(middle, np.eye(3)))
    builder.mesh(f"{root}/{TABLE}", g.Box([width, width, thick]), _GRANITE)


def draw_centre(builder: SceneBuilder, root: str, setting: Setting) -> list[Label]:
    """Draw the centre of mass and, from it, the angular momentum as an arrow."""
    size = thickness(setting)
    builder.mesh(f"{root}/{CENTRE}", g.Sphere(2.5 * size), _GOLD, overlay=True)
    magnitude = float(np.linalg.norm(setting.momentum))
    if magnitude == 0.0:
        return []
    end = 60.0 * size * setting.momentum / magnitude
    builder.mesh(f"{root}/{MOMENTUM}", arrow(end, 0.8 * size), _GOLD, overlay=True)
    return [Label(f"h = {magnitude:.3g} N m s", end.tolist(), MOMENTUM)]


def draw_axes(builder: SceneBuilder, path: str, length: float, radius: float) -> None:
    """Draw the axes of a frame: x red, y green, z blue."""
    for letter, axis, colour in zip("xyz", np.eye(3), _AXES, strict=True):
        line = rod(length * axis, radius)
        builder.mesh(f"{path}/{letter}", line, colour, shaded=False, overlay=True)


def draw_ending(
    builder: SceneBuilder, root: str, motion: Motion, start: float = 0.0
) -> list[Label]:
    """Mark the end of a motion that became singular or fell below the margin.

    The clock of the page shows ``start`` where its time is zero [s].
    """
    if motion.completed:
        return []
    final = motion.final
    position = motion.model.end_effector_pose(final.attitude, final.joints).position
    path = f"{root}/{SINGULARITY}/mark"  # the track hides the mark, the user its parent
    builder.mesh(path, g.Sphere(3.0 * thickness(motion.setting)), _RED, overlay=True)
    builder.place(path, Pose(position, np.eye(3)))
    builder.appear(path, final.time)
    word = "singular" if motion.ending is Ending.SINGULAR else "below the margin"
    text = f"{word} at t = {start + final.time:.3f} s"
    return [Label(text, position.tolist(), SINGULARITY, builder.start + final.time)]


def tube(points: Array, radii: npt.ArrayLike) -> Surface:
    """A tube around a curve, its rings transported along the curve without twist.

    Args:
        points: Points of the curve [m], shape (K, 3), K at least 2, not all the same; neighbours
            may coincide.
        radii: Radii of the rings [m], scalar or shape (K,); zero closes an end.

    Returns:
        Vertices, ring by ring, shape (SIDES K, 3), and faces, shape (2 SIDES (K - 1), 3).
    """
    directions = _directions(points)
    angles = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
    normal = np.eye(3)[int(np.argmin(np.abs(directions[0])))]
    rings = []
    widths = np.broadcast_to(np.asarray(radii, dtype=float), len(points))
    for point, direction, radius in zip(points, directions, widths, strict=True):
        normal = normal - (normal @ direction) * direction
        normal /= np.linalg.norm(normal)
        binormal = np.cross(direction, normal)
        ring = np.outer(np.cos(angles), normal) + np.outer(np.sin(angles), binormal)
        rings.append(point + radius * ring)
    return np.vstack(rings), _faces(len(points))


def rod(end: Array, radius: float) -> Surface:
    """A straight tube with closed ends from the origin to a point (3,)."""
    return tube(np.array([0.0 * end, 0.0 * end, end, end]), [0.0, radius, radius, 0.0])


def arrow(end: Array, radius: float) -> Surface:
    """A straight tube from the origin to a point (3,) whose last quarter is a cone."""
    points = np.outer([0.0, 0.0, 0.75, 0.75, 1.0], end)
    return tube(points, [0.0, radius, radius, 2.5 * radius, 0.0])


def surface_of_revolution(ends: Iterable[float], radii: Iterable[float]) -> Surface:
    """The cone, cylinder or ring about z between two places on it, with two radii [m].

    Its vertices are at the first and the second end in turn.
    """
    profile = np.column_stack([[*radii], [*ends]])
    surface = revolve(profile, sections=_AROUND, process=False)
    return np.asarray(surface.vertices), np.asarray(surface.faces)


def _directions(points: Array) -> Array:
    """Unit tangents; where neighbours coincide, the tangent of the last distinct pair."""
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    (moving,) = np.nonzero(lengths > 1e-9 * lengths.max())
    last = moving[np.maximum(np.searchsorted(moving, np.arange(len(steps)), side="right") - 1, 0)]
    units = steps[last] / lengths[last, None]
    means = np.vstack([units[:1], units[:-1] + units[1:], units[-1:]])
    sizes = np.linalg.norm(means, axis=1, keepdims=True)
    ahead = np.vstack([units, units[-1:]])
    return np.where(sizes > 1e-6, means / np.maximum(sizes, 1e-6), ahead)  # no mean at a reversal


def _faces(rings: int) -> IntArray:
    corner = np.arange(SIDES)
    low = SIDES * np.arange(rings - 1)[:, None] + corner
    low_next = low + (corner + 1) % SIDES - corner
    high, high_next = low + SIDES, low_next + SIDES
    pairs = np.stack([low, low_next, high, low_next, high_next, high], axis=-1)
    return pairs.reshape(-1, 3)
