"""What is drawn beside the robot: path, trail, areas, momentum, axes, the end of a motion."""

from __future__ import annotations

from typing import Any

import numpy as np
from meshcat import geometry as g
from trimesh.creation import icosphere

from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, IntArray, Pose
from freefloat.visualization.scene_builder import SceneBuilder, label
from freefloat.visualization.tubes import SIDES, arrow, rod, tube
from freefloat.workspace.margin_curves import Workspace

PATH, TRAIL, AREAS = "End-effector path", "Trail", "Areas"
CENTRE, MOMENTUM = "Centre of mass", "Momentum"
BASE_AXES, TIP_AXES, SINGULARITY = "Spacecraft axes", "End-effector axes", "Singularity"
ITEMS = (PATH, TRAIL, AREAS, CENTRE, MOMENTUM, BASE_AXES, TIP_AXES, SINGULARITY)
"""Nodes of the scene tree that can be hidden, as the page names them."""

_PALE = (0.85, 0.88, 0.92, 0.55)
_GOLD = (1.0, 0.84, 0.2, 1.0)
_RED = (0.95, 0.25, 0.1, 1.0)
_DEPENDENT = (0.84, 0.37, 0.0)
_INDEPENDENT = (0.0, 0.62, 0.45)
_AXES = np.array([[0.90, 0.25, 0.20], [0.25, 0.75, 0.30], [0.30, 0.50, 1.00]])

Labels = list[dict[str, Any]]


def thickness(problem: Problem) -> float:
    """Return the radius of what is drawn as a line [m]."""
    return 0.006 * VirtualManipulator.of(problem.model).reach


def draw_path(builder: SceneBuilder, root: str, problem: Problem) -> Labels:
    """Draw the whole path as a thin tube; return labels of its ends."""
    curve = problem.path.path.curve
    points = np.array([curve(float(s)) for s in np.linspace(0.0, 1.0, 201)])
    if not np.ptp(points, axis=0).any():
        return [label("path", points[0], PATH)]
    line = tube(points, 0.5 * thickness(problem))
    builder.mesh(f"{root}/{PATH}", line, _PALE, shaded=False)
    return [label("start", points[0], PATH), label("end", points[-1], PATH)]


def draw_trail(
    builder: SceneBuilder, root: str, problem: Problem, tips: Array, colours: Array
) -> int:
    """Draw where the end-effector has been as a thick tube.

    Args:
        builder: Collects the commands.
        root: Path of the motion.
        problem: Of the motion.
        tips: Positions of the end-effector [m], shape (K, 3).
        colours: Red, green and blue there, shape (K, 3).

    Returns:
        Indices of triangles from one position to the next; zero where the end-effector rests.
    """
    if np.ptp(tips, axis=0).max() <= 1e-6 * VirtualManipulator.of(problem.model).reach:
        return 0
    vertices, faces = tube(tips, thickness(problem))
    builder.coloured_mesh(f"{root}/{TRAIL}", vertices, faces, np.repeat(colours, SIDES, axis=0))
    return 6 * SIDES


def draw_areas(builder: SceneBuilder, root: str, problem: Problem, areas: Workspace) -> None:
    """Draw path-dependent and path-independent areas as rings, in space as spheres."""
    kinds = [(areas.path_dependent, _DEPENDENT), (areas.path_independent, _INDEPENDENT)]
    parts = [(interval, colour) for intervals, colour in kinds for interval in intervals or ()]
    below = float(problem.path.path.curve(0.0)[2]) - 3.0 * thickness(problem)
    for number, ((inner, outer), colour) in enumerate(sorted(parts), start=1):
        path = f"{root}/{AREAS}/{number}"
        if problem.task.planar:
            builder.mesh(path, _ring(inner, outer, below), (*colour, 0.25), shaded=False)
        else:
            ball = icosphere(subdivisions=4, radius=outer)
            builder.mesh(path, (ball.vertices, ball.faces), (*colour, 0.10))


def _ring(inner: float, outer: float, z: float) -> tuple[Array, IntArray]:
    angles = np.linspace(0.0, 2.0 * np.pi, 181)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    vertices = np.column_stack([np.vstack([inner * circle, outer * circle]), np.full(362, z)])
    k = np.arange(180)
    return vertices, np.vstack(
        [np.stack([k, k + 181, k + 182], 1), np.stack([k, k + 182, k + 1], 1)]
    )


def draw_centre(builder: SceneBuilder, root: str, problem: Problem) -> Labels:
    """Draw the centre of mass, which does not move, and the momentum as an arrow from it."""
    size = thickness(problem)
    builder.mesh(f"{root}/{CENTRE}", g.Sphere(2.5 * size), _GOLD, overlay=True)
    magnitude = float(np.linalg.norm(problem.momentum))
    if magnitude == 0.0:
        return []
    end = 60.0 * size * problem.momentum / magnitude
    shape = arrow(np.zeros(3), end, 0.8 * size)
    builder.mesh(f"{root}/{MOMENTUM}", shape, _GOLD, overlay=True)
    return [label(f"h = {magnitude:.3g} N m s", end, MOMENTUM)]


def draw_axes(builder: SceneBuilder, path: str, length: float, radius: float) -> None:
    """Draw three axes: x red, y green, z blue."""
    rods = [rod(np.zeros(3), length * axis, radius) for axis in np.eye(3)]
    count = len(rods[0][0])
    builder.coloured_mesh(
        path,
        np.vstack([vertices for vertices, _ in rods]),
        np.vstack([faces + number * count for number, (_, faces) in enumerate(rods)]),
        np.repeat(_AXES, count, axis=0),
        overlay=True,
    )


def draw_ending(builder: SceneBuilder, root: str, motion: Motion) -> Labels:
    """Mark where a motion became singular or fell below the margin."""
    if motion.ending is Ending.COMPLETED:
        return []
    final = motion.final
    tip = motion.problem.model.end_effector_pose(final.attitude, final.joints).position
    path = f"{root}/{SINGULARITY}/mark"  # the item is hidden by the user, the mark by its track
    builder.mesh(path, g.Sphere(3.0 * thickness(motion.problem)), _RED, overlay=True)
    builder.place(path, Pose(tip, np.eye(3)))
    builder.appear(path, final.time)
    word = "singular" if motion.ending is Ending.SINGULAR else "below the margin"
    return [label(f"{word} at t = {final.time:.3f} s", tip, SINGULARITY, final.time)]
