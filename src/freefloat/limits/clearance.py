"""The smallest distance between bodies along a motion, found by branch and bound.

Between two configurations the distance of a pair changes by at most the path lengths of its joints
times their levers; for a pair with a body of the scene, of the two bodies' frames times theirs.
Intervals in which the distance may fall below the smallest one known are bisected until none is
left, so that no contact between samples is missed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.polynomial import chebyshev

from freefloat.limits.collision_shapes import CollisionShape
from freefloat.limits.pairs import CollisionPairs
from freefloat.motion.law import scene_poses
from freefloat.motion.motion import Motion
from freefloat.motion.panels import TO_COEFFICIENTS
from freefloat.robot.model import FreeFloatingModel
from freefloat.scene.scene import Scene
from freefloat.scene.tumbling import Tumbling
from freefloat.so3 import Array, IntArray, Pose, without_jumps

TOLERANCE = 1e-4
"""Bound of the error before the final refinement [m]."""
_PARTS = 16
"""Parts of a panel in each of which speeds are bounded."""
_DISTANCE_ERROR = 1e-9
"""Rounding error of distances [m]."""
_STARTS = 2
"""Initial intervals of a panel."""


def joint_levers(pairs: CollisionPairs, strokes: Array) -> Array:
    """Bounds of the derivatives of the P distances by the joint values [m/rad or m/m], (P, n).

    A revolute joint moves the nearest points by no more than their distance from its axis; of the
    two shapes the nearer one counts, because only their relative motion matters. Pairs with a body
    of the scene have :func:`frame_levers` instead. Prismatic joints have strokes (n,), the largest
    magnitudes of their values [m].
    """
    model, (first, second) = pairs.model, pairs.bodies.T
    reach = np.array([_reach(model, shape, strokes) for shape in pairs.shapes])
    links = second <= model.dof
    between = np.zeros((len(first), model.dof), dtype=bool)
    between[links] = model.moved_by[first[links]] ^ model.moved_by[second[links]]
    revolute = reach[pairs.pairs].min(axis=1)
    return np.where(between, np.where(model.prismatic, 1.0, revolute), 0.0)


def frame_levers(pairs: CollisionPairs) -> Array:
    """Bounds of the derivatives of the P distances by the motions of the bodies' frames, (P, 2 F).

    Of a pair with a body of the scene both frames count: by the translation of each of the F frames
    [m/m] and, from column F on, by its rotation [m/rad], the radius of the shape about its origin.
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
    chain = moved[min(shape.body, len(arm) + 1)]
    reach = np.empty(len(arm))
    for k, body in enumerate(arm, start=1):
        if k == shape.body:
            reach[k - 1] = _from_axis(shape.points, body.axis)
        elif body.parent == shape.body:
            pose = body.placement
            points = shape.points - pose.position
            reach[k - 1] = _from_axis(points, pose.rotation @ body.axis)
        else:
            reach[k - 1] = radius + lengths[chain ^ moved[k]].sum()
    return reach


def _from_axis(points: Array, axis: Array) -> float:
    """Distance of the farthest point from an axis through the origin [m]."""
    across = points - np.outer(points @ axis, axis)
    return float(np.linalg.norm(across, axis=1).max())


@dataclass(frozen=True)
class Clearance:
    """The smallest distance between two bodies."""

    distance: float  # distance of the shapes [m]; negative where they overlap
    pair: int  # index of the pair
    time: float  # time of the smallest distance [s]


def clearance(
    motion: Motion, pairs: CollisionPairs, below: float = np.inf, *, decide_only: bool = False
) -> Clearance:
    """The smallest distance of any pair along a motion.

    Args:
        motion: The motion.
        pairs: Pairs of its robot.
        below: Distances of interest [m]; a larger result need not be the smallest.
        decide_only: End the search at the first distance below that.
    """
    edges = np.linspace(0.0, motion.panels, _PARTS * motion.panels + 1)
    lengths = _path_lengths(motion.coefficients[:, :, 5:], 1)
    levers = joint_levers(pairs, np.abs(motion.joints).max(axis=0))
    if pairs.scene.bodies:
        lengths = np.hstack([lengths, _frame_path_lengths(motion, pairs.scene, edges)])
        levers = np.hstack([levers, frame_levers(pairs)])
    every, panels = np.arange(len(pairs.pairs)), float(motion.panels)
    places = np.linspace(0.0, panels, _STARTS * motion.panels + 1)
    middle, pair = np.repeat(places, len(every)), np.tile(every, len(places))
    distance = _distances(motion, pairs, middle, pair)
    best = distance.argmin()
    low, high = np.clip(middle[best] + np.array([-1.0, 1.0]) / _STARTS, 0.0, panels)
    nearest = (distance[best], pair[best], middle[best], low, high)
    low, high = (np.repeat(ends, len(every)) for ends in (places[:-1], places[1:]))
    before, after = distance[: -len(every)], distance[len(every) :]
    pair = pair[len(every) :]
    while len(pair) and not (decide_only and nearest[0] < below):
        change = np.zeros(len(pair))
        for k, path in enumerate(lengths.T):
            change += levers[pair, k] * (np.interp(high, edges, path) - np.interp(low, edges, path))
        kept = (before + after - change) / 2.0 < min(nearest[0] - TOLERANCE, below)
        if not kept.any():
            break
        pair, low, high, before, after = (x[kept] for x in (pair, low, high, before, after))
        middle = (low + high) / 2.0
        distance = _distances(motion, pairs, middle, pair)
        best = distance.argmin()
        if distance[best] < nearest[0]:
            nearest = (distance[best], pair[best], middle[best], low[best], high[best])
        pair = np.tile(pair, 2)
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        before, after = np.concatenate([before, distance]), np.concatenate([distance, after])
    smallest, number, place, start, end = nearest
    body, other = pairs.bodies[number]
    if body == other:  # constant but for rounding
        return Clearance(float(smallest), int(number), motion.time_at(0.0))
    if nearest[0] < below and not decide_only and start < end:
        only = np.array([number])
        refined = scipy.optimize.minimize_scalar(
            lambda u: _distances(motion, pairs, np.array([u]), only)[0],
            bounds=(start, end), method="bounded", options={"xatol": 1e-9},
        )  # fmt: skip
        if refined.fun < smallest - _DISTANCE_ERROR:
            smallest, place = refined.fun, refined.x
    return Clearance(float(smallest), int(number), motion.time_at(place))


