"""Values of a varied key in many runs as an array of numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from freefloat.so3 import Array


def as_numbers(column: Array | Sequence[Any], shape: tuple[int, ...]) -> Array:
    """Values as an array, NaN where one is not a number or list of numbers of the shape."""
    if isinstance(column, np.ndarray):
        return column if column.shape[1:] == shape else np.full((len(column), *shape), np.nan)
    return np.array([_row(value, shape) for value in column]).reshape(-1, *shape)


def _row(value: Any, shape: tuple[int, ...]) -> Any:
    entries = value if shape else [value]
    numbers = isinstance(entries, list) and len(entries) == int(np.prod(shape))
    if numbers and all(isinstance(v, int | float) and not isinstance(v, bool) for v in entries):
        return value
    return np.full(shape, np.nan)
