"""Scenes of maps: points in the ball of rotation vectors, or a ring of headings per arm branch."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from meshcat import geometry as g

from freefloat.attitude_grids import even_directions
from freefloat.ensemble.feasibility import has_wrist_flipped_branches
from freefloat.ik.numbering import branch_name
from freefloat.planning.margin_map import HeadingMap, MarginMap
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.rounding import rounded_down
from freefloat.so3 import Array, Pose
from freefloat.visualization.scenes.description import (
    Label,
    MarginColours,
    Samples,
    SceneDescription,
    TitledScene,
    View,
)
from freefloat.visualization.scenes.overlays import Surface, draw_axes, tube
from freefloat.visualization.scenes.scene_builder import ROOT, PageScene, SceneBuilder, node
from freefloat.visualization.slices import Mark, map_marks, rotation_vectors

FRONT, BACK = "Feasible, y < 0", "Feasible, y > 0"
INFEASIBLE, UNREACHED, BOUNDARY = "Below the margin", "Start not reached", "Boundary"
MARKS, BALL, AXES = "Marks", "Ball", "Axes"
_PARTS = (FRONT, BACK, INFEASIBLE, UNREACHED)
BEST_BRANCH = "best of all branches"

_MAX_SAMPLES = 40_000
"""Maximum number of samples drawn; a larger map is thinned at random."""
_FEASIBLE, _OTHERS = (0.5, 0.12), (0.32, 0.09)
"""Sizes of feasible and other points: fraction of the distance of samples, minimum [m]."""
_EDGE, _MARK = 0.06, 0.07
"""Size of boundary points and radius of marks [m]."""
_WHITE = (0.95, 0.96, 0.98, 1.0)
_GREY = (0.45, 0.50, 0.60, 1.0)
_MARK_COLOURS: dict[str, tuple[float, float, float, float]] = {
    "best": (1.0, 0.25, 0.45, 1.0), "robust": (0.75, 0.5, 1.0, 1.0),
    "nearest": (0.3, 0.8, 1.0, 1.0),
}  # fmt: skip
_SEEN = (3.4 * even_directions(100)).round(4).tolist()  # with a margin for labels
_VIEW = View([0.0, 0.0, 0.0], 3.6, _SEEN, direction=[0.45, -1.0, 0.4], flat=False)
_HEADINGS, _CIRCLE, _BEST = "headings", "Circle", "Best heading"
_INNERMOST = 0.3
_FILLED = 0.8
"""Width of a ring as a fraction of the distance between rings."""
_CORNERS = [[x, y, 0.0] for x in (-1.3, 1.2) for y in (-1.1, 1.3)]
_ABOVE = View([0.0, 0.0, 0.0], 1.2, _CORNERS, direction=[0.0, -0.02, 1.0], flat=True)


@dataclass(frozen=True, eq=False)
class _BranchMargins:
    """Margins of one scene: of a branch and its wrist-flipped branch, or of the best branch.

    They are negative where the start of the path is not reached.
    """

    title: str
    branches: tuple[int, ...] | None
    margins: Array

    def has(self, branch: int | None) -> bool:
        return self.branches is None or branch in self.branches


def map_scene(result: AttitudeMap, title: str = "freefloat") -> PageScene:
    """The scene of a map over all attitudes, for a page with a title.

    One part per arm branch, and one for the best branch. One metre in the scene is one radian.
    """
    margin = result.problem.margin
    vectors = rotation_vectors(result.attitudes)
    chosen = np.arange(result.samples)
    if result.samples > _MAX_SAMPLES:
        chosen = np.random.default_rng(0).choice(result.samples, _MAX_SAMPLES, replace=False)
    colours = MarginColours.over(margin, [np.array([result.largest_margin])], result.limited)
    edges = [*(result.boundary or ()), *(result.touch or ())]
    builder = SceneBuilder()
    scenes = []
    groups = list(_groups(result))
    for group in groups:
        name = node(group.title)
        root = f"{ROOT}/{name}"
        _draw_samples(builder, root, vectors[chosen], group.margins[chosen], colours)
        edge = [point.attitude for point in edges if point.branch in (group.branches or (None,))]
        if edge:
            white = np.tile(_WHITE[:3], (len(edge), 1))
            builder.points(f"{root}/{BOUNDARY}", rotation_vectors(edge), white, _EDGE)
        marks = [mark for mark in map_marks(result) if group.has(mark.branch)]
        labels = _draw_ball(builder, root) + _draw_marks(builder, root, marks)
        scenes.append(TitledScene(group.title, name, labels, lines=tuple(_lines(result, group))))
    items = dict.fromkeys((*_PARTS, BOUNDARY, MARKS, BALL, AXES), True)
    columns = groups[1:] or groups
    margins = np.column_stack([group.margins[chosen] for group in columns])
    titles = tuple(group.title for group in columns)
    samples = Samples(vectors[chosen], margins, titles, _PARTS)
    return builder.scene(
        SceneDescription(title, tuple(scenes), items, colours.to_dict(), _VIEW, samples=samples)
    )


def _groups(result: AttitudeMap) -> Iterator[_BranchMargins]:
    """Yield the best branch, then the branches; wrist-flipped ones share a group."""
    reached = result.results.exist
    best = result.margins.max(axis=1, initial=0.0)
    yield _BranchMargins(BEST_BRANCH, None, np.where(reached.any(axis=1), best, -1.0))
    flipped = has_wrist_flipped_branches(result.problem)
    labels = result.branch_labels()
    for branch, margins in result.branch_margins():
        if branch is None:
            continue
        name = branch_name(labels[branch])
        branches = (branch, branch + 1) if flipped else (branch,)
        values = np.where(reached[:, branch], margins, -1.0)
        yield _BranchMargins(f"{name[:-1]}±" if flipped else name, branches, values)


def _draw_samples(
    builder: SceneBuilder, root: str, vectors: Array, margins: Array, colours: MarginColours
) -> None:
    """Draw feasible samples as two hemispheres, which can be hidden, and other samples small."""
    feasible, reached = colours.margin.keeps(margins), margins >= 0.0
    front = vectors[:, 1] < 0.0
    spacing = float(np.cbrt(4.0 / 3.0 * np.pi**4 / len(vectors)))
    parts = (
        (FRONT, feasible & front, _FEASIBLE), (BACK, feasible & ~front, _FEASIBLE),
        (INFEASIBLE, reached & ~feasible, _OTHERS), (UNREACHED, ~reached, _OTHERS),
    )  # fmt: skip
    for name, part, (fraction, minimum) in parts:
        if part.any():
            shades = colours(np.where(feasible, margins, -1.0)[part])
            if name == UNREACHED:
                shades[:] = _GREY[:3]
            size = max(fraction * spacing, minimum)
            builder.points(f"{root}/{name}", vectors[part], shades, size)


def _draw_ball(builder: SceneBuilder, root: str) -> list[Label]:
    """Draw circles of 180 and 90 degrees in the coordinate planes, and the axes."""
    angles = np.linspace(0.0, 2.0 * np.pi, 97)
    circle = np.column_stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)])
    for radius, width in ((np.pi, 0.008), (np.pi / 2.0, 0.004)):
        for normal in range(3):
            path = f"{root}/{BALL}/{round(np.degrees(radius))} about {normal}"
            ring = tube(radius * np.roll(circle, normal, axis=1), width)
            builder.mesh(path, ring, _GREY, shaded=False)
    draw_axes(builder, f"{root}/{AXES}", np.pi, 0.015)
    return [
        Label(f"{name} 180°", (np.pi * axis).tolist(), AXES)
        for name, axis in zip("xyz", np.eye(3), strict=True)
    ]


def _draw_marks(builder: SceneBuilder, root: str, marks: Sequence[Mark]) -> list[Label]:
    labels: list[Label] = []
    for mark in marks:
        vector = rotation_vectors([mark.attitude])[0]
        path = f"{root}/{MARKS}/{mark.name}"
        builder.mesh(path, g.Sphere(_MARK), _MARK_COLOURS[mark.name], overlay=True)
        builder.place(path, Pose(vector, np.eye(3)))
        labels.append(Label(mark.name, vector.tolist(), MARKS))
    return labels


def _lines(result: AttitudeMap, group: _BranchMargins) -> Iterator[str]:
    """Text of a scene: the percentage of feasible attitudes and the scores of the marks."""
    margin = result.problem.margin
    yield "rotation vectors of the initial attitude"
    yield _kept(result, float(margin.keeps(group.margins).mean()), "attitudes")
    best, robust, nearest = result.best, result.robust, result.nearest
    if best is not None and group.has(best.branch):
        yield f"best: |{margin.measure.title}| {best.minimum_margin:.6g}"
    if robust is not None and group.has(robust.branch):
        radius = rounded_down(np.degrees(robust.radius))
        yield f"robust: keeps the margin within {radius:.4g}°"
    if nearest is not None and group.has(nearest.branch):
        yield f"nearest: {np.degrees(nearest.deviation):.4g}° away"
    if group.margins.min() < 0.0:
        yield "grey: start of the path not reached"


def _kept(result: MarginMap, fraction: float, samples: str) -> str:
    """Which percentage of the samples keeps the margin and the limits."""
    limits = " and limits" if result.limited else ""
    kept = f"|{result.problem.margin.measure.title}|{limits}"
    return f"{fraction:.2%} of {result.samples:,} {samples} keep {kept}"


def heading_scene(result: HeadingMap, title: str = "freefloat") -> PageScene:
    """The scene of a map over headings, for a page with a title.

    The ring of the first arm branch is the outermost.
    """
    builder, root = SceneBuilder(), f"{ROOT}/{_HEADINGS}"
    circle = tube(_points(1.02, np.radians(np.arange(0.0, 361.0, 2.0))), 0.003)
    builder.mesh(f"{root}/{_CIRCLE}", circle, _GREY, shaded=False)
    ticks = {0: 1.02, 90: 1.06, 180: 1.25, 270: 1.06}  # labels extend to the right
    places = {tick: _points(radius, np.radians(tick)) for tick, radius in ticks.items()}
    labels = [Label(f"{tick}°", place.tolist(), _CIRCLE) for tick, place in places.items()]
    colours = MarginColours.over(result.problem.margin, result.margins, result.limited)
    shown = np.where(result.feasible, result.margins, np.where(result.results.exist, -1.0, np.nan))
    rings = result.by_branch(shown)
    edges = np.linspace(1.0, _INNERMOST, len(rings) + 1)
    items, best = [_CIRCLE, _BEST], result.best
    names = [branch_name(label) for label in result.branch_labels().values()]
    for number, (branch, margins) in enumerate(rings):
        outer = edges[number]
        radii = np.array([outer + _FILLED * (edges[number + 1] - outer), outer])
        reached = np.isfinite(margins)
        vertices, faces = _sectors(radii, result.headings[reached], result.step / 2.0)
        shades = np.repeat(colours(margins[reached]), 4, axis=0)
        items.append(names[number])
        builder.coloured_mesh(f"{root}/{items[-1]}", vertices, faces, shades)
        place = _points(radii.mean(), np.radians(280.0))
        labels.append(Label(items[-1], place.tolist(), items[-1]))
        if best is not None and best.branch == branch:
            line = _points(radii, best.heading)
            builder.mesh(f"{root}/{_BEST}", tube(line, 0.006), _WHITE, shaded=False, overlay=True)
            labels.append(Label("best", line[1].tolist(), _BEST))
    scene = TitledScene("all arm branches", _HEADINGS, labels, lines=tuple(_heading_lines(result)))
    visible = dict.fromkeys(items, True)
    columns = [values for _, values in result.by_branch(result.results.existing_margins)]
    margins = np.nan_to_num(np.reshape(columns, (len(columns), result.samples)).T, nan=-1.0)
    samples = Samples(_points(1.0, result.headings), margins, tuple(names))
    return builder.scene(
        SceneDescription(title, (scene,), visible, colours.to_dict(), _ABOVE, samples=samples)
    )


def _points(radii: Any, angles: Any) -> Array:
    """Points in the x-y plane from radii [m] and angles [rad], which are broadcast."""
    x, y = radii * np.cos(angles), radii * np.sin(angles)
    return np.stack([x, y, np.zeros_like(x)], axis=-1)


def _sectors(radii: Array, headings: Array, half: float) -> Surface:
    """Vertices and faces of quadrilaterals between two radii around headings (K,) [rad]."""
    angles = headings[:, None] + half * np.array([-1.0, -1.0, 1.0, 1.0])
    faces = 4 * np.arange(len(headings))[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    return _points(radii[[0, 1, 1, 0]], angles).reshape(-1, 3), faces.reshape(-1, 3)


def _heading_lines(result: HeadingMap) -> Iterator[str]:
    """Text of the scene: the percentage of feasible headings, and the best one."""
    best = result.best
    yield f"initial heading{result.problem.plane.about}"
    yield _kept(result, result.feasible_fraction, "headings")
    if best is not None:
        measure, name = result.problem.margin.measure, result.branch_labels()[best.branch]
        where = f"{np.degrees(best.heading):.4g}°, {branch_name(name)}"
        yield f"best: {where}, |{measure.title}| {best.minimum_margin:.6g}"
    if any(np.isnan(row).any() for _, row in result.by_branch(result.results.existing_margins)):
        yield "gaps: start of the path not reached"
