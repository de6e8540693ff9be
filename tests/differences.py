"""Differences: numbers that have none, and derivatives by central ones."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from freefloat.so3 import Pose

assert_close = partial(np.testing.assert_allclose, rtol=0)
"""Numbers agree within ``atol``."""


def slope(function: Callable[[float], Any], s: float, h: float = 1e-3) -> Any:
    """The derivative of a function at a place, of eighth order."""
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    return sum(w * (function(s + k * h) - function(s - k * h)) for k, w in weights.items()) / h


def twist_of(pose: Callable[[float], Pose], t: float, h: float = 1e-4) -> np.ndarray:
    """The twist [linear; angular] of a moving pose, in the frame in which it is given."""
    before, after = pose(t - h), pose(t + h)
    turn = Rotation.from_matrix(after.rotation @ before.rotation.T).as_rotvec()
    return np.concatenate([after.position - before.position, turn]) / (2.0 * h)
