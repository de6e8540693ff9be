"""Motions at the key times of their playback."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from freefloat.motion.motion import Motion
from freefloat.motion.pointing import PointingLimit
from freefloat.regions.workspace import Workspace
from freefloat.scene.tumbling import Tumbling
from freefloat.so3 import Array
from freefloat.visualization.scenes.pointing_cones import PointingCone
from freefloat.visualization.scenes.surroundings import Surroundings
from freefloat.visualization.scenes.visuals import RobotVisuals, body_poses

_RATE, _PLAYBACK, _PER_TURN = 25.0, 30.0, 12.0
"""Key frames per second of playback; longest initial playback time [s]; frames per revolution."""
MAX_KEYS = 6000
"""Key frames of all motions together."""


def key_times(motion: Motion, limit: int = MAX_KEYS) -> Array:
    """The times of a motion's key frames [s], shape (K,), in single precision.

    The union of evenly spaced times, 25 per second of playback and 12 per revolution of a tumbling
    body, and of the integration nodes, which are dense near singularities.

    Args:
        motion: The motion.
        limit: Maximum number of key frames.
    """
    first, last = float(motion.times.min()), float(motion.times.max())
    bodies = motion.problem.scene.bodies
    tumbling = [body.motion for body in bodies if isinstance(body.motion, Tumbling)]
    turns = max((body.revolutions(last - first) for body in tumbling), default=0.0)
    count = int(np.ceil(max(_RATE * min(last - first, _PLAYBACK), _PER_TURN * turns))) + 1
    count = min(count, limit // 2)
    nodes = motion.times[:: 1 + 2 * len(motion.times) // limit]
    times = np.concatenate([np.linspace(first, last, count), nodes]).astype(np.float32)
    return np.unique(np.clip(times.astype(float), first, last))


@dataclass(frozen=True, eq=False)
class SampledMotion:
    """A motion at its key times: poses of bodies and end-effector, |measure|, s, surroundings.

    Attributes:
        motion: The motion.
        visuals: Shapes of its robot.
        times: Key times [s], shape (K,).
        positions: Positions of the bodies and the end-effector [m], shape (K, bodies, 3).
        rotations: Their axes, shape (K, bodies, 3, 3).
        joints: Joint values [rad or m], shape (K, n).
        values: Magnitudes of the measure, shape (K,).
        fractions: Values of s, shape (K,).
        areas: Path-dependent and path-independent areas, where they are known.
        surroundings: The scene.
        cones: Cones of the limits of pointing.
    """

    motion: Motion
    visuals: RobotVisuals
    times: Array
    positions: Array
    rotations: Array
    joints: Array
    values: Array
    fractions: Array
    areas: Workspace | None
    surroundings: Surroundings
    cones: tuple[PointingCone, ...]


def sampled_motion(
    motion: Motion,
    visuals: RobotVisuals,
    areas: Workspace | None,
    limit: int,
    pointing: Sequence[PointingLimit],
) -> SampledMotion:
    """A motion at no more key times than a limit."""
    problem = motion.problem
    times = key_times(motion, limit)
    parameters = motion.coordinates_at(times)
    # Exact end points: a singular motion has no state after its end.
    parameters[[0, -1]] = motion.coordinates_at([motion.times.min(), motion.times.max()])
    measure = problem.margin.measure
    poses = body_poses(motion, parameters)
    joints = motion.evaluate(parameters)[2]
    return SampledMotion(
        motion,
        visuals,
        times,
        *poses,
        joints,
        np.abs([measure(q) for q in joints]),
        np.array([problem.path.timing.s(float(t)) for t in times]),
        areas,
        Surroundings.of(motion, times, parameters),
        tuple(
            PointingCone.of(problem, axis, number, times, poses, visuals)
            for number, axis in enumerate(pointing)
        ),
    )
