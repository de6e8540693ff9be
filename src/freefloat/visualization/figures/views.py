"""Axes of views in space: equal scales, and numbers beside the edges of a box."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.proj3d import proj_transform

from freefloat.so3 import Array, cross
from freefloat.visualization.figure_style import BLACK, digits

_FLATTEST, _ZOOM, _TICKS = 0.4, (0.62, 0.8), 4
"""Least side of the box of a view over its largest one, the width and height of the box in its
axes, and the number of ticks of the longest edge."""
_EDGES = np.array([
    [(-1, 1, -1), (1, 1, -1)], [(1, -1, -1), (1, 1, -1)], [(1, -1, 1), (1, -1, -1)],
])  # fmt: skip
"""Ends of the edges with numbers over half of the box, where the eye is at positive x, y and z."""


def set_equal_scales(views: Any, points: Array, eye: Array) -> None:
    """Show the same box around points (K, 3) in all views, from a direction (3,)."""
    azimuth, elevation = np.degrees([np.arctan2(eye[1], eye[0]), np.arcsin(eye[2])])
    low, high = points.min(axis=0), points.max(axis=0)
    middle, halves = (low + high) / 2.0, np.maximum(high - low, _FLATTEST * (high - low).max()) / 2
    across = np.array([-eye[1], eye[0], 0.0]) / np.hypot(eye[0], eye[1])
    seen = np.abs([across, cross(eye, across)]) @ halves  # half the width and height of the box
    zoom = float(np.linalg.norm(halves) * np.min(_ZOOM / seen))
    lengths = halves * np.sqrt(1.0 - eye**2)  # of its edges, as they are seen
    ticks = np.maximum(np.round(_TICKS * lengths / lengths.max()), 1.0).astype(int).tolist()
    edges = middle + _EDGES * np.where(eye < 0.0, -halves, halves)  # each from its named end
    for axes in views:
        axes.set_box_aspect(tuple(halves), zoom=zoom)
        axes.view_init(elev=elevation, azim=azimuth)
        for letter, least, most in zip("xyz", middle - halves, middle + halves, strict=True):
            getattr(axes, f"set_{letter}lim")(least, most)
        for letter, count, ends in zip("xyz", ticks, edges, strict=True):
            axis = getattr(axes, f"{letter}axis")
            axis.set_major_locator(MaxNLocator(count, prune="both"))
            axis.set_tick_params(labelbottom=False, color="none")
            axis.line.set_color("none")
            axes.plot(*ends.T, color=BLACK, linestyle="-", linewidth=0.6)
            _number_edge(axes, letter, ends, middle)


def _number_edge(axes: Any, letter: str, ends: Array, middle: Array) -> None:
    """Write the numbers of an axis, one with its name, beside an edge of the box around a point.

    Numbers of matplotlib's own lie over each other where an edge is seen at a small angle.
    """
    values = sorted(getattr(axes, f"get_{letter}ticks")(), reverse=bool((ends[0] > ends[1]).any()))
    points = [np.where(ends[0] == ends[1], ends[0], value) for value in values]
    seen = proj_transform(*np.transpose([middle, *ends, *points]), axes.get_proj())[:2]
    centre, first, last, *places = np.transpose(seen)
    along, beside = first - last, (first + last) / 2.0 - centre
    normal = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    normal *= np.sign(normal @ beside)
    side, above = np.round(normal).astype(int)
    texts = [digits(value) for value in values]
    texts[0] = f"${letter}$ = {texts[0]} m"
    sides = [side or int(np.sign(along[0])), *[side] * len(texts)]  # away from the other numbers
    for text, place, aside in zip(texts, places, sides, strict=False):
        axes.annotate(
            text, place, 3.0 * normal, textcoords="offset points", fontsize=7.0,
            ha=("center", "left", "right")[aside], va=("center", "bottom", "top")[above],
        )  # fmt: skip
