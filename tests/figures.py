"""Lines and legend texts of figures."""

from typing import Any

import numpy as np

from freefloat.so3 import Array


def line(axes: Any, label: str) -> Array:
    """Points of the line with a label, shape (K, 2)."""
    (curve,) = [drawn for drawn in axes.lines if drawn.get_label() == label]
    return np.asarray(curve.get_xydata(), dtype=float)


def labels(axes: Any) -> list[str]:
    """Texts of the legend."""
    return [text.get_text() for text in axes.get_legend().get_texts()] if axes.get_legend() else []
