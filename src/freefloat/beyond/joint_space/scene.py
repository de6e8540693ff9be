"""Scenes of maps of the joint space: the surface det A = 0 in a cube, or det A over a square.

Each joint's range is two metres long in the scene.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations, permutations, product

import numpy as np
import numpy.typing as npt
from contourpy import contour_generator
from matplotlib.colors import to_hex

from freefloat.beyond.joint_space.figures import (
    JointSection,
    influential_joints,
    joint_text,
    section,
)
from freefloat.beyond.joint_space.singularity_map import Kind, SingularityMap
from freefloat.errors import InputError
from freefloat.so3 import Array, IntArray
from freefloat.visualization.figure_style import digits
from freefloat.visualization.scenes.description import Label, SceneDescription, TitledScene, View
from freefloat.visualization.scenes.overlays import tube
from freefloat.visualization.scenes.scene_builder import (
    BACK_SIDE,
    FRONT_SIDE,
    ROOT,
    PageScene,
    SceneBuilder,
)

NODE, ZEROS, HEIGHT, BOX = "joints", "det A = 0", "det A", "Axes"
SIDES = ("Side of det A > 0", "Side of det A < 0")
_INTERVALS, _FINE = 45, 180
"""Intervals of the grid along an edge of the cube, and of the square."""
_SHIFTS = 1e-3 * np.array([-1.0, 1.0, -1.0])
"""Shifts of the range of revolute joints in revolutions: a surface at 180 degrees, which is also at
-180 degrees, is drawn at the end that is further from the eye."""
_POSITIVE, _NEGATIVE = (0.99, 0.76, 0.36), (0.22, 0.50, 0.80)
_WHITE = (0.95, 0.96, 0.98)
_GREY = (0.45, 0.50, 0.60, 1.0)
_CORNERS = [list(corner) for corner in product((-1.2, 1.2), repeat=3)]  # with room for labels
_VIEW = View([0.0, 0.0, 0.0], 2.0, _CORNERS, direction=[0.45, -1.0, 0.55], flat=False)
_BISECTIONS = 12


def singularity_scene(
    found: SingularityMap,
    title: str = "freefloat",
    joints: Sequence[str] | None = None,
    at: npt.ArrayLike | None = None,
) -> PageScene:
    """The scene of a map of the joint space, for a page with a title.

    Over three joints it is the surface where det A vanishes, over two joints det A itself.

    Args:
        found: Map of the joint space.
        title: Title of the page.
        joints: Names of two or three joints; by default those with the largest influence on det A,
            three if it depends on as many.
        at: Values of all joints [rad or m], shape (n,), of which the values of the other joints
            count; by default a configuration far from singularities.

    Raises:
        InputError: If there are no such joints, or ``at`` is not a finite value for each joint.
    """
    part = section(found, _indices(found, joints), at)
    builder, root = SceneBuilder(), f"{ROOT}/{NODE}"
    colours = [_POSITIVE, _NEGATIVE]
    if len(part.joints) == 2:
        items, keys = _draw_height(builder, root, part), ["det A > 0", "det A < 0"]
        if ZEROS in items:
            keys, colours = [*keys, ZEROS], [*colours, _WHITE]
    else:
        items, keys = _draw_surface(builder, root, part), [*SIDES]
    labels = _draw_box(builder, root, part)
    shown = dict.fromkeys((*items, BOX), True)
    scene = TitledScene("det A", NODE, labels, lines=tuple(_lines(part, ZEROS in items)))
    legend = {"entries": [[key, to_hex(rgb)] for key, rgb in zip(keys, colours, strict=True)]}
    return builder.scene(SceneDescription(title, (scene,), shown, legend, _VIEW))


def _indices(found: SingularityMap, joints: Sequence[str] | None) -> list[int]:
    """The indices of joints by name, or those with the largest influence."""
    if joints is None:
        return influential_joints(found, min(3, max(2, len(found.joints))))
    names = list(found.model.joint_names)
    if len(joints) not in (2, 3) or not set(joints) <= set(names) or len(set(joints)) < len(joints):
        raise InputError("joints", ", ".join(joints), f"two or three of {', '.join(names)}")
    return [names.index(name) for name in joints]


def surface(part: JointSection) -> tuple[Array, IntArray]:
    """The surface det A = 0 of a section over three joints: vertices [rad or m], faces (F, 3).

    The front of its faces, whose corners run anticlockwise, is the side of det A > 0.
    """
    polynomial = part.polynomial
    fractions = np.linspace(0.0, 1.0, _INTERVALS + 1)
    revolute = [not polynomial.bases[joint].prismatic for joint in part.joints]
    shifts = _SHIFTS * (part.upper - part.lower) * revolute
    x, y, z = (tick + shift for tick, shift in zip(part.ticks(fractions), shifts, strict=True))
    vertices, faces = zero_surface(
        lambda values: polynomial.values(part.configurations(values)) - polynomial.rounding,
        (x, y, z),
    )
    if len(faces):
        gradients = polynomial.gradients(part.configurations(vertices))[:, part.joints]
        a, b, c = np.moveaxis(vertices[faces] / (part.upper - part.lower), 1, 0)
        slopes = gradients[faces].mean(axis=1) * (part.upper - part.lower)
        backward = np.einsum("ij,ij->i", np.cross(b - a, c - a), slopes) < 0.0
        faces[backward] = faces[backward, ::-1]
    return vertices, faces


def _draw_surface(builder: SceneBuilder, root: str, part: JointSection) -> list[str]:
    """Draw the surface det A = 0 in a colour for each side; return the items."""
    vertices, faces = surface(part)
    if not len(faces):
        return []
    shape = _placed(part, vertices), faces
    colours = _POSITIVE, _NEGATIVE
    for side, name, colour in zip((FRONT_SIDE, BACK_SIDE), SIDES, colours, strict=True):
        builder.mesh(f"{root}/{ZEROS}/{name}", shape, (*colour, 1.0), side=side)
    return [ZEROS]


def _draw_height(builder: SceneBuilder, root: str, part: JointSection) -> list[str]:
    """Draw det A, relative to its largest magnitude, over two joints; return the items."""
    count = _FINE + 1
    grid = part.grid(part.ticks(np.linspace(0.0, 1.0, count)))
    values = part.polynomial.values(grid)
    height = values / max(float(np.abs(values).max()), part.polynomial.rounding)
    vertices = np.column_stack([_placed(part, grid[:, part.joints]), height])
    corner = np.arange(count**2).reshape(count, count)[:-1, :-1].reshape(-1, 1)
    faces = (corner + np.array([0, count, count + 1, 0, count + 1, 1])).reshape(-1, 3)
    shades = np.where(height[:, None] > 0.0, _POSITIVE, _NEGATIVE)
    brightness = 0.45 + 0.55 * np.sqrt(np.abs(height[:, None]))
    builder.coloured_mesh(f"{root}/{HEIGHT}", vertices, faces, brightness * shades)
    if not part.signs_differ(values):
        return [HEIGHT]
    ticks = np.linspace(-1.0, 1.0, count)
    curves = contour_generator(ticks, ticks, height.reshape(count, count).T).lines(0.0)
    for number, curve in enumerate(map(np.asarray, curves)):
        points = np.column_stack([curve, np.zeros(len(curve))])
        if np.ptp(points, axis=0).any():
            line = tube(points, 0.012)
            builder.mesh(f"{root}/{ZEROS}/{number}", line, (*_WHITE, 1.0), shaded=False)
    return [HEIGHT, ZEROS]


def _placed(part: JointSection, values: Array) -> Array:
    """Places in the scene [m] of joint values, from -1 to 1 over their ranges."""
    return 2.0 * (values - part.lower) / (part.upper - part.lower) - 1.0


def _draw_box(builder: SceneBuilder, root: str, part: JointSection) -> list[Label]:
    """Draw the edges of the cube and return the labels of its axes."""
    labels = []
    corners = list(product((-1.0, 1.0), repeat=3))
    pairs = combinations(corners, 2)
    edges = (pair for pair in pairs if np.subtract(*pair).tolist().count(0) == 2)
    for number, (a, b) in enumerate(edges):
        line = tube(np.array([a, b]), 0.006)
        builder.mesh(f"{root}/{BOX}/{number}", line, _GREY, shaded=False)
    places = [[0.0, -1.15, -1.1], [1.15, 0.0, -1.1], [-1.25, -1.0, 0.0]]
    for axis, texts in enumerate(_scales(part)):
        for text, place in zip(texts, (-1.0, 0.0, 1.0), strict=True):
            position = list(places[axis])
            position[axis] = 0.9 * place
            labels.append(Label(text, position, BOX))
    return labels


def _scales(part: JointSection) -> Iterator[tuple[str, str, str]]:
    """Yield the lower end, the name and the upper end of each axis."""
    for joint, low, high in zip(part.joints, part.lower, part.upper, strict=True):
        first, last = (joint_text(part.found, joint, value) for value in (low, high))
        yield first, part.found.model.joint_names[joint], last
    if len(part.joints) == 2:
        yield digits(-1.0), "det A / max", "1"


def _lines(part: JointSection, drawn: bool) -> Iterator[str]:
    """Text of the scene: the other joints, and how much of the joint space is certified."""
    volumes = part.found.volumes
    if constants := part.constants():
        yield f"at {constants}"
    if not drawn:
        yield "det A does not change its sign here"
    certified = volumes[Kind.POSITIVE] + volumes[Kind.NEGATIVE]
    yield f"{certified:.2%} of the joint space is certified free of singularities"


def zero_surface(
    function: Callable[[Array], Array], axes: tuple[Array, Array, Array]
) -> tuple[Array, IntArray]:
    """The surface where a function of points (K, 3) vanishes, by marching tetrahedra.

    Each cell of a grid of ascending values is divided into six tetrahedra. Vertices lie on their
    edges, where bisections find a change of sign; corners of faces run in either direction.
    """
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    positive = function(grid) > 0.0
    edges = _crossed_edges(positive.reshape([len(axis) for axis in axes]))
    pairs, faces = np.unique(np.sort(edges.reshape(-1, 2)), axis=0, return_inverse=True)
    first, second = grid[pairs[:, 0]], grid[pairs[:, 1]]
    for _ in range(_BISECTIONS):
        middle = (first + second) / 2.0
        same = ((function(middle) > 0.0) == positive[pairs[:, 0]])[:, None]
        first, second = np.where(same, middle, first), np.where(same, second, middle)
    return (first + second) / 2.0, np.reshape(faces, (-1, 3))


def _crossed_edges(positive: np.ndarray) -> IntArray:
    """Triangles (F, 3, 2): pairs of grid points of different signs at their corners."""
    flat = positive.ravel()
    strides = np.array([positive.strides[axis] for axis in range(3)]) // positive.itemsize
    points = np.arange(flat.size).reshape(positive.shape)[:-1, :-1, :-1].ravel()
    triangles = [np.zeros((0, 3, 2), dtype=int)]
    for order in permutations(strides.tolist()):
        corners = points[:, None] + np.cumsum([0, *order])
        codes = flat[corners] @ (1 << np.arange(4))
        for code in range(1, 15):
            chosen = corners[codes == code]
            triangles += [chosen[:, triangle] for triangle in _triangles(code)]
    return np.concatenate(triangles)


def _triangles(code: int) -> list[list[list[int]]]:
    """Triangles of a tetrahedron whose corners with a bit in the code are positive."""
    inside = [corner for corner in range(4) if code >> corner & 1]
    outside = [corner for corner in range(4) if not code >> corner & 1]
    around = [[a, b] for a in inside for b in outside]
    if len(around) == 3:
        return [around]
    first, second, third, fourth = around  # a quadrilateral: neighbours share a corner
    return [[first, second, fourth], [first, fourth, third]]
