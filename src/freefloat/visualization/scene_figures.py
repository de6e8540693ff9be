"""Figures of the robot, and the bodies of its scene, at several instants."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from mpl_toolkits.mplot3d.proj3d import proj_transform

from freefloat.attitude_grids import even_directions
from freefloat.dynamics.plane import Plane
from freefloat.motion.law import scene_poses
from freefloat.motion.motion import Ending, Motion
from freefloat.regions.workspace import Workspace
from freefloat.robot.meshes import Mesh
from freefloat.robot.shapes import Box, Cylinder, corners
from freefloat.scene.scene_body import SceneBody
from freefloat.so3 import Array, Pose, cross
from freefloat.visualization import figure_style as style
from freefloat.visualization.scenes.overlays import surface_of_revolution
from freefloat.visualization.scenes.surroundings import body_visuals
from freefloat.visualization.scenes.visuals import (
    Shape,
    Visuals,
    body_poses,
    bounding_box,
    largest_box,
    robot_visuals,
    view_direction,
)
from freefloat.visualization.workspace_figure import draw_areas, draw_lines, draw_path

_INSTANTS, _VIEWS = 5, 3
"""Number of robots drawn in the plane and in space."""
_WAY_POINTS = 301
"""Points of the lines of paths."""
_LIGHTEST = 0.72
_FACE = "#D0D0D0"
_FACES = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
"""Corners of the faces of a box."""
_LARGE = 0.25
"""Least size of the shapes of the spacecraft that are drawn, over the size of the largest box."""
_FLATTEST, _ZOOM, _TICKS = 0.4, (0.62, 0.8), 4
"""Least side of the box of a view over its largest one, the width and height of the box in its
axes, and the number of ticks of the longest edge."""
_EDGES = np.array([
    [(-1, 1, -1), (1, 1, -1)], [(1, -1, -1), (1, 1, -1)], [(1, -1, 1), (1, -1, -1)],
])  # fmt: skip
"""Ends of the edges with numbers over half of the box, where the eye is at positive x, y and z."""
_SPHERE, _DECIMALS = 400, 9
"""Points on a sphere, and decimals of points of outlines [m]."""
_JOGGLE = "QJ"  # of Qhull, for flat shapes
_ARM: Any = {"linestyle": "-", "linewidth": 1.4, "marker": "o", "markersize": 2.4}
_BODY: Any = {
    "facecolor": style.ORANGE, "edgecolor": style.ORANGE, "linewidth": 0.8, "alpha": 0.3,
    "zorder": 1,
}  # fmt: skip


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
    model = motion.model
    boxes = _spacecraft_boxes(robot_visuals(model))
    box = boxes[0]
    edges = box[[4, 2, 1]] - box[0]
    fractions = edges @ (model.bodies[1].placement.position - box[0]) / (edges**2).sum(axis=1)
    mount = box[0] + np.clip(fractions, 0.0, 1.0) @ edges  # point nearest to the first joint
    positions, rotations = body_poses(motion, motion.coordinates_at(times))
    last, bodies = model.link_places[model.end_effector_link][0], len(model.bodies)
    arm = [*range(1, last + 1), -1]
    starts = [k for k, body in enumerate(model.bodies) if k > last and body.parent == 0]
    chains = [[*range(*ends), bodies + tip] for tip, ends in enumerate(pairwise([*starts, bodies]))]
    return [
        Outline(
            points[0] + boxes @ R.T, np.vstack([points[0] + R @ mount, points[arm]]),
            tuple(points[other] for other in chains),
        )
        for points, R in zip(positions, rotations[:, 0], strict=True)
    ]  # fmt: skip


def _spacecraft_boxes(visuals: Visuals) -> Array:
    """Corners of the boxes around the large shapes of the spacecraft [m], shape (B, 8, 3)."""
    largest = largest_box(visuals, 0)
    boxes = [bounding_box(visual) for visual in visuals.shapes if visual.body == 0]
    least = _LARGE * np.linalg.norm(largest[7] - largest[0])
    large = [box for box in boxes if np.linalg.norm(box[7] - box[0]) >= least]
    return np.array([largest, *(box for box in large if not np.array_equal(box, largest))])


@style.styled
def snapshots_figure(motion: Motion, workspace: Workspace | None = None) -> Figure:
    """The figure of the robot, and its scene, at several instants (Figs. 6, 7, 9 and 10).

    Args:
        motion: The motion.
        workspace: Areas drawn behind a planar motion.
    """
    if motion.setting.task.planar:
        figure = style.new_figure(style.COLUMN, style.COLUMN)
        axes = figure.subplots()
        draw_snapshots(axes, motion, workspace)
        style.legend_above(axes, columns=3)
        return figure
    figure = style.new_figure(style.PAGE, 3.0)
    views = figure.subplots(1, _VIEWS, subplot_kw={"projection": "3d"})
    times = np.linspace(motion.initial.time, motion.final.time, _VIEWS)
    robots = outlines(motion, times)
    for axes, robot, time in zip(views, robots, times, strict=True):
        _draw_in_space(axes, motion, robot, float(time))
        axes.set_title(f"{style.digits(time)} s", y=1.0)
    _mark_singular(views[-1], motion)
    bodies = np.array([[robot.spacecraft[0].mean(axis=0), *robot.arm[1:]] for robot in robots])
    parts = [part for robot in robots for part in (*robot.spacecraft, robot.arm, *robot.others)]
    others = [p for time in times for _, p in outline_points(motion, float(time))]
    eye = view_direction([bodies], [other.mean(axis=0) for other in others])
    _set_equal_scales(views, np.vstack([*parts, *others]), eye)
    drawn = views[-1].get_legend_handles_labels()
    figure.legend(*drawn, loc="outside lower center", ncols=len(drawn[0]))
    return figure


def draw_snapshots(axes: Any, motion: Motion, workspace: Workspace | None) -> None:
    """Draw areas, path and a planar robot at evenly spaced instants, from light to dark.

    The spacecraft is drawn at the first and the last instant only.
    """
    if workspace is not None:
        draw_areas(axes, workspace)
    draw_path(axes, _ways(motion), motion.setting.plane, workspace)
    times = np.linspace(motion.initial.time, motion.final.time, _INSTANTS)
    robots, plane = outlines(motion, times), motion.setting.plane
    _draw_bodies(axes, motion, times)
    shades = [f"{shade:.3f}" for shade in np.linspace(_LIGHTEST, 0.0, _INSTANTS)]
    for k in (0, -1):
        for box in robots[k].spacecraft[::-1]:
            axes.add_patch(Polygon(from_above(plane.seen(box)), fill=False, edgecolor=shades[k]))
    for robot, shade in zip(robots, shades, strict=True):
        for points in (robot.arm, *robot.others):
            _draw_arm(axes, plane.seen(points)[:, :2], shade)
    _mark_singular(axes, motion, plane)


def _ways(motion: Motion) -> list[Pose]:
    return [*motion.ways(_WAY_POINTS).values()]


def _draw_arm(axes: Any, points: Array, shade: str) -> None:
    axes.plot(*points.T, color=shade, markerfacecolor="white", zorder=4, **_ARM)


def _mark_singular(axes: Any, motion: Motion, plane: Plane | None = None) -> None:
    if motion.ending is Ending.SINGULAR:
        final = motion.final
        position = motion.law.target(final.time, final.attitude, final.joints).position
        if plane is not None:
            position = plane.seen(position)[:2]
        label = f"singular at {style.digits(motion.final.time)} s"
        style.draw_point(axes, position, "X", 6.0, color=style.VERMILION, zorder=9, label=label)


def _draw_in_space(axes: Any, motion: Motion, robot: Outline, time: float) -> None:
    """Draw paths, robot and bodies of the scene at a time [s]."""
    draw_lines(axes, _ways(motion))
    faces = robot.spacecraft[:, _FACES].reshape(-1, 4, 3)
    look = {"facecolors": _FACE, "edgecolors": style.GREY, "linewidths": 0.6, "alpha": 0.45}
    axes.add_collection3d(Poly3DCollection(faces, **look))
    for points in (robot.arm, *robot.others):
        _draw_arm(axes, points, style.BLACK)
    for _, points in outline_points(motion, time):
        faces = points[scipy.spatial.ConvexHull(points, qhull_options=_JOGGLE).simplices]
        axes.add_collection3d(Poly3DCollection(faces, facecolors=style.ORANGE, alpha=0.25))


def _draw_bodies(axes: Any, motion: Motion, times: Array) -> None:
    """Draw the outlines of the bodies in the robot's plane, of moving ones at all times [s]."""
    drifts = motion.setting.drifts
    label: str | None = "other bodies"
    for number, time in enumerate(times.tolist()):
        for body, points in outline_points(motion, time):
            if number == 0 or drifts or body.motion != "fixed":
                outline = from_above(motion.setting.plane.seen(points))
                axes.add_patch(Polygon(outline, label=label, **_BODY))
                label = None


