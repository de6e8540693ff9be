"""Bounds of the derivatives of distances between pairs of shapes: how fast they may change."""

from __future__ import annotations

import numpy as np

from freefloat.limits.collision import CollisionShape
from freefloat.limits.pairs import CollisionPairs
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array


def joint_levers(pairs: CollisionPairs, strokes: Array) -> Array:
    """Bounds of the derivatives of the distances by the joint values.

    A revolute joint moves the nearest points by no more than their distance from its axis; of the
    two shapes the nearer one counts, because only their relative motion matters. Pairs with a body
    of the scene have :func:`frame_levers` instead.

    Args:
        pairs: The P pairs.
        strokes: Largest magnitudes of the prismatic joints' values [m], shape (n,).

    Returns:
        [m/rad or m/m], shape (P, n).
    """
    model, (first, second) = pairs.model, pairs.bodies.T
    reach = np.array([_reach(model, shape, strokes) for shape in pairs.shapes])
    own = second <= model.dof
    between = np.zeros((len(first), model.dof), dtype=bool)
    between[own] = model.moved_by[first[own]] ^ model.moved_by[second[own]]
    revolute = reach[pairs.pairs].min(axis=1)
    return np.where(between, np.where(model.prismatic, 1.0, revolute), 0.0)


def frame_levers(pairs: CollisionPairs) -> Array:
    """Bounds of the derivatives of the distances by the motions of the bodies' frames.

    Of a pair with a body of the scene both frames count.

    Args:
        pairs: The P pairs.

    Returns:
        By the translation of each of the F bodies' frames [m/m] and, from column F on, by its
        rotation [m/rad]: the radius of the shape about its origin, shape (P, 2 F).
    """
    radii = np.array([np.linalg.norm(shape.points, axis=1).max() for shape in pairs.shapes])
    count = len(pairs.model.bodies) + len(pairs.scene.bodies)
    levers = np.zeros((len(pairs.pairs), 2 * count))
    (rows,) = np.nonzero(pairs.bodies[:, 1] > pairs.model.dof)
    for body, radius in zip(pairs.bodies[rows].T, radii[pairs.pairs][rows].T, strict=True):
        levers[rows, body], levers[rows, count + body] = 1.0, radius
    return levers


def _reach(model: FreeFloatingModel, shape: CollisionShape, strokes: Array) -> Array:
    """Bounds of the distances of a shape's points from every joint axis [m], shape (n,)."""
    arm = model.bodies[1:]
    steps = np.array([np.linalg.norm(body.placement.position) for body in arm])
    lengths = steps + np.where(model.prismatic, strokes, 0.0)
    radius = np.linalg.norm(shape.points, axis=1).max()
    moved = np.vstack([model.moved_by, np.zeros(len(arm), dtype=bool)])
    own = moved[min(shape.body, len(arm) + 1)]
    reach = np.empty(len(arm))
    for k, body in enumerate(arm, start=1):
        if k == shape.body:
            reach[k - 1] = _from_axis(shape.points, body.axis)
        elif body.parent == shape.body:
            pose = body.placement
            points = shape.points - pose.position
            reach[k - 1] = _from_axis(points, pose.rotation @ body.axis)
        else:
            reach[k - 1] = radius + lengths[own ^ moved[k]].sum()
    return reach


def _from_axis(points: Array, axis: Array) -> float:
    """Distance of the farthest point from an axis through the origin [m]."""
    across = points - np.outer(points @ axis, axis)
    return float(np.linalg.norm(across, axis=1).max())
