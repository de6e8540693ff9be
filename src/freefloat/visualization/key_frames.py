"""At which times a motion must be told so that what lies between may be drawn straight."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from freefloat.motion.motion import Motion
from freefloat.so3 import Array, frozen
from freefloat.visualization.body_poses import BodyPoses, body_poses_at

_Flags = npt.NDArray[np.bool_]

_ROUNDS = 16
_FEWEST = 1e-6
"""Keys are not nearer to each other than this share of the last time: single precision."""


def key_times(motion: Motion, tolerance: float = 5e-7, most: int = 20_000) -> Array:
    """Times between which every body may move uniformly and turn about one axis.

    Intervals are halved until the middle is right, those with the largest errors first when there
    would be too many.

    Args:
        motion: The motion, forward or reversed.
        tolerance: Largest error of a position [m]; of an attitude, ten times the number [rad].
        most: Number of keys at the most.

    Returns:
        Times in the order of the motion [s], shape (K,).
    """
    places = np.unique(motion.node_parameters)
    open_ = np.ones(len(places) - 1, dtype=bool)
    span = float(np.ptp(motion.times))
    for _ in range(_ROUNDS):
        left, right = places[:-1][open_], places[1:][open_]
        if not len(left) or len(places) + len(left) > most:
            break
        middle = (left + right) / 2.0
        far = _errors(motion, left, middle, right) > tolerance
        times = motion.evaluate(places)[0]
        far &= np.abs(np.diff(times))[open_] > _FEWEST * span
        places, open_ = _halved(places, open_, far, middle)
    times = motion.evaluate(places)[0]
    times[[0, -1]] = motion.times[[0, -1]]
    return frozen(times)


def _halved(places: Array, open_: _Flags, far: _Flags, middle: Array) -> tuple[Array, _Flags]:
    """Places with the middles of the intervals that are far off; those halves are open."""
    where = np.flatnonzero(open_)[far]
    merged = np.insert(places, where + 1, middle[far])
    halves = np.zeros(len(merged) - 1, dtype=bool)
    shifted = where + np.arange(len(where))
    halves[shifted] = halves[shifted + 1] = True
    return merged, halves


def _errors(motion: Motion, left: Array, middle: Array, right: Array) -> Array:
    """How far bodies are off in the middle of intervals when drawn straight between the ends."""
    (t0, a), (t, m), (t1, b) = (body_poses_at(motion, at) for at in (left, middle, right))
    share = ((t - t0) / np.where(t1 == t0, 1.0, t1 - t0))[:, None]
    off = _points(a) * (1.0 - share[..., None]) + _points(b) * share[..., None] - _points(m)
    away, turn = _angles(a, m), _angles(a, b)
    positions, turns = np.linalg.norm(off, axis=2), np.abs(away - share * turn) / 10.0
    return np.asarray(np.maximum(positions.max(axis=1), turns.max(axis=1)))


def _points(poses: BodyPoses) -> Array:
    return np.concatenate([poses.positions, poses.tips[:, None]], axis=1)


def _angles(first: BodyPoses, second: BodyPoses) -> Array:
    """Angle by which every body turns, shape (K, n + 1); from the chord, exact for small ones."""
    chord = np.linalg.norm(first.rotations - second.rotations, axis=(2, 3))
    return np.asarray(2.0 * np.arcsin(np.minimum(chord / np.sqrt(8.0), 1.0)))