def from_above(points: Array) -> Array:
    """Corners of the convex outline of points (K, 3) in the x-y plane [m], shape (C, 2)."""
    places = np.unique(points[:, :2].round(_DECIMALS), axis=0)
    return np.asarray(places[scipy.spatial.ConvexHull(places, qhull_options=_JOGGLE).vertices])


def outline_points(motion: Motion, time: float) -> Iterator[tuple[SceneBody, Array]]:
    """Yield each shape of the bodies at a time [s] as points in the inertial frame [m], (K, 3)."""
    _, attitudes, joints = motion.evaluate(motion.coordinates_at([time]))
    poses = scene_poses(motion.law, time, attitudes[0], joints[0])
    for body, pose in zip(motion.setting.scene.bodies, poses, strict=True):
        for visual in body_visuals(0, body).shapes:
            place = visual.placement
            points = place.position + _points(visual.shape) @ place.rotation.T
            yield body, pose.position + points @ pose.rotation.T


def _points(shape: Shape) -> Array:
    """Points of a shape in its own frame whose convex hull is nearly the hull of the shape."""
    if isinstance(shape, Mesh):
        return shape.vertices
    if isinstance(shape, Box):
        return corners(shape)
    if isinstance(shape, Cylinder):
        ends = -shape.length / 2.0, shape.length / 2.0
        return surface_of_revolution(ends, (shape.radius, shape.radius))[0]
    return shape.radius * even_directions(_SPHERE)


