"""What is drawn beside the robot: path and trail, areas, momentum, axes, where a motion ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from meshcat import geometry as g
from trimesh.creation import icosphere

from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, Pose
from freefloat.visualization.body_poses import body_poses_at
from freefloat.visualization.stage import Stage
from freefloat.visualization.tubes import SIDES, arrow, tube, tube_between
from freefloat.workspace.margin_curves import Workspace

PATH, TRAIL, AREAS = "End-effector path", "Trail", "Areas"
CENTRE, MOMENTUM = "Centre of mass", "Momentum"
BASE_AXES, HAND_AXES, SINGULARITY = "Spacecraft axes", "End-effector axes", "Singularity"
ITEMS = (PATH, TRAIL, AREAS, CENTRE, MOMENTUM, BASE_AXES, HAND_AXES, SINGULARITY)
"""Names of the nodes in the scene tree, as people read them."""

_PALE = (0.85, 0.88, 0.92, 0.55)
_GOLD = (1.0, 0.84, 0.2, 1.0)
_RED = (0.95, 0.25, 0.1, 1.0)
_DEPENDENT = (0.84, 0.37, 0.0)
_INDEPENDENT = (0.0, 0.62, 0.45)
_AXES = np.array([[0.90, 0.25, 0.20], [0.25, 0.75, 0.30], [0.30, 0.50, 1.00]])

Colouring = Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class Trail:
    """The way of the end-effector so far.

    Attributes:
        times: When it is at each ring of the tube [s], shape (K,).
        values: Magnitude of the margin's measure there, shape (K,).
        fractions: Of the path, s in [0, 1], shape (K,).
        indices: Of the tube's triangles from one ring to the next; none where it stays in place.
    """

    times: Array
    values: Array
    fractions: Array
    indices: int


def thickness(problem: Problem) -> float:
    """Radius of what is drawn as a line [m]."""
    return 0.006 * VirtualManipulator.of(problem.model).reach


def draw_path(stage: Stage, root: str, problem: Problem) -> list[dict[str, Any]]:
    """The whole path as a thin tube; labels for its ends."""
    s = np.linspace(0.0, 1.0, 201)
    points = np.array([problem.path.path.curve(float(value)) for value in s])
    moves = float(np.ptp(points, axis=0).max()) > 0.0
    if moves:
        vertices, faces = tube(points, 0.5 * thickness(problem))
        stage.mesh(f"{root}/{PATH}", g.TriangularMeshGeometry(vertices, faces), _PALE, shaded=False)
    ends = [("start", points[0]), ("end", points[-1])] if moves else [("path", points[0])]
    return [_label(text, point, PATH) for text, point in ends]


def draw_trail(
    stage: Stage, root: str, motion: Motion, times: Array, colouring: Colouring, rings: int
) -> Trail:
    """The way of the end-effector as a thick tube, coloured by the margin's measure.

    Args:
        stage: Where to draw.
        root: Path of the motion.
        motion: The motion.
        times: Between which it is nearly straight [s].
        colouring: Colours (K, 3) of magnitudes (K,).
        rings: About how many the tube may have.
    """
    problem = motion.problem
    tips = body_poses_at(motion, motion.parameter_at(times))[1].tips
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(tips, axis=0), axis=1)))
    still = length[-1] <= 1e-6 * VirtualManipulator.of(problem.model).reach
    run = np.linspace(0.0, 1.0, len(length)) if still else length / length[-1]
    even = np.interp(np.linspace(0.0, 1.0, rings // 2), run, times)
    shown = np.unique(np.append(even, np.linspace(times[0], times[-1], rings // 2)))
    places = motion.parameter_at(shown)
    places[[0, -1]] = motion.node_parameters[[0, -1]]  # where a measure vanishes is the very end
    _, poses = body_poses_at(motion, places)
    joints = motion.evaluate(places)[2]
    values = np.abs([problem.margin.measure(q) for q in joints])
    fractions = np.array([problem.path.timing.s(float(t)) for t in shown])
    if not still:
        vertices, faces = tube(poses.tips, thickness(problem))
        colours = np.repeat(colouring(values), SIDES, axis=0)
        stage.coloured_mesh(f"{root}/{TRAIL}", vertices, faces, colours)
    return Trail(shown, values, fractions, 0 if still else 6 * SIDES)


def draw_areas(stage: Stage, root: str, problem: Problem, areas: Workspace) -> None:
    """Rings in the plane, shells in space: where the arm can be singular, and where it cannot.

    They are drawn about the centre of mass; shells by their outer faces.
    """
    kinds = [(areas.path_dependent, _DEPENDENT), (areas.path_independent, _INDEPENDENT)]
    parts = [(interval, colour) for intervals, colour in kinds for interval in intervals or ()]
    level = float(problem.path.path.curve(0.0)[2])
    for number, ((inner, outer), colour) in enumerate(sorted(parts)):
        path = f"{root}/{AREAS}/{number + 1}"
        if problem.task.planar:
            geometry = _annulus(inner, outer, level - 3.0 * thickness(problem))
            stage.mesh(path, geometry, (*colour, 0.25), shaded=False)
        else:
            ball = icosphere(subdivisions=4, radius=outer)
            shell = g.TriangularMeshGeometry(ball.vertices, ball.faces)
            stage.mesh(path, shell, (*colour, 0.10))


def _annulus(inner: float, outer: float, level: float) -> Any:
    angles = np.linspace(0.0, 2.0 * np.pi, 181)
    circle = np.column_stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)])
    circle[:, 2] = level
    vertices = np.vstack([circle * [inner, inner, 1.0], circle * [outer, outer, 1.0]])
    first = np.arange(180)
    far = first + 181
    faces = np.vstack([
        np.column_stack([first, far, far + 1]), np.column_stack([first, far + 1, first + 1]),
    ])  # fmt: skip
    return g.TriangularMeshGeometry(vertices, faces)


def draw_centre(stage: Stage, root: str, problem: Problem) -> list[dict[str, Any]]:
    """The centre of mass, which never moves, and the momentum as an arrow from it."""
    size = thickness(problem)
    stage.mesh(f"{root}/{CENTRE}", g.Sphere(2.5 * size), _GOLD, hidden=False)
    h = float(np.linalg.norm(problem.momentum))
    if h == 0.0:
        return []
    end = 60.0 * size * problem.momentum / h
    vertices, faces = arrow(np.zeros(3), end, 0.8 * size)
    geometry = g.TriangularMeshGeometry(vertices, faces)
    stage.mesh(f"{root}/{MOMENTUM}", geometry, _GOLD, hidden=False)
    return [_label(f"h = {h:.3g} N m s", end, MOMENTUM)]


def draw_axes(stage: Stage, path: str, size: float, radius: float) -> None:
    """Three axes at a path: x red, y green, z blue."""
    tubes = [tube_between(np.zeros(3), size * axis, radius) for axis in np.eye(3)]
    count = len(tubes[0][0])
    stage.coloured_mesh(
        path,
        np.vstack([vertices for vertices, _ in tubes]),
        np.vstack([faces + number * count for number, (_, faces) in enumerate(tubes)]),
        np.repeat(_AXES, count, axis=0),
        hidden=False,
    )


def draw_ending(stage: Stage, root: str, motion: Motion) -> list[dict[str, Any]]:
    """A mark where a motion became singular or used up its margin."""
    if motion.ending is Ending.COMPLETED:
        return []
    final = motion.final
    tip = motion.problem.model.end_effector_pose(final.attitude, final.joints).position
    path = f"{root}/{SINGULARITY}/mark"  # people switch the node, time what is in it
    stage.mesh(path, g.Sphere(3.0 * thickness(motion.problem)), _RED, hidden=False)
    stage.place(path, Pose(tip, np.eye(3)))
    stage.appear(path, final.time)
    word = "singular" if motion.ending is Ending.SINGULAR else "margin used up"
    return [_label(f"{word} at t = {final.time:.3f} s", tip, SINGULARITY, final.time)]


def _label(text: str, position: Array, item: str, since: float = 0.0) -> dict[str, Any]:
    return {"text": text, "position": [float(x) for x in position], "item": item, "since": since}
