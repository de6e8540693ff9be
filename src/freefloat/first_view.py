"""From where to look at motions first: all in view, the arm in front of the spacecraft."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from freefloat.body_poses import BodyPoses
from freefloat.spatial import Array

_LOOKS = 400
_LOW, _HIGH = -0.1, 0.75
"""Sines of the elevations from which a scene looks natural."""
_ALONG = 0.6
"""How much a path seen end-on counts against an arm seen in front."""


@dataclass(frozen=True)
class FirstView:
    """A ball that holds all that matters, and the direction from it to the eye.

    Attributes:
        centre: Of the ball [m].
        radius: Of the ball [m].
        direction: To the eye, of any length.
        flat: Whether everything happens in the x-y plane and is seen from above.
    """

    centre: tuple[float, float, float]
    radius: float
    direction: tuple[float, float, float]
    flat: bool


def first_view(poses: Sequence[BodyPoses], beside: Array, extent: float, flat: bool) -> FirstView:
    """Choose a view.

    Args:
        poses: Of the bodies, motion by motion.
        beside: What else should be seen [m], shape (K, 3).
        extent: How far shapes reach from the origins of their bodies [m].
        flat: Whether to look from above.
    """
    points = [part for one in poses for part in (one.positions.reshape(-1, 3), one.tips)]
    seen = np.vstack([*points, beside])
    centre = (seen.min(axis=0) + seen.max(axis=0)) / 2.0
    radius = float(np.linalg.norm(seen - centre, axis=1).max()) + extent
    direction = np.array([0.0, -0.02, 1.0]) if flat else _facing(poses)
    return FirstView(_triple(centre), radius, _triple(direction), flat)


def _facing(poses: Sequence[BodyPoses]) -> Array:
    """The direction from which end-effectors are nearer than spacecraft, paths seen from aside."""
    ahead = np.vstack([one.tips - one.positions[:, 0] for one in poses])
    toward = ahead.mean(axis=0) / np.linalg.norm(ahead, axis=1).max()
    ways = [one.tips[-1] - one.tips[0] for one in poses]
    lengths = [float(np.linalg.norm(way)) for way in ways]
    eyes = _hemisphere()
    score = eyes @ toward
    for way, length in zip(ways, lengths, strict=True):
        if length > 0.0:
            score = score - _ALONG / len(ways) * np.abs(eyes @ way) / length
    return np.asarray(eyes[int(np.argmax(score))])


def _hemisphere() -> Array:
    """Directions spread evenly between two elevations, shape (K, 3)."""
    k = np.arange(_LOOKS) + 0.5
    z = _LOW + (_HIGH - _LOW) * k / _LOOKS
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    level = np.sqrt(1.0 - z**2)
    return np.column_stack([level * np.cos(turn), level * np.sin(turn), z])


def _triple(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