def _distances(motion: Motion, pairs: CollisionPairs, places: Array, pair: IntArray) -> Array:
    """Distances of pairs at panel coordinates, shape (K,) each; every place is evaluated once."""
    distances = np.empty(len(pair))
    unique, number = np.unique(places, return_inverse=True)
    order = np.argsort(number, kind="stable")
    groups = np.split(order, np.cumsum(np.bincount(number, minlength=len(unique)))[:-1])
    states = motion.evaluate(unique)
    bodies = scene_poses(motion.law, *states)
    for k, (attitude, joints, group) in enumerate(zip(*states[1:], groups, strict=True)):
        poses = [body[k] for body in bodies]
        distances[group] = pairs.distances(joints, pair[group], attitude, poses)
    return distances


def _path_lengths(coefficients: Array, size: int) -> Array:
    """Bounds of the path lengths of vectors from the start of a motion to the ends of its parts.

    In each part of a panel a speed is at most the speed at the faster end plus the largest
    acceleration times half the part.

    Args:
        coefficients: Chebyshev coefficients of the C components, shape (panels, 9, C).
        size: Number of components of a vector.

    Returns:
        Shape (parts + 1, C / size).
    """
    x = np.linspace(-1.0, 1.0, _PARTS + 1)
    c = np.moveaxis(coefficients, 1, 0)
    count = c.shape[-1] // size

    def magnitudes(order: int) -> Array:
        values = np.moveaxis(chebyshev.chebval(x, chebyshev.chebder(c, order)), -1, 1)
        vectors = values.reshape(*values.shape[:2], count, size)
        return np.abs(values) if size == 1 else np.linalg.norm(vectors, axis=-1)

    speeds, accelerations = magnitudes(1), magnitudes(2).max(axis=1)
    fastest = np.maximum(speeds[:, :-1], speeds[:, 1:]) + accelerations[:, None] / _PARTS
    steps = (fastest * 2.0 / _PARTS).reshape(-1, count)
    return np.vstack([np.zeros(count), np.cumsum(steps, axis=0)])


def _frame_path_lengths(motion: Motion, scene: Scene, edges: Array) -> Array:
    """Path length bounds of the F frames of the robot's and scene's bodies, at panel coordinates.

    Inside panels frames follow the polynomials through their poses at the nodes, except frames of
    tumbling bodies, whose rate is bounded.

    Returns:
        Path lengths [m] and, from column F on, angles [rad], shape (parts + 1, 2 F).
    """

    def lengths(poses: Pose) -> Array:
        values = np.hstack([poses.position, without_jumps(poses.quaternion)])
        c = TO_COEFFICIENTS @ values[motion.panel_nodes]
        return np.hstack([_path_lengths(c[:, :, :3], 3), 2.0 * _path_lengths(c[:, :, 3:], 4)])

    setting = motion.setting
    robot = setting.model.body_poses(motion.attitudes, motion.joints)
    frames = [lengths(poses) for poses in robot]
    elapsed = np.abs(motion.evaluate(edges)[0] - motion.times[0])
    placed = scene_poses(motion.law, motion.times, motion.attitudes, motion.joints)
    for number, body in enumerate(scene.bodies):
        if body.motion == "target":
            frames.append(lengths(placed[number]))
            continue
        speed, rate, com = float(np.linalg.norm(setting.drift)), 0.0, 0.0
        if isinstance(body.motion, Tumbling):
            rate, com = body.motion.largest_rate, float(np.linalg.norm(body.motion.com))
        frames.append(np.outer(elapsed, [speed + rate * com, rate]))
    return np.stack(frames, axis=-1).reshape(len(edges), -1)
