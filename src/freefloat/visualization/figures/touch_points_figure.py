"""The figure of S along spatial motions that just keep the margin, with their touch points."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from freefloat.motion.extrema import closest_approach
from freefloat.motion.integration import integrate_motion
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.touching.touch_point import TouchKind
from freefloat.visualization.figure_style import (
    BLACK,
    MARGIN_LINE,
    STROKES,
    amount,
    axis_label,
    draw_point,
    legend_above,
    new_figure,
    styled,
)

_CURVE_POINTS = 401
_STROKES = STROKES[:1] + STROKES[2:]
"""Without that of the margin."""
_MARKERS = {TouchKind.TANGENT: ("D", "touch point C"), TouchKind.START: ("s", "touch point E"),
            TouchKind.END: ("s", "touch point E")}  # fmt: skip
"""Marker and name, C inside the path (Case I), E at an end (Case II), as in Fig. 3."""


@styled
def touch_points_figure(result: AttitudeMap) -> Figure:
    """The figure of S along the motions from a map's first attitudes that touch points yield.

    Args:
        result: A map with touch points; as many are drawn as there are strokes.
    """
    problem = result.problem
    measure, threshold = problem.margin.measure, problem.margin.threshold
    figure = new_figure(height=2.6)
    axes = figure.subplots()
    axes.axhline(0.0, color=BLACK, linewidth=0.6)
    for sign, label in ((1.0, f"margin ±{amount(threshold, measure.unit)}"), (-1.0, None)):
        axes.axhline(sign * threshold, label=label, **MARGIN_LINE)
    for point, (colour, dashes) in zip(result.touch or (), _STROKES, strict=False):
        branches = {branch.index: branch for branch in problem.branches(point.attitude)}
        motion = integrate_motion(problem, point.attitude, branches[point.branch or 0].joints)
        times, _, joints = motion.evaluate(np.linspace(0.0, motion.panels, _CURVE_POINTS))
        axes.plot(
            times, [measure(q) for q in joints], color=colour, linestyle=dashes, linewidth=1.0
        )
        closest = closest_approach(motion, measure)
        place = np.array([closest.time, closest.sign * closest.value])
        marker, name = _MARKERS[point.kind or TouchKind.TANGENT]
        known = {line.get_label() for line in axes.lines}
        draw_point(
            axes, place, marker, 4.0, color=colour, markeredgecolor=BLACK, zorder=5, clip_on=False,
            label=None if name in known else name,
        )  # fmt: skip
    axes.set_xlim(0.0, problem.path.duration)
    axes.set_xlabel(axis_label("time", "s"))
    axes.set_ylabel(axis_label(f"$S$ ({measure.title})", measure.unit))
    legend_above(axes)
    return figure
