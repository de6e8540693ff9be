"""Maps over all attitudes as MeshCat scenes: points in the ball of rotation vectors.

One scene for each arm branch, and one for the best of all. A metre of the scene is a radian.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from meshcat import geometry as g

from freefloat.ensemble.feasibility import has_wrist_flipped_branches
from freefloat.motion.problem import Problem
from freefloat.planning.slices import Mark, rotation_vectors, told_marks
from freefloat.so3 import Array, Pose
from freefloat.visualization.colours import MarginColours
from freefloat.visualization.overlays import draw_axes
from freefloat.visualization.scene import Recording, set_the_stage
from freefloat.visualization.stage import ROOT, Stage, node
from freefloat.visualization.tubes import tube

FRONT, BACK = "Margin kept, y < 0", "Margin kept, y > 0"
BROKEN, BOUNDARY, MARKS, BALL, AXES = "Margin broken", "Boundary", "Marks", "Ball", "Axes"
ANY = "best of all branches"

_MOST = 40_000
"""Samples drawn; of more, an even choice."""
_POINT, _SPECK = 0.5, 0.2
"""Sizes of samples that keep the margin and of others, as shares of what lies between samples."""
_EDGE, _MARK = 0.06, 0.07
"""Size of points of the boundary and radius of marks [m]."""
_FEW = 0.25
"""Share of the samples up to which they do not hide what lies behind them."""
_WHITE = (0.95, 0.96, 0.98)
_PALE = (0.45, 0.50, 0.60, 1.0)
_MARKED: dict[str, tuple[float, float, float, float]] = {
    "best": (1.0, 0.25, 0.45, 1.0), "robust": (1.0, 0.6, 0.1, 1.0), "nearest": (0.3, 0.8, 1.0, 1.0),
}  # fmt: skip
_CORNERS = tuple(product((-2.2, 2.2), repeat=3))
"""A cube whose corners lie a little outside the ball, so that a view of them holds its labels."""
_VIEW = {
    "centre": (0.0, 0.0, 0.0), "radius": 3.6, "direction": (0.45, -1.0, 0.4), "flat": False,
    "points": _CORNERS,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Family:
    """What one scene shows: an arm branch, its twin with it, or the best of all."""

    title: str
    numbers: tuple[int, ...] | None
    margins: Array

    def has(self, branch: int | None) -> bool:
        """Whether something that a branch does belongs to the scene."""
        return self.numbers is None or branch in self.numbers

    def ends_at(self, branch: int | None) -> bool:
        """Whether the boundary of a branch is that of what is shown."""
        return branch is None if self.numbers is None else branch in self.numbers


def map_recording(
    problem: Problem,
    attitudes: Array,
    margins: Array,
    document: Mapping[str, Any],
    title: str = "freefloat",
) -> Recording:
    """Record a map, computed now or read from a file.

    Args:
        problem: What was asked.
        attitudes: Quaternions x, y, z, w, shape (N, 4).
        margins: Smallest magnitude of the measure, zero for motions that do not complete, shape
            (N, B).
        document: What ``map`` told: marks, arm branches, points of the boundary.
        title: Of the page.
    """
    families = list(_families(problem, margins, document))
    vectors, some = rotation_vectors(attitudes), _even_choice(len(attitudes))
    colours = MarginColours.over(problem.margin, [margins.ravel()])
    marks, boundary = told_marks(document), list(_boundary(document))
    stage = Stage()
    set_the_stage(stage)
    scenes = []
    for family in families:
        root = f"{ROOT}/{node(family.title)}"
        _draw_samples(stage, root, vectors[some], family.margins[some], colours)
        edge = [vector for vector, branch in boundary if family.ends_at(branch)]
        if edge:
            points = np.array(edge)
            stage.points(f"{root}/{BOUNDARY}", points, np.tile(_WHITE, (len(points), 1)), _EDGE)
        labels = _draw_ball(stage, root)
        labels += _draw_marks(stage, root, [mark for mark in marks if family.has(mark.branch)])
        scenes.append({
            "title": family.title, "node": node(family.title), "begin": 0.0, "end": 0.0,
            "lines": [*_lines(problem, family, document)], "labels": labels, "trail": None,
        })  # fmt: skip
    share = float(problem.margin.is_kept(families[0].margins).mean())
    about = {
        "title": title, "duration": 0.0, "scenes": scenes, "items": _items(share, bool(boundary)),
        "scale": colours.document(), "view": _VIEW, "remarks": [],
    }  # fmt: skip
    return Recording(stage.objects, stage.copies, None, about)


def _families(problem: Problem, margins: Array, document: Mapping[str, Any]) -> Iterator[_Family]:
    """The best of all first; twins, which share their motions, are one."""
    yield _Family(ANY, None, margins.max(axis=1, initial=0.0))
    twins = has_wrist_flipped_branches(problem)
    for entry in document["branches"]:
        branch, label = entry["branch"], entry["label"]
        if branch is None or (twins and branch % 2):
            continue
        numbers = (branch, branch + 1) if twins else (branch,)
        yield _Family(f"{label[:-1]}±" if twins else label, numbers, margins[:, branch])


def _even_choice(count: int) -> Any:
    if count <= _MOST:
        return slice(None)
    return np.sort(np.random.default_rng(0).choice(count, _MOST, replace=False))


def _boundary(document: Mapping[str, Any]) -> Iterator[tuple[Array, int | None]]:
    """Rotation vectors and arm branches of the points known on the boundary."""
    for entry in [*document.get("boundary", []), *document.get("touch", {}).get("points", [])]:
        yield rotation_vectors([entry["attitude"]])[0], entry["branch"]


def _draw_samples(
    stage: Stage, root: str, vectors: Array, margins: Array, colours: MarginColours
) -> None:
    """Points coloured by S_min in two halves, so that one sees inside, and specks for the rest."""
    good, front = colours.margin.is_kept(margins), vectors[:, 1] < 0.0
    between = float(np.cbrt(4.0 / 3.0 * np.pi**4 / len(vectors)))
    parts = ((FRONT, good & front, _POINT), (BACK, good & ~front, _POINT), (BROKEN, ~good, _SPECK))
    for name, part, size in parts:
        if part.any():
            below = np.where(good, margins, -1.0)[part]
            stage.points(f"{root}/{name}", vectors[part], colours(below), size * between)


def _draw_ball(stage: Stage, root: str) -> list[dict[str, Any]]:
    """Circles of half turns and, thinner, of quarter turns about all axes; the axes; labels."""
    angles = np.linspace(0.0, 2.0 * np.pi, 97)
    circle = np.column_stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)])
    for radius, width in ((np.pi, 0.008), (np.pi / 2.0, 0.004)):
        for normal in range(3):
            vertices, faces = tube(radius * np.roll(circle, normal, axis=1), width)
            path = f"{root}/{BALL}/{round(np.degrees(radius))} about {normal}"
            stage.mesh(path, g.TriangularMeshGeometry(vertices, faces), _PALE, shaded=False)
    draw_axes(stage, f"{root}/{AXES}", np.pi, 0.015)
    return [
        {"text": f"{name} 180°", "position": (np.pi * axis).tolist(), "item": AXES, "since": 0.0}
        for name, axis in zip("xyz", np.eye(3), strict=True)
    ]


def _draw_marks(stage: Stage, root: str, marks: list[Mark]) -> list[dict[str, Any]]:
    labels = []
    for mark in marks:
        vector, path = rotation_vectors([mark.attitude])[0], f"{root}/{MARKS}/{mark.name}"
        stage.mesh(path, g.Sphere(_MARK), _MARKED[mark.name])
        stage.place(path, Pose(vector, np.eye(3)))
        labels.append({"text": mark.name, "position": vector.tolist(), "item": MARKS, "since": 0.0})
    return labels


def _lines(problem: Problem, family: _Family, document: Mapping[str, Any]) -> Iterator[str]:
    """How many attitudes serve, and what is known of the marks."""
    margin = problem.margin
    share = 100.0 * margin.is_kept(family.margins).mean()
    yield "rotation vectors of the initial attitude"
    yield f"{share:.2f} % of {len(family.margins):,} attitudes keep |{margin.measure.name}|"
    words = {
        "best": ("value", f"|{margin.measure.name}| {{:.6g}}"),
        "robust": ("radius_deg", "{:.4g}° around keep the margin"),
        "nearest": ("deviation_deg", "{:.4g}° away"),
    }
    for name, (key, text) in words.items():
        told = document.get(name)
        if told is not None and family.has(told["branch"]):
            yield f"{name}: {text.format(told[key])}"


def _items(share: float, boundary: bool) -> list[dict[str, Any]]:
    """What can be shown and hidden; at first what leaves the inside of the ball in sight."""
    shown = {FRONT: share < _FEW, BACK: True, BROKEN: 1.0 - share < _FEW}
    if boundary:
        shown[BOUNDARY] = True
    shown |= {MARKS: True, BALL: True, AXES: True}
    return [{"name": name, "visible": visible} for name, visible in shown.items()]
