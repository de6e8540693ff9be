"""What a figure holds: its lines and the texts of its legend."""

from __future__ import annotations

from typing import Any

import numpy as np

from freefloat.so3 import Array


def line(axes: Any, label: str) -> Array:
    """Points of the one line with a label, shape (K, 2)."""
    (found,) = [drawn for drawn in axes.lines if drawn.get_label() == label]
    return np.asarray(found.get_xydata(), dtype=float)


def labels(axes: Any) -> list[str]:
    """Texts of the legend."""
    return [text.get_text() for text in axes.get_legend().get_texts()] if axes.get_legend() else []
