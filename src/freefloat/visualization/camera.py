"""The first view of motions: everything in sight, the arm in front of the spacecraft."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from freefloat.so3 import Array
from freefloat.visualization.body_poses import BodyPoses

_DIRECTIONS = 400
_INSTANTS = 25
_LOW, _HIGH = -0.1, 0.75
"""Sines of the elevations to look from."""
_ALONG = 0.3
"""Weight of a path seen end-on against an arm seen in front."""


def first_view(
    poses: Sequence[BodyPoses], corners: Sequence[Array], others: Array, planar: bool
) -> dict[str, Any]:
    """Return the view that the page begins with.

    Args:
        poses: Of the bodies, motion by motion.
        corners: Of the spacecraft in its own frame [m], shape (K, 3), motion by motion.
        others: What else should be in view [m], shape (K, 3).
        planar: Whether everything happens in the x-y plane and is seen from above.

    Returns:
        ``centre`` and ``radius`` of a ball around all [m], outer ``points`` [m], ``direction`` to
        the eye, and ``flat`` for planar.
    """
    parts = [part for pair in zip(poses, corners, strict=True) for part in _outline(*pair)]
    points = np.vstack([*parts, others])
    centre = (points.min(axis=0) + points.max(axis=0)) / 2.0
    direction = np.array([0.0, -0.02, 1.0]) if planar else _direction(poses)
    return {
        "centre": centre.round(4).tolist(),
        "radius": float(np.linalg.norm(points - centre, axis=1).max()),
        "points": points.round(4).tolist(),
        "direction": direction.round(4).tolist(),
        "flat": planar,
    }


def _outline(poses: BodyPoses, corners: Array) -> list[Array]:
    """Joints, end-effector and corners of the spacecraft at some instants."""
    chosen = np.unique(np.linspace(0, len(poses.tips) - 1, _INSTANTS).astype(int))
    base, rotations = poses.positions[chosen, :1], poses.rotations[chosen, 0]
    box = base + np.einsum("kij,cj->kci", rotations, corners)
    return [part.reshape(-1, 3) for part in (poses.positions[chosen], poses.tips[chosen], box)]


def _direction(poses: Sequence[BodyPoses]) -> Array:
    """The direction from which arms are in front of spacecraft and paths seen from aside."""
    arms = np.vstack([(p.positions[:, 1:] - p.positions[:, :1]).mean(axis=1) for p in poses])
    z = np.linspace(_LOW, _HIGH, _DIRECTIONS)
    angle = np.pi * (1.0 + np.sqrt(5.0)) * np.arange(_DIRECTIONS)
    level = np.sqrt(1.0 - z**2)
    eyes = np.column_stack([level * np.cos(angle), level * np.sin(angle), z])
    score = eyes @ (arms.mean(axis=0) / np.linalg.norm(arms, axis=1).max())
    for motion in poses:
        path = motion.tips[-1] - motion.tips[0]
        length = float(np.linalg.norm(path))
        if length > 0.0:
            score = score - _ALONG / len(poses) * np.abs(eyes @ path) / length
    return np.asarray(eyes[int(np.argmax(score))])
