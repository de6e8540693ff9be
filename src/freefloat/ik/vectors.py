"""Vectors and rotations of many configurations at once.

Components are the first axis: a vector is an array (3, ...), a rotation (3, 3, ...). The other axes
broadcast; a constant has length one along them.
"""

from __future__ import annotations

from math import tau

import numpy as np

from freefloat.so3 import Array


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


def wrapped(angle: Array) -> Array:
    """Angles wrapped into (-pi, pi]."""
    return np.minimum(angle - tau * np.ceil((angle - np.pi) / tau), np.pi)
