"""Figure of several motions side by side."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from freefloat.errors import InputError
from freefloat.io.trajectory import Trajectory
from freefloat.motion.motion import Motion
from freefloat.visualization import figure_style as style
from freefloat.visualization.motion_figures import (
    attitude_curves,
    draw_panel,
    joint_scale,
    shown_times,
)

_MOST = 4
"""Columns that are readable on a page."""
_NAMES, _LETTERS = 10, 96
"""Names of curves, and letters of titles, that fit into the width of a page."""


@style.styled
def comparison_figure(motions: Mapping[str, Motion]) -> Figure:
    """A figure with a column for each motion: measure, attitude and joints over time.

    Each quantity has one scale in all columns; motions with another measure or unit have their own.

    Raises:
        InputError: Unless there are two to four motions.
    """
    if not 2 <= len(motions) <= _MOST:
        problem = f"{len(motions)} motions cannot be compared in one figure"
        raise InputError("files", problem, f"2 to {_MOST}")
    settings = [motion.setting for motion in motions.values()]
    kinds = {
        (setting.margin.measure.name, setting.margin.measure.unit, setting.has_headings,
         joint_scale(setting.model)[1])
        for setting in settings
    }  # fmt: skip
    figure = style.new_figure(style.PAGE, 5.0)
    panels: Any = figure.subplots(
        3, len(motions), sharex="col", sharey="row" if len(kinds) == 1 else "none"
    )
    for column, (title, motion) in zip(panels.T, motions.items(), strict=True):
        _draw(column, motion, _NAMES // len(motions))
        lines = f"{fill(title, _LETTERS // len(motions))}\n{motion.ending.name.lower()}"
        column[0].set_title(lines, loc="left", fontsize=7.0)
    if len(kinds) == 1:
        for panel in panels.ravel():
            panel.label_outer(remove_inner_ticks=True)
    figure.align_ylabels()
    return figure


def _draw(panels: Any, motion: Motion, longest: int) -> None:
    """Draw the panels of one motion, with at most so many names in a line of a legend."""
    setting = motion.setting
    trajectory = Trajectory.of(motion, shown_times(motion))
    measure, threshold = setting.margin.measure, setting.margin.threshold
    scale, unit = joint_scale(setting.model)
    attitude, angles, names = attitude_curves(setting, trajectory)
    sign = np.sign(trajectory.measure[0])
    panels[0].axhspan(0.0, sign * threshold, color=style.PALE, linewidth=0.0, zorder=0)
    panels[0].axhline(0.0, color=style.BLACK, linewidth=0.6)
    curves = [
        (f"$S$ ({measure.title})", trajectory.measure[:, None], ("S",), measure.unit),
        ("heading" if setting.has_headings else attitude, angles, names, "deg"),
        ("joints", scale * trajectory.joints, [*map(style.plain, setting.model.joint_names)], unit),
    ]
    for panel, drawn in zip(panels, curves, strict=True):
        draw_panel(panel, trajectory, drawn, named=False)
        if len(drawn[2]) > 1:
            style.legend_above(panel, longest=longest)
