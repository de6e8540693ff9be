"""Nearest neighbours among attitudes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import scipy

from freefloat.so3 import Array, IntArray


def nearest_among(others: Array, threads: int = 1) -> Callable[[Array], tuple[Array, IntArray]]:
    """A function that finds the nearest of some attitudes (M, 4).

    Of attitudes (K, 4) it returns the angles [rad] to the nearest, and its index, shapes (K,).
    """
    tree = scipy.spatial.cKDTree(np.vstack([others, -others]))

    def nearest(attitudes: Array) -> tuple[Array, IntArray]:
        chords, index = tree.query(attitudes, workers=threads)
        return 4.0 * np.arcsin(np.minimum(chords / 2.0, 1.0)), index % len(others)

    return nearest


def depths(attitudes: Array, inside: npt.NDArray[np.bool_], threads: int = 1) -> Array:
    """Angle [rad] from each attitude inside to the nearest outside, pi if there is none; (K,)."""
    if inside.all():
        return np.full(len(attitudes), np.pi)
    angles = np.zeros(len(attitudes))
    angles[inside], _ = nearest_among(attitudes[~inside], threads)(attitudes[inside])
    return angles