def _set_equal_scales(views: Any, points: Array, eye: Array) -> None:
    """Show the same box around points (K, 3) in all views, from a direction (3,)."""
    azimuth, elevation = np.degrees([np.arctan2(eye[1], eye[0]), np.arcsin(eye[2])])
    low, high = points.min(axis=0), points.max(axis=0)
    middle, halves = (low + high) / 2.0, np.maximum(high - low, _FLATTEST * (high - low).max()) / 2
    across = np.array([-eye[1], eye[0], 0.0]) / np.hypot(eye[0], eye[1])
    seen = np.abs([across, cross(eye, across)]) @ halves  # half the width and height of the box
    zoom = float(np.linalg.norm(halves) * np.min(_ZOOM / seen))
    lengths = halves * np.sqrt(1.0 - eye**2)  # of its edges, as they are seen
    ticks = np.maximum(np.round(_TICKS * lengths / lengths.max()), 1.0).astype(int).tolist()
    edges = middle + _EDGES * np.where(eye < 0.0, -halves, halves)  # each from its named end
    for axes in views:
        axes.set_box_aspect(tuple(halves), zoom=zoom)
        axes.view_init(elev=elevation, azim=azimuth)
        for letter, least, most in zip("xyz", middle - halves, middle + halves, strict=True):
            getattr(axes, f"set_{letter}lim")(least, most)
        for letter, count, ends in zip("xyz", ticks, edges, strict=True):
            axis = getattr(axes, f"{letter}axis")
            axis.set_major_locator(MaxNLocator(count, prune="both"))
            axis.set_tick_params(labelbottom=False, color="none")
            axis.line.set_color("none")
            axes.plot(*ends.T, color=style.BLACK, linestyle="-", linewidth=0.6)
            _number_edge(axes, letter, ends, middle)


def _number_edge(axes: Any, letter: str, ends: Array, middle: Array) -> None:
    """Write the numbers of an axis, one with its name, beside an edge of the box around a point.

    Numbers of matplotlib's own lie over each other where an edge is seen at a small angle.
    """
    values = sorted(getattr(axes, f"get_{letter}ticks")(), reverse=bool((ends[0] > ends[1]).any()))
    points = [np.where(ends[0] == ends[1], ends[0], value) for value in values]
    seen = proj_transform(*np.transpose([middle, *ends, *points]), axes.get_proj())[:2]
    centre, first, last, *places = np.transpose(seen)
    along, beside = first - last, (first + last) / 2.0 - centre
    normal = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    normal *= np.sign(normal @ beside)
    side, above = np.round(normal).astype(int)
    texts = [style.digits(value) for value in values]
    texts[0] = f"${letter}$ = {texts[0]} m"
    sides = [side or int(np.sign(along[0])), *[side] * len(texts)]  # away from the other numbers
    for text, place, aside in zip(texts, places, sides, strict=False):
        axes.annotate(
            text, place, 3.0 * normal, textcoords="offset points", fontsize=7.0,
            ha=("center", "left", "right")[aside], va=("center", "bottom", "top")[above],
        )  # fmt: skip
