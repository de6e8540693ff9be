"""Colour scale of a singularity measure, shared by all motions of a page."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex

from freefloat.motion.problem import Margin
from freefloat.so3 import Array

_BELOW = (0.835, 0.369, 0.0)
_DARKEST = 0.25
"""Lower end of the colour map; darker colours are invisible on the background."""
_STOPS = 9


@dataclass(frozen=True)
class MarginColours:
    """Scale from the margin (dark) to the largest value (bright); a single colour below.

    Attributes:
        margin: Measure and threshold.
        largest: Value of the brightest colour.
    """

    margin: Margin
    largest: float

    @classmethod
    def over(cls, margin: Margin, values: Iterable[Array]) -> MarginColours:
        """Return the scale that covers arrays of values of the measure."""
        highest = [float(np.max(array)) for array in values if len(array)]
        return cls(margin, max([1.2 * margin.threshold, 1e-12, *highest]))

    def __call__(self, values: Array) -> Array:
        """Return RGB colours, shape (K, 3), of values of the measure, shape (K,)."""
        fraction = (values - self.margin.threshold) / (self.largest - self.margin.threshold)
        shades = _DARKEST + (1.0 - _DARKEST) * fraction
        bright = np.asarray(colormaps["viridis"](shades))[:, :3]
        return np.where((fraction < 0.0)[:, None], _BELOW, bright)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of the page's legend."""
        stops = np.linspace(self.margin.threshold, self.largest, _STOPS)
        return {
            "measure": self.margin.measure.name,
            "unit": self.margin.measure.unit,
            "margin": self.margin.threshold,
            "largest": self.largest,
            "below": to_hex(_BELOW),
            "stops": [to_hex(colour) for colour in self(stops)],
        }
