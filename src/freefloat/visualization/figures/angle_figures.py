"""Figure of the angles along a motion that are limited: of axes to targets, and the base turn."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure

from freefloat.motion.motion import Motion
from freefloat.motion.pointing import AttitudeLimits, Keep, angle_of
from freefloat.so3 import Array, angle_between
from freefloat.visualization.figure_style import (
    BLUE,
    COLUMN,
    MARGIN_LINE,
    PALE,
    axis_label,
    digits,
    legend_above,
    new_figure,
    styled,
)
from freefloat.visualization.figures.motion_figures import mark_times, shown_times

_STRIP, _AXIS = 1.15, 0.35
"""Height of an axes and of the time axis [inch]."""


@styled
def angles_figure(motion: Motion, limits: AttitudeLimits) -> Figure:
    """Return the figure of limited angles over time, with an axes per limit.

    Args:
        motion: The motion.
        limits: Limits of axes and of the spacecraft's turn, at least one.
    """
    figure = new_figure(COLUMN, _AXIS + _STRIP * limits.number)
    panels = figure.subplots(limits.number, 1, sharex=True, squeeze=False)[:, 0]
    times = shown_times(motion)
    for axes, (name, side, allowed, angles) in zip(panels, _curves(motion, limits), strict=True):
        axes.plot(times, np.degrees(angles), color=BLUE, label=name)
        bound = np.degrees(allowed)
        axes.axhline(bound, label=f"{side} {digits(bound)}°", **MARGIN_LINE)
        low, high = axes.get_ylim()
        forbidden = (low, bound) if side == Keep.OUTSIDE else (bound, high)
        axes.axhspan(*forbidden, color=PALE, linewidth=0.0, zorder=0)
        axes.set_ylim(low, high)
        axes.set_ylabel(axis_label("angle", "deg"))
        mark_times(axes, motion)
        legend_above(axes)
    panels[-1].set_xlabel(axis_label("time", "s"))
    figure.align_ylabels()
    return figure


def _curves(motion: Motion, limits: AttitudeLimits) -> Iterator[tuple[str, str, float, Array]]:
    """Yield name, allowed side, allowed angle and angles at the shown times [rad] of each limit."""
    problem = motion.problem
    states = motion.evaluate(motion.coordinate_at(shown_times(motion)))
    for number, limit in enumerate(limits.pointing):
        angles = [
            angle_of(*limit.vectors(problem.model, attitude, joints, problem.path.origin(t)))
            for t, attitude, joints in zip(*states, strict=True)
        ]
        yield f"{limit.body} (pointing.{number})", limit.keep, limit.angle, np.array(angles)
    if limits.base_turn is not None:
        turns = angle_between(states[1], motion.initial.attitude)
        yield "turn of the spacecraft", "at most", limits.base_turn, turns
