"""The figure of the workspace: its areas, with the path (Fig. 2b)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Wedge

from freefloat.dynamics.plane import Plane
from freefloat.motion.problem import Problem
from freefloat.regions.planar_regions import Interval
from freefloat.regions.workspace import Workspace
from freefloat.so3 import Array, Pose
from freefloat.visualization import figure_style as style

_S = np.linspace(0.0, 1.0, 301)
"""Path parameters at which paths are drawn."""
_DEPENDENT, _INDEPENDENT, _UNDECIDED = "#D0D0D0", "#E9F5EF", "#F5E6C8"
_AREAS = {(True, False): ("PDW A", "#C4C4C4"), (False, True): ("PDW B", "#DEDEDE"),
          (True, True): ("PDW A and B", "#A9A9A9")}  # fmt: skip
"""Names and colours of path-dependent areas, by whether they are of curve I and of curve II."""


@style.styled
def workspace_figure(problem: Problem, workspace: Workspace) -> Figure:
    """The figure of path-dependent and path-independent areas with the path.

    E is where the path of the point enters a path-dependent area. In space the areas are spherical
    shells, drawn over the distance from the centre of mass, and exact ones also in a cross-section.
    """
    if problem.task.planar:
        figure = style.new_figure(style.COLUMN, style.COLUMN)
        axes = figure.subplots()
        draw_areas(axes, workspace)
        draw_path(axes, [problem.path.pose_at(_S)], problem.plane, workspace)
        points = _sampled_path(problem, workspace)
        _draw_crossings(axes, workspace, problem.plane.seen(points)[:, :2])
        style.legend_above(axes, columns=3)
        return figure
    figure = style.new_figure(
        style.PAGE if workspace.exact else style.COLUMN, 3.4 if workspace.exact else 2.6
    )
    *sections, axes = figure.subplots(1, 2 if workspace.exact else 1, squeeze=False)[0]
    for section in sections:
        _draw_section(section, problem, workspace)
    _draw_distances(axes, problem, workspace)
    if not sections:
        style.legend_above(axes, columns=3)
    return figure


def _draw_section(axes: Any, problem: Problem, workspace: Workspace) -> None:
    """Draw areas as rings, and the path at its distances, with its length and angles kept.

    The cone from the centre of mass over the path is unrolled into the plane of the section.
    """
    points = _sampled_path(problem, workspace)
    a, b = points[:-1], points[1:]
    steps = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))
    angles = np.append(0.0, np.cumsum(steps))
    unit = np.column_stack([np.cos(angles), np.sin(angles)])
    path = np.linalg.norm(points, axis=1)[:, None] * unit
    draw_areas(axes, workspace)
    axes.plot(*path.T, color=style.BLUE, linestyle="-", linewidth=1.6, label=workspace.point)
    _draw_ends(axes, path, named=True)
    _draw_crossings(axes, workspace, path)
    axes.set(aspect="equal", xlabel=style.axis_label("in a cross-section", "m"))
    axes.set_ylabel(style.axis_label("in a cross-section", "m"))
    style.legend_above(axes, columns=3)


def _draw_crossings(axes: Any, workspace: Workspace, path: Array) -> None:
    """Mark where a path, shape (K, 2), enters an exact path-dependent area, E of Fig. 2b."""
    label: str | None = "E, enters a PDW"
    for (s, _), dependent in workspace.path if workspace.exact else ():
        if dependent and s > 0.0:
            place = np.array([np.interp(s, _S, column) for column in path.T])
            style.draw_point(axes, place, "D", 3.6, color=style.BLACK, zorder=8, label=label)
            axes.annotate("E", place, (4.0, 4.0), textcoords="offset points", zorder=8)
            label = None


def _draw_distances(axes: Any, problem: Problem, workspace: Workspace) -> None:
    """Distance of the path from the centre of mass over the areas."""
    points = _sampled_path(problem, workspace)
    for label, (low, high), colour in _labelled_areas(workspace):
        axes.axhspan(low, high, color=colour, linewidth=0.0, zorder=0, label=label)
    for radius in workspace.reach:
        label = "reach" if radius == workspace.reach[1] else None
        axes.axhline(radius, color=style.GREY, linewidth=0.7, label=label)
    axes.plot(_S, np.linalg.norm(points, axis=1), color=style.BLUE, label=workspace.point)
    axes.set(xlim=(0.0, 1.0), ylim=(0.0, 1.05 * workspace.reach[1]))
    axes.set_xlabel(style.axis_label("path parameter $s$", "1"))
    axes.set_ylabel(style.axis_label("distance from centre", "m"))


def _sampled_path(problem: Problem, workspace: Workspace) -> Array:
    """Positions of the point of a workspace along the path [m], shape (K, 3)."""
    poses = problem.path.pose_at(_S)
    return poses.position + poses.rotation @ workspace.offset


def _labelled_areas(workspace: Workspace) -> Iterator[tuple[str | None, Interval, str]]:
    """Yield label (for the first of each kind), interval and colour of each area."""
    named = [*_named_areas(workspace)]
    names = "can be singular", "PIW" if named else "never singular"
    dependent = () if named else workspace.path_dependent
    areas = (
        (dependent, _DEPENDENT), (workspace.path_independent, _INDEPENDENT),
        (workspace.undecided, _UNDECIDED),
    )  # fmt: skip
    seen = set[str]()
    for name, interval, colour in named:
        yield None if name in seen else name, interval, colour
        seen.add(name)
    for name, (intervals, colour) in zip((*names, "undecided"), areas, strict=True):
        for number, interval in enumerate(intervals or ()):
            yield name if number == 0 else None, interval, colour


def _named_areas(workspace: Workspace) -> Iterator[tuple[str, Interval, str]]:
    """The exact path-dependent areas in pieces, each of curve I, of curve II or of both (Fig. 2b).

    Areas of an elbow arm are areas of the in-plane factor: shoulder and wrist can be singular in
    all areas.
    """
    kinds = workspace.area_a, workspace.area_b
    edges = sorted({edge for areas in kinds for interval in areas for edge in interval})
    for low, high in pairwise(edges):
        middle = (low + high) / 2.0
        a, b = (any(first < middle < last for first, last in areas) for areas in kinds)
        if a or b:
            yield _AREAS[a, b][0], (low, high), _AREAS[a, b][1]


def draw_areas(axes: Any, workspace: Workspace) -> None:
    """Draw areas as rings, the reach as circles and the centre of mass."""
    for label, (low, high), colour in _labelled_areas(workspace):
        ring = Wedge(
            (0.0, 0.0), high, 0.0, 360.0, width=high - low, facecolor=colour, linewidth=0.0,
            zorder=0, label=label,
        )  # fmt: skip
        axes.add_patch(ring)
    for radius in workspace.reach:
        axes.add_patch(Circle((0.0, 0.0), radius, fill=False, edgecolor=style.GREY, linewidth=0.7))
    axes.plot([], [], color=style.GREY, linestyle="-", linewidth=0.7, label="limits of reach")
    style.draw_point(axes, np.zeros(2), "+", 6.0, color=style.BLACK, label="centre of mass")


def draw_path(axes: Any, paths: Sequence[Pose], plane: Plane, workspace: Workspace | None) -> None:
    """Draw planar paths and the path of the reference point (point 3 of the paper).

    The paths of all end-effectors are K poses each, in the plane.
    """
    draw_lines(axes, paths, plane)
    if workspace is not None and workspace.offset.any():
        points = paths[0].position + paths[0].rotation @ workspace.offset
        look = {"color": style.GREEN, "linestyle": "--", "linewidth": 1.3}
        axes.plot(*plane.seen(points)[:, :2].T, label=workspace.point, **look)
    axes.set_aspect("equal")
    axes.set_xlabel(style.axis_label(f"${plane.letters[0]}$", "m"))
    axes.set_ylabel(style.axis_label(f"${plane.letters[1]}$", "m"))


def draw_lines(axes: Any, paths: Sequence[Pose], plane: Plane | None = None) -> None:
    """Draw the paths of all end-effectors, as K poses each, with both ends."""
    for number, poses in enumerate(paths):
        path, named = poses.position, number == 0
        if plane is not None:
            path = plane.seen(path)[:, :2]
        line = {"color": style.BLUE, "linestyle": "-", "linewidth": 1.6}
        axes.plot(*path.T, label="path" if named else None, **line)
        _draw_ends(axes, path, named=named)


def _draw_ends(axes: Any, path: Array, *, named: bool) -> None:
    for place, name, fill in ((path[0], "start", "white"), (path[-1], "end", style.BLUE)):
        look = {"color": style.BLUE, "markerfacecolor": fill, "zorder": 6}
        style.draw_point(axes, place, "s", 4.5, label=name if named else None, **look)
