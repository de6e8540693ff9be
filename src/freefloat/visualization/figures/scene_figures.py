"""Figures of the workspace, of the path and of the robot at several instants."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Wedge
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from freefloat.dynamics.plane import Plane
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.problem import Problem
from freefloat.paths.timing import TimedPath
from freefloat.regions.planar_regions import Interval
from freefloat.regions.workspace import Workspace
from freefloat.so3 import Array
from freefloat.visualization.figure_style import (
    BLACK,
    BLUE,
    COLUMN,
    GREEN,
    GREY,
    PAGE,
    VERMILION,
    axis_label,
    digits,
    draw_point,
    legend_above,
    new_figure,
    styled,
)
from freefloat.visualization.figures.scene_outlines import (
    draw_in_plane,
    draw_in_space,
    from_above,
    outline_points,
)
from freefloat.visualization.figures.views import set_equal_scales
from freefloat.visualization.scenes.visuals import (
    RobotVisuals,
    body_poses,
    bounding_box,
    largest_box,
    robot_visuals,
    view_direction,
)

_S = np.linspace(0.0, 1.0, 301)
"""Path parameters at which paths are drawn."""
_TIP = np.zeros(3)
_INSTANTS, _VIEWS = 5, 3
"""Number of robots drawn in the plane and in space."""
_LIGHTEST = 0.72
_DEPENDENT, _INDEPENDENT, _UNDECIDED = "#D0D0D0", "#E9F5EF", "#F5E6C8"
_AREAS = {(True, False): ("PDW A", "#C4C4C4"), (False, True): ("PDW B", "#DEDEDE"),
          (True, True): ("PDW A and B", "#A9A9A9")}  # fmt: skip
"""Names and colours of path-dependent areas, by whether they are of curve I and of curve II."""
_FACES = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
"""Corners of the faces of a box."""
_LARGE = 0.25
"""Least size of the shapes of the spacecraft that are drawn, over that of the largest box."""


@dataclass(frozen=True, eq=False)
class Outline:
    """Boxes of the spacecraft and line of the arm in the inertial frame.

    Attributes:
        spacecraft: Corners of the boxes [m], the largest first, z changing fastest, then y, shape
            (B, 8, 3).
        arm: Mount on the box, joints, end-effector [m], shape (n + 2, 3).
        others: Joints of each further arm that moves, and its end-effector [m], shape (n + 1, 3).
    """

    spacecraft: Array
    arm: Array
    others: tuple[Array, ...] = ()


def outlines(motion: Motion, times: npt.ArrayLike) -> list[Outline]:
    """The outlines of the robot at times of a motion [s], shape (K,).

    Raises:
        InputError: If a time lies outside the motion.
    """
    model = motion.problem.model
    boxes = _spacecraft_boxes(robot_visuals(model))
    box = boxes[0]
    edges = box[[4, 2, 1]] - box[0]
    fractions = edges @ (model.bodies[1].placement.position - box[0]) / (edges**2).sum(axis=1)
    mount = box[0] + np.clip(fractions, 0.0, 1.0) @ edges  # point nearest to the first joint
    positions, rotations = body_poses(motion, motion.coordinates_at(times))
    last, bodies = model.link_places[model.end_effector_link][0], len(model.bodies)
    arm = [*range(1, last + 1), -1]
    starts = [k for k, body in enumerate(model.bodies) if k > last and body.parent == 0]
    others = [[*range(*ends), bodies + tip] for tip, ends in enumerate(pairwise([*starts, bodies]))]
    return [
        Outline(
            points[0] + boxes @ R.T, np.vstack([points[0] + R @ mount, points[arm]]),
            tuple(points[other] for other in others),
        )
        for points, R in zip(positions, rotations[:, 0], strict=True)
    ]  # fmt: skip


def _spacecraft_boxes(visuals: RobotVisuals) -> Array:
    """Corners of the boxes around the large shapes of the spacecraft [m], shape (B, 8, 3)."""
    largest = largest_box(visuals, 0)
    boxes = [bounding_box(visual) for visual in visuals.shapes if visual.body == 0]
    least = _LARGE * np.linalg.norm(largest[7] - largest[0])
    large = [box for box in boxes if np.linalg.norm(box[7] - box[0]) >= least]
    return np.array([largest, *(box for box in large if not np.array_equal(box, largest))])


@styled
def workspace_figure(problem: Problem, workspace: Workspace) -> Figure:
    """The figure of path-dependent and path-independent areas with the path.

    In space the areas are spherical shells, drawn over the distance from the centre of mass.
    """
    figure = new_figure(COLUMN, COLUMN if problem.task.planar else 2.6)
    axes = figure.subplots()
    if problem.task.planar:
        _draw_areas(axes, workspace)
        _draw_path(axes, problem, workspace)
    else:
        _draw_distances(axes, problem, workspace)
    legend_above(axes, columns=3)
    return figure


def _draw_distances(axes: Any, problem: Problem, workspace: Workspace) -> None:
    """Distance of the path from the centre of mass over the areas."""
    points = _sampled_path(problem.path, workspace.offset)
    for label, (low, high), colour in _labelled_areas(workspace):
        axes.axhspan(low, high, color=colour, linewidth=0.0, zorder=0, label=label)
    for radius in workspace.reach:
        label = "reach" if radius == workspace.reach[1] else None
        axes.axhline(radius, color=GREY, linewidth=0.7, label=label)
    axes.plot(_S, np.linalg.norm(points, axis=1), color=BLUE, label=workspace.point)
    axes.set(xlim=(0.0, 1.0), ylim=(0.0, 1.05 * workspace.reach[1]))
    axes.set_xlabel(axis_label("path parameter $s$", "1"))
    axes.set_ylabel(axis_label("distance from centre", "m"))


def _sampled_path(path: TimedPath, offset: Array = _TIP) -> Array:
    """Positions of a point of the end-effector along a path [m], shape (K, 3)."""
    poses = [path.pose_at(value) for value in _S.tolist()]
    return np.array([pose.position + pose.rotation @ offset for pose in poses])


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

    Of an elbow arm they are those of the in-plane factor: shoulder and wrist can be singular in
    all.
    """
    kinds = workspace.area_a, workspace.area_b
    edges = sorted({edge for areas in kinds for interval in areas for edge in interval})
    for low, high in pairwise(edges):
        middle = (low + high) / 2.0
        a, b = (any(first < middle < last for first, last in areas) for areas in kinds)
        if a or b:
            yield _AREAS[a, b][0], (low, high), _AREAS[a, b][1]


