"""Colours for the distance to a singularity, the same for all motions that are shown together."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import colormaps

from freefloat.motion.problem import Margin
from freefloat.so3 import Array

_BELOW = (0.835, 0.369, 0.0)
_DARKEST = 0.25
"""Of the colour map; what is darker cannot be told from a dark background."""
_STOPS = 9


@dataclass(frozen=True)
class MarginColours:
    """From the margin (dark) to the largest magnitude (bright); one colour for all below.

    Attributes:
        margin: What is measured, and the magnitude to keep.
        largest: The magnitude with the brightest colour.
    """

    margin: Margin
    largest: float

    @classmethod
    def over(cls, margin: Margin, values: Iterable[Array]) -> MarginColours:
        """Colours for some magnitudes, and whatever else is needed to show a margin."""
        found = [float(np.max(some)) for some in values if len(some)]
        return cls(margin, max([1.2 * margin.threshold, 1e-12, *found]))

    def __call__(self, values: Array) -> Array:
        """Red, green and blue, shape (K, 3), of magnitudes (K,)."""
        share = (values - self.margin.threshold) / (self.largest - self.margin.threshold)
        bright = np.asarray(colormaps["viridis"](_DARKEST + (1.0 - _DARKEST) * share))[:, :3]
        return np.where((share < 0.0)[:, None], _BELOW, bright)

    def document(self) -> dict[str, Any]:
        """What a legend shows, as JSON knows it."""
        stops = np.linspace(self.margin.threshold, self.largest, _STOPS)
        return {
            "measure": self.margin.measure.name,
            "unit": self.margin.measure.unit,
            "margin": self.margin.threshold,
            "largest": self.largest,
            "below": _css(np.array(_BELOW)),
            "stops": [_css(colour) for colour in self(stops)],
        }


def _css(colour: Array) -> str:
    return "#" + "".join(f"{round(255 * float(value)):02x}" for value in colour)
