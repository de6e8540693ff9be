"""Bodies of a scene in figures: convex outlines of their shapes at an instant."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np
import scipy
from matplotlib.patches import Polygon
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from freefloat.attitude_grids import even_directions
from freefloat.motion.motion import Motion
from freefloat.motion.scene_poses import scene_poses
from freefloat.robot.meshes import Mesh
from freefloat.robot.shapes import Box, Cylinder, corners
from freefloat.scene.scene_body import SceneBody
from freefloat.so3 import Array
from freefloat.visualization.figure_style import ORANGE
from freefloat.visualization.scenes.surroundings import body_visuals
from freefloat.visualization.scenes.visuals import Shape

_ROUND = 48
"""Points on a circle."""
_SPHERE = 400
"""Points on a sphere."""
_DECIMALS = 9
_JOGGLE = "QJ"
"""Option of Qhull for flat shapes."""


def draw_in_plane(axes: Any, motion: Motion, times: Array) -> None:
    """Draw the outlines of the bodies in the robot's plane, of moving ones at all times [s]."""
    drifts = motion.problem.path.drifts
    label: str | None = "other bodies"
    for number, time in enumerate(times.tolist()):
        for body, points in outline_points(motion, time):
            if number == 0 or drifts or body.motion != "fixed":
                outline = from_above(motion.problem.plane.seen(points))
                style: Any = {
                    "facecolor": ORANGE,
                    "edgecolor": ORANGE,
                    "linewidth": 0.8,
                    "alpha": 0.3,
                }
                axes.add_patch(Polygon(outline, label=label, zorder=1, **style))
                label = None


def from_above(points: Array) -> Array:
    """Corners of the convex outline of points (K, 3) in the x-y plane [m], shape (C, 2)."""
    places = np.unique(points[:, :2].round(_DECIMALS), axis=0)
    return np.asarray(places[scipy.spatial.ConvexHull(places, qhull_options=_JOGGLE).vertices])


def draw_in_space(axes: Any, motion: Motion, time: float) -> None:
    """Draw the bodies at a time [s]."""
    for _, points in outline_points(motion, time):
        faces = points[scipy.spatial.ConvexHull(points, qhull_options=_JOGGLE).simplices]
        axes.add_collection3d(Poly3DCollection(faces, facecolors=ORANGE, alpha=0.25))


def outline_points(motion: Motion, time: float) -> Iterator[tuple[SceneBody, Array]]:
    """Yield each shape of the bodies at a time [s] as points in the inertial frame [m], (K, 3)."""
    _, attitudes, joints = motion.evaluate(motion.coordinates_at([time]))
    poses = scene_poses(motion, time, attitudes[0], joints[0])
    for body, pose in zip(motion.problem.scene.bodies, poses, strict=True):
        for points in _body_points(body):
            yield body, pose.position + points @ pose.rotation.T


@lru_cache(maxsize=64)
def _body_points(body: SceneBody) -> tuple[Array, ...]:
    """Points of the shapes of a body in its frame [m], shape (K, 3) each."""
    return tuple(
        visual.placement.position + _points(visual.shape) @ visual.placement.rotation.T
        for visual in body_visuals(0, body).shapes
    )


def _points(shape: Shape) -> Array:
    """Points of a shape in its own frame whose convex hull is nearly that of the shape."""
    if isinstance(shape, Mesh):
        return shape.vertices
    if isinstance(shape, Box):
        return corners(shape)
    if isinstance(shape, Cylinder):
        angles = np.linspace(0.0, 2.0 * np.pi, _ROUND, endpoint=False)
        ring = shape.radius * np.column_stack([np.cos(angles), np.sin(angles)])
        ends = (np.full(_ROUND, end * shape.length / 2.0) for end in (-1.0, 1.0))
        return np.vstack([np.column_stack([ring, end]) for end in ends])
    return shape.radius * even_directions(_SPHERE)
