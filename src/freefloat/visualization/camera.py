"""From where to look at motions first: all in view, the arm in front of the spacecraft."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from freefloat.so3 import Array
from freefloat.visualization.body_poses import BodyPoses

_LOOKS = 400
_INSTANTS = 25
_LOW, _HIGH = -0.1, 0.75
"""Sines of the elevations from which a scene looks natural."""
_ALONG = 0.3
"""How much a path seen end-on counts against an arm seen in front."""


@dataclass(frozen=True)
class FirstView:
    """What should be in view, and from where it is looked at.

    Attributes:
        centre: In the middle of it [m].
        radius: Of a ball about the centre that holds it [m].
        points: On its outer parts [m].
        direction: To the eye, of any length.
        flat: Whether everything happens in the x-y plane and is seen from above.
    """

    centre: tuple[float, ...]
    radius: float
    points: tuple[tuple[float, ...], ...]
    direction: tuple[float, ...]
    flat: bool


def first_view(
    poses: Sequence[BodyPoses], bus: Sequence[Array], beside: Array, flat: bool
) -> FirstView:
    """Choose a view.

    Args:
        poses: Of the bodies, motion by motion.
        bus: Corners of the spacecraft in its own frame [m], shape (K, 3), motion by motion.
        beside: What else should be seen [m], shape (K, 3).
        flat: Whether to look from above.
    """
    parts = [part for one, own in zip(poses, bus, strict=True) for part in _outline(one, own)]
    seen = np.vstack([*parts, beside])
    low, high = seen.min(axis=0), seen.max(axis=0)
    centre = (low + high) / 2.0
    direction = np.array([0.0, -0.02, 1.0]) if flat else _facing(poses)
    return FirstView(
        centre=_rounded(centre),
        radius=float(np.linalg.norm(seen - centre, axis=1).max()),
        points=tuple(map(_rounded, seen)),
        direction=_rounded(direction),
        flat=flat,
    )


def _outline(poses: BodyPoses, bus: Array) -> list[Array]:
    """Joints, hands and corners of the spacecraft at some instants."""
    chosen = np.unique(np.linspace(0, len(poses.tips) - 1, _INSTANTS).astype(int))
    base, turned = poses.positions[chosen, :1], poses.rotations[chosen, 0]
    corners = base + np.einsum("kij,cj->kci", turned, bus)
    return [part.reshape(-1, 3) for part in (poses.positions[chosen], poses.tips[chosen], corners)]


def _facing(poses: Sequence[BodyPoses]) -> Array:
    """The direction from which arms are in front of spacecraft, paths seen from aside."""
    ahead = np.vstack([(one.positions[:, 1:] - one.positions[:, :1]).mean(axis=1) for one in poses])
    toward = ahead.mean(axis=0) / np.linalg.norm(ahead, axis=1).max()
    eyes = _hemisphere()
    score = eyes @ toward
    for one in poses:
        way = one.tips[-1] - one.tips[0]
        length = float(np.linalg.norm(way))
        if length > 0.0:
            score = score - _ALONG / len(poses) * np.abs(eyes @ way) / length
    return np.asarray(eyes[int(np.argmax(score))])


def _hemisphere() -> Array:
    """Directions spread evenly between two elevations, shape (K, 3)."""
    k = np.arange(_LOOKS) + 0.5
    z = _LOW + (_HIGH - _LOW) * k / _LOOKS
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    level = np.sqrt(1.0 - z**2)
    return np.column_stack([level * np.cos(turn), level * np.sin(turn), z])


def _rounded(values: Array) -> tuple[float, ...]:
    return tuple(round(float(value), 4) for value in values)
