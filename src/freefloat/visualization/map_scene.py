"""Scenes of maps over all attitudes: points in the ball of rotation vectors.

One scene for each arm branch, and one for the best of all. A metre of the scene is a radian.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from meshcat import geometry as g

from freefloat.ensemble.feasibility import has_wrist_flipped_branches
from freefloat.planning.attitude_map import AttitudeMap
from freefloat.planning.slices import Mark, map_marks, rotation_vectors
from freefloat.so3 import Array, Pose
from freefloat.visualization.colours import MarginColours
from freefloat.visualization.overlays import Labels, draw_axes
from freefloat.visualization.scene_builder import ROOT, Scene, SceneBuilder, label, node
from freefloat.visualization.tubes import tube

FRONT, BACK = "Feasible, y < 0", "Feasible, y > 0"
INFEASIBLE, BOUNDARY = "Below the margin", "Boundary"
MARKS, BALL, AXES = "Marks", "Ball", "Axes"
BEST_BRANCH = "best of all branches"

_MOST = 40_000
"""Samples drawn; of more a random choice."""
_FEASIBLE, _OTHERS = 0.5, 0.2
"""Sizes of points as fractions of the distance between samples."""
_EDGE, _MARK = 0.06, 0.07
"""Size of points of the boundary and radius of marks [m]."""
_SPARSE = 0.25
"""Fraction of the samples up to which they do not hide what lies behind them."""
_WHITE = (0.95, 0.96, 0.98)
_PALE = (0.45, 0.50, 0.60, 1.0)
_MARK_COLOURS: dict[str, tuple[float, float, float, float]] = {
    "best": (1.0, 0.25, 0.45, 1.0), "robust": (1.0, 0.6, 0.1, 1.0), "nearest": (0.3, 0.8, 1.0, 1.0),
}  # fmt: skip
_VIEW = {
    "centre": (0.0, 0.0, 0.0), "radius": 3.6, "direction": (0.45, -1.0, 0.4), "flat": False,
    "points": tuple(product((-2.2, 2.2), repeat=3)),  # leaves room for labels
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Group:
    """What one scene shows: an arm branch, with its wrist-flipped one, or the best of all."""

    title: str
    branches: tuple[int, ...] | None
    margins: Array

    def has(self, branch: int | None) -> bool:
        return self.branches is None or branch in self.branches


def map_scene(result: AttitudeMap, title: str = "freefloat") -> Scene:
    """Return the scene of a map over all attitudes; the title is that of the page."""
    margin, groups = result.problem.margin, list(_groups(result))
    vectors, chosen = rotation_vectors(result.attitudes), _choice(result.samples)
    colours = MarginColours.over(margin, [result.margins.ravel()])
    edges = [*(result.boundary or ()), *(result.tangency or ())]
    builder, scenes = SceneBuilder(), []
    for group in groups:
        name = node(group.title)
        root = f"{ROOT}/{name}"
        _draw_samples(builder, root, vectors[chosen], group.margins[chosen], colours)
        edge = [point.attitude for point in edges if point.branch in (group.branches or (None,))]
        if edge:
            white = np.tile(_WHITE, (len(edge), 1))
            builder.points(f"{root}/{BOUNDARY}", rotation_vectors(edge), white, _EDGE)
        labels = _draw_ball(builder, root)
        marks = [mark for mark in map_marks(result) if group.has(mark.branch)]
        labels += _draw_marks(builder, root, marks)
        scenes.append({
            "title": group.title, "node": name, "begin": 0.0, "end": 0.0,
            "lines": list(_lines(result, group)), "labels": labels, "trail": None,
        })  # fmt: skip
    items = _items(result.feasible_fraction, bool(edges))
    return builder.scene({
        "title": title, "duration": 0.0, "scenes": scenes, "items": items,
        "scale": colours.to_dict(), "view": _VIEW, "remarks": [],
    })  # fmt: skip


def _groups(result: AttitudeMap) -> Iterator[_Group]:
    """The best of all first; wrist-flipped branches, whose motions are the same, as one."""
    yield _Group(BEST_BRANCH, None, result.margins.max(axis=1, initial=0.0))
    flipped, labels = has_wrist_flipped_branches(result.problem), result.branch_labels()
    for branch, margins in result.branch_margins():
        if branch is None:
            continue
        name = labels[branch]
        branches = (branch, branch + 1) if flipped else (branch,)
        yield _Group(f"{name[:-1]}±" if flipped else name, branches, margins)


def _choice(count: int) -> Any:
    if count <= _MOST:
        return slice(None)
    return np.sort(np.random.default_rng(0).choice(count, _MOST, replace=False))


def _draw_samples(
    builder: SceneBuilder, root: str, vectors: Array, margins: Array, colours: MarginColours
) -> None:
    """Draw feasible samples in two halves, so that the inside can be seen, and the others small."""
    feasible, front = colours.margin.is_kept(margins), vectors[:, 1] < 0.0
    spacing = float(np.cbrt(4.0 / 3.0 * np.pi**4 / len(vectors)))
    parts = (
        (FRONT, feasible & front, _FEASIBLE), (BACK, feasible & ~front, _FEASIBLE),
        (INFEASIBLE, ~feasible, _OTHERS),
    )  # fmt: skip
    for name, part, size in parts:
        if part.any():
            values = np.where(feasible, margins, -1.0)[part]
            builder.points(f"{root}/{name}", vectors[part], colours(values), size * spacing)


def _draw_ball(builder: SceneBuilder, root: str) -> Labels:
    """Draw circles of half and quarter turns about all axes, and the axes; return their labels."""
    angles = np.linspace(0.0, 2.0 * np.pi, 97)
    circle = np.column_stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)])
    for radius, width in ((np.pi, 0.008), (np.pi / 2.0, 0.004)):
        for normal in range(3):
            path = f"{root}/{BALL}/{round(np.degrees(radius))} about {normal}"
            ring = tube(radius * np.roll(circle, normal, axis=1), width)
            builder.mesh(path, ring, _PALE, shaded=False)
    draw_axes(builder, f"{root}/{AXES}", np.pi, 0.015)
    return [
        label(f"{name} 180°", np.pi * axis, AXES)
        for name, axis in zip("xyz", np.eye(3), strict=True)
    ]


def _draw_marks(builder: SceneBuilder, root: str, marks: Sequence[Mark]) -> Labels:
    labels = []
    for mark in marks:
        vector, path = rotation_vectors([mark.attitude])[0], f"{root}/{MARKS}/{mark.name}"
        builder.mesh(path, g.Sphere(_MARK), _MARK_COLOURS[mark.name])
        builder.place(path, Pose(vector, np.eye(3)))
        labels.append(label(mark.name, vector, MARKS))
    return labels


def _lines(result: AttitudeMap, group: _Group) -> Iterator[str]:
    """Text of a scene: how many attitudes are feasible, and what is known of the marks."""
    margin = result.problem.margin
    percentage = 100.0 * margin.is_kept(group.margins).mean()
    yield "rotation vectors of the initial attitude"
    yield f"{percentage:.2f} % of {result.samples:,} attitudes keep |{margin.measure.name}|"
    if result.best is not None and group.has(result.best.branch):
        yield f"best: |{margin.measure.name}| {result.best.score:.6g}"
    if result.robust is not None and group.has(result.robust.branch):
        yield f"robust: {np.degrees(result.robust.score):.4g}° around keep the margin"
    if result.nearest is not None and group.has(result.nearest.branch):
        yield f"nearest: {np.degrees(result.nearest.score):.4g}° away"


def _items(fraction: float, boundary: bool) -> list[dict[str, Any]]:
    """What can be hidden; at first what would hide the inside of the ball is."""
    shown = {FRONT: fraction < _SPARSE, BACK: True, INFEASIBLE: 1.0 - fraction < _SPARSE}
    if boundary:
        shown[BOUNDARY] = True
    shown |= {MARKS: True, BALL: True, AXES: True}
    return [{"name": name, "visible": visible} for name, visible in shown.items()]
