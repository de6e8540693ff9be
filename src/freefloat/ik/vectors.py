"""Vectors and rotations of many configurations at once.

Components are the first axis: a vector is an array (3, ...), a rotation (3, 3, ...). The other axes
broadcast; a constant has length one along them.
"""

from __future__ import annotations

from math import tau

import numpy as np

from freefloat.so3 import Array

_SMALL = 1e-7
"""Twice the sine of an angle below which a rotation is the identity or half a revolution."""


def dot(u: Array, v: Array) -> Array:
    """The scalar product."""
    x, y, z = u * v
    return np.asarray(x + y + z)


def cross(u: Array, v: Array) -> Array:
    """The vector product."""
    (a, b, c), (x, y, z) = u, v
    return np.array([b * z - c * y, c * x - a * z, a * y - b * x])


def norm(v: Array) -> Array:
    """The length."""
    return np.sqrt(dot(v, v))


def times(R: Array, v: Array) -> Array:
    """A rotated vector."""
    return np.asarray(R[:, 0] * v[0] + R[:, 1] * v[1] + R[:, 2] * v[2])


def product(R: Array, S: Array) -> Array:
    """The rotation ``R S``."""
    return np.asarray(R[:, 0, None] * S[0] + R[:, 1, None] * S[1] + R[:, 2, None] * S[2])


def rotated(v: Array, axis: Array, angle: Array) -> Array:
    """A vector rotated about a unit axis."""
    cosine, sine = np.cos(angle), np.sin(angle)
    along = (1.0 - cosine) * dot(axis, v)
    return np.asarray(cosine * v + sine * cross(axis, v) + along * axis)


def rotation_vector(start: Array, end: Array) -> Array:
    """The rotation vector from rotations to others."""
    R = product(end, start.swapaxes(0, 1))
    twice = np.stack([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine, cosine = norm(twice), R[0, 0] + R[1, 1] + R[2, 2] - 1.0
    small = sine <= _SMALL
    factor = np.where(small, 0.5, np.arctan2(sine, cosine) / np.where(small, 1.0, sine))
    vector = twice * factor
    half_turn = small & (cosine <= 0.0)
    if half_turn.any():
        vector[:, half_turn] = _half_turn(R[..., half_turn])
    return np.asarray(vector)


def tilt(start: Array, end: Array) -> Array:
    """The shortest rotation vector from the z axes of rotations to those of others."""
    z, wanted = start[:, 2], end[:, 2]
    vector, cosine = cross(z, wanted), dot(z, wanted)
    sine = norm(vector)
    small = sine <= _SMALL
    factor = np.where(small, 1.0, np.arctan2(sine, cosine) / np.where(small, 1.0, sine))
    opposite = small & (cosine < 0.0)
    return np.asarray(np.where(opposite, np.pi * end[:, 0], vector * factor))


def _half_turn(R: Array) -> Array:
    """Rotation vectors (3, N) of rotations (3, 3, N) by pi.

    The longest row of (R + R') / 2 + 1 has the axis' direction.
    """
    rows = R + R.swapaxes(0, 1) + 2.0 * np.eye(3)[:, :, None]
    longest = np.einsum("iin->in", rows).argmax(axis=0)
    axis = rows[longest, :, np.arange(R.shape[2])].T
    return np.asarray(np.pi * axis / norm(axis))


def wrapped(angle: Array) -> Array:
    """Angles wrapped into (-pi, pi]."""
    return np.minimum(angle - tau * np.ceil((angle - np.pi) / tau), np.pi)
