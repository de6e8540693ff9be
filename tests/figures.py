"""What a figure holds, for tests: its lines, its words, whether labels carry units."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from freefloat.so3 import Array

UNIT = re.compile(r".+ \[.+\]$")


def line(axes: Any, label: str) -> Array:
    """Points of the one line with a label, shape (K, 2)."""
    (found,) = [one for one in axes.lines if one.get_label() == label]
    return np.asarray(found.get_xydata(), dtype=float)


def labels(axes: Any) -> list[str]:
    """What the legend says."""
    return [text.get_text() for text in axes.get_legend().get_texts()] if axes.get_legend() else []


def unlabelled(figure: Figure) -> list[str]:
    """Axes that show numbers without saying what they are and in which unit."""
    FigureCanvasAgg(figure).draw()
    wrong = []
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis, *([axes.zaxis] if hasattr(axes, "zaxis") else [])):
            numbered = any(tick.label1.get_visible() and tick.label1.get_text()
                           for tick in axis.get_major_ticks())  # fmt: skip
            if numbered and not UNIT.match(axis.get_label_text()):
                wrong.append(f"{axis.axis_name}: {axis.get_label_text()!r}")
    return wrong


def overlaps(figure: Figure) -> list[tuple[str, str]]:
    """Labels of axes, titles and legends that cover each other, or leave the figure."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    named: list[tuple[str, Any]] = []
    for number, axes in enumerate(figure.axes):
        for part in (axes.xaxis.label, axes.yaxis.label, axes.title, axes.get_legend()):
            text = part.get_text() if hasattr(part, "get_text") else "legend"
            if part is not None and text:
                named.append((f"{number} {text}", part.get_window_extent(renderer)))
    named += [("legend", legend.get_window_extent(renderer)) for legend in figure.legends]
    page = figure.bbox
    out = [(name, "page") for name, box in named
           if box.x0 < page.x0 - 1 or box.y0 < page.y0 - 1
           or box.x1 > page.x1 + 1 or box.y1 > page.y1 + 1]  # fmt: skip
    pairs = [(a, b) for i, a in enumerate(named) for b in named[i + 1 :]]
    return out + [(a[0], b[0]) for a, b in pairs if a[1].overlaps(b[1])]