@styled
def snapshots_figure(motion: Motion, workspace: Workspace | None = None) -> Figure:
    """The figure of the robot, and its scene, at several instants (Figs. 6, 7, 9 and 10).

    Args:
        motion: The motion.
        workspace: Areas drawn behind a planar motion.
    """
    if motion.problem.task.planar:
        figure = new_figure(COLUMN, COLUMN)
        axes = figure.subplots()
        draw_snapshots(axes, motion, workspace)
        legend_above(axes, columns=3)
        return figure
    figure = new_figure(PAGE, 3.0)
    views = figure.subplots(1, _VIEWS, subplot_kw={"projection": "3d"})
    times = np.linspace(motion.initial.time, motion.final.time, _VIEWS)
    robots = outlines(motion, times)
    for axes, robot, time in zip(views, robots, times, strict=True):
        _draw_in_space(axes, motion.problem, robot)
        draw_in_space(axes, motion, float(time))
        axes.set_title(f"{digits(time)} s", y=1.0)
    _mark_singular(views[-1], motion)
    bodies = np.array([[robot.spacecraft[0].mean(axis=0), *robot.arm[1:]] for robot in robots])
    points = np.vstack([
        points for robot in robots for points in (*robot.spacecraft, robot.arm, *robot.others)
    ])  # fmt: skip
    others = [p for time in times for _, p in outline_points(motion, float(time))]
    points = np.vstack([points, *others])
    eye = view_direction([bodies], [np.mean(other, axis=0) for other in others])
    set_equal_scales(views, points, eye)
    handles, names = views[-1].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=len(handles))
    return figure


