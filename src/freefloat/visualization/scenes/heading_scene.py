"""Scenes of maps over headings: a ring for each arm branch, coloured by the minimum margin."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from freefloat.ik.labels import branch_name
from freefloat.planning.margin_map import HeadingMap
from freefloat.so3 import Array, IntArray
from freefloat.visualization.scenes.description import (
    Label,
    MarginColours,
    Samples,
    SceneDescription,
    TitledScene,
    View,
)
from freefloat.visualization.scenes.overlays import tube
from freefloat.visualization.scenes.scene_builder import ROOT, PageScene, SceneBuilder

NODE, CIRCLE, BEST = "headings", "Circle", "Best heading"
_INNERMOST = 0.3
_FILLED = 0.8
"""Width of a ring as a fraction of the distance between rings."""
_GREY, _WHITE = (0.45, 0.50, 0.60, 1.0), (0.95, 0.96, 0.98, 1.0)
_CORNERS = [[x, y, 0.0] for x in (-1.3, 1.2) for y in (-1.1, 1.3)]
_VIEW = View([0.0, 0.0, 0.0], 1.2, _CORNERS, direction=[0.0, -0.02, 1.0], flat=True)


def heading_scene(result: HeadingMap, title: str = "freefloat") -> PageScene:
    """The scene of a map over headings, for a page with a title.

    Headings are angles from the x axis. The ring of the first arm branch is the outermost.
    """
    builder, root = SceneBuilder(), f"{ROOT}/{NODE}"
    circle = tube(_points(1.02, np.radians(np.arange(0.0, 361.0, 2.0))), 0.003)
    builder.mesh(f"{root}/{CIRCLE}", circle, _GREY, shaded=False)
    ticks = {0: 1.02, 90: 1.06, 180: 1.25, 270: 1.06}  # labels extend to the right
    places = {tick: _points(radius, np.radians(tick)) for tick, radius in ticks.items()}
    labels = [Label(f"{tick}°", place.tolist(), CIRCLE) for tick, place in places.items()]
    colours = MarginColours.over(result.problem.margin, result.margins, result.limited)
    shown = np.where(result.feasible, result.margins, np.where(result.results.exist, -1.0, np.nan))
    rings = result.by_branch(shown)
    edges = np.linspace(1.0, _INNERMOST, len(rings) + 1)
    items, best = [CIRCLE, BEST], result.best
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
            builder.mesh(f"{root}/{BEST}", tube(line, 0.006), _WHITE, shaded=False, overlay=True)
            labels.append(Label("best", line[1].tolist(), BEST))
    scene = TitledScene("all arm branches", NODE, labels, lines=tuple(_lines(result)))
    visible = dict.fromkeys(items, True)
    columns = [values for _, values in result.by_branch(result.results.existing_margins)]
    margins = np.nan_to_num(np.reshape(columns, (len(columns), result.samples)).T, nan=-1.0)
    samples = Samples(_points(1.0, result.headings), margins, tuple(names))
    return builder.scene(
        SceneDescription(title, (scene,), visible, colours, _VIEW, samples=samples)
    )


def _points(radii: Any, angles: Any) -> Array:
    """Points in the x-y plane from radii [m] and angles [rad], which are broadcast."""
    x, y = radii * np.cos(angles), radii * np.sin(angles)
    return np.stack([x, y, np.zeros_like(x)], axis=-1)


def _sectors(radii: Array, headings: Array, half: float) -> tuple[Array, IntArray]:
    """Vertices and faces of quadrilaterals between two radii around headings (K,) [rad]."""
    angles = headings[:, None] + half * np.array([-1.0, -1.0, 1.0, 1.0])
    faces = 4 * np.arange(len(headings))[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    return _points(radii[[0, 1, 1, 0]], angles).reshape(-1, 3), faces.reshape(-1, 3)


def _lines(result: HeadingMap) -> Iterator[str]:
    """Text of the scene: the percentage of feasible headings, and the best one."""
    measure, best = f"|{result.problem.margin.measure.title}|", result.best
    yield "initial heading from the x axis"
    kept = f"{measure} and limits" if result.limited else measure
    yield f"{result.feasible_fraction:.2%} of {len(result.headings):,} headings keep {kept}"
    if best is not None:
        degrees = f"{np.degrees(best.heading):.4g}°"
        name = branch_name(result.branch_labels()[best.branch])
        yield f"best: {degrees}, {name}, {measure} {best.minimum_margin:.6g}"
    if any(np.isnan(row).any() for _, row in result.by_branch(result.results.existing_margins)):
        yield "gaps: start of the path not reached"