def draw_snapshots(axes: Any, motion: Motion, workspace: Workspace | None) -> None:
    """Draw areas, path and a planar robot at evenly spaced instants, from light to dark.

    The spacecraft is drawn at the first and the last instant only.
    """
    if workspace is not None:
        _draw_areas(axes, workspace)
    _draw_path(axes, motion.problem, workspace)
    times = np.linspace(motion.initial.time, motion.final.time, _INSTANTS)
    robots, plane = outlines(motion, times), motion.problem.plane
    draw_in_plane(axes, motion, times)
    shades = [f"{shade:.3f}" for shade in np.linspace(_LIGHTEST, 0.0, _INSTANTS)]
    for k in (0, -1):
        for box in robots[k].spacecraft[::-1]:
            axes.add_patch(Polygon(from_above(plane.seen(box)), fill=False, edgecolor=shades[k]))
    for robot, shade in zip(robots, shades, strict=True):
        for points in (robot.arm, *robot.others):
            _draw_arm(axes, plane.seen(points)[:, :2], shade)
    _mark_singular(axes, motion, plane)


def _draw_arm(axes: Any, points: Array, shade: str) -> None:
    axes.plot(
        *points.T, color=shade, linestyle="-", linewidth=1.4, marker="o", markersize=2.4,
        markerfacecolor="white", zorder=4,
    )  # fmt: skip


def _mark_singular(axes: Any, motion: Motion, plane: Plane | None = None) -> None:
    if motion.ending is Ending.SINGULAR:
        position = motion.problem.path.pose(motion.final.time).position
        if plane is not None:
            position = plane.seen(position)[:2]
        label = f"singular at {digits(motion.final.time)} s"
        draw_point(axes, position, "X", 6.0, color=VERMILION, zorder=9, label=label)


def _draw_areas(axes: Any, workspace: Workspace) -> None:
    """Draw areas as rings, the reach as circles and the centre of mass."""
    for label, (low, high), colour in _labelled_areas(workspace):
        ring = Wedge(
            (0.0, 0.0), high, 0.0, 360.0, width=high - low, facecolor=colour, linewidth=0.0,
            zorder=0, label=label,
        )  # fmt: skip
        axes.add_patch(ring)
    for radius in workspace.reach:
        axes.add_patch(Circle((0.0, 0.0), radius, fill=False, edgecolor=GREY, linewidth=0.7))
    axes.plot([], [], color=GREY, linestyle="-", linewidth=0.7, label="limits of reach")
    draw_point(axes, np.zeros(2), "+", 6.0, color=BLACK, label="centre of mass")


def _draw_path(axes: Any, problem: Problem, workspace: Workspace | None) -> None:
    """Draw planar paths and the path of the reference point (point 3 of the paper)."""
    plane = problem.plane
    _draw_lines(axes, problem, plane)
    if workspace is not None and workspace.offset.any():
        points = _sampled_path(problem.path, workspace.offset)
        style = {"color": GREEN, "linestyle": "--", "linewidth": 1.3}
        axes.plot(*plane.seen(points)[:, :2].T, label=workspace.point, **style)
    axes.set_aspect("equal")
    axes.set_xlabel(axis_label(f"${plane.letters[0]}$", "m"))
    axes.set_ylabel(axis_label(f"${plane.letters[1]}$", "m"))


def _draw_lines(axes: Any, problem: Problem, plane: Plane | None = None) -> None:
    """Draw the paths of all end-effectors, with both ends."""
    for number, timed in enumerate(problem.path.every):
        path, named = _sampled_path(timed), number == 0
        if plane is not None:
            path = plane.seen(path)[:, :2]
        line = {"color": BLUE, "linestyle": "-", "linewidth": 1.6}
        axes.plot(*path.T, label="path" if named else None, **line)
        for place, name, fill in ((path[0], "start", "white"), (path[-1], "end", BLUE)):
            style = {"color": BLUE, "markerfacecolor": fill, "zorder": 6}
            draw_point(axes, place, "s", 4.5, label=name if named else None, **style)


def _draw_in_space(axes: Any, problem: Problem, robot: Outline) -> None:
    _draw_lines(axes, problem)
    faces = robot.spacecraft[:, _FACES].reshape(-1, 4, 3)
    style = {"facecolors": _DEPENDENT, "edgecolors": GREY, "linewidths": 0.6, "alpha": 0.45}
    axes.add_collection3d(Poly3DCollection(faces, **style))
    for points in (robot.arm, *robot.others):
        _draw_arm(axes, points, BLACK)
