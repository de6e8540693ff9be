"""Figures of planar problems: joint space, minimum margin over initial heading."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from freefloat.ensemble.endings import LIMITED
from freefloat.ik.branches import branch_name
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.problem import Problem
from freefloat.planning.plane.arcs import BranchRanges
from freefloat.planning.plane.heading_map import HeadingMap
from freefloat.regions.margin_curves import level_curves
from freefloat.regions.planar_regions import PlanarArm, point_3, point_3_on_path
from freefloat.so3 import Array
from freefloat.visualization.figure_style import (
    BLACK,
    BLUE,
    COLUMN,
    GREY,
    MARGIN_LINE,
    STROKES,
    amount,
    axis_label,
    digits,
    draw_point,
    legend_above,
    new_figure,
    styled,
)

_GRID = 361
_FEASIBLE = "#CFE3EF"


@styled
def joint_space_figure(
    problem: Problem, motions: Sequence[Motion], reasons: Sequence[str] = ()
) -> Figure:
    """The figure of S = 0, S = +-S0, radii of point 3 and motions (Fig. 3).

    Args:
        problem: Planar problem whose S depends on two joint angles.
        motions: Motions, the chosen motion first.
        reasons: What each violates besides the margin, for the legend; empty for nothing.
    """
    figure = new_figure(COLUMN, 3.6)
    axes = figure.subplots()
    arm = PlanarArm.of(problem.model)
    margin = problem.margin
    levels: list[tuple[float, Any, float]] = [(0.0, "-", 1.2)]
    if margin.threshold > 0.0 and margin.measure.name == "system":  # the S of (21a)
        levels += [(margin.threshold, (0, (5, 1.5)), 0.8), (-margin.threshold, (0, (1, 1.2)), 0.8)]
    curves = level_curves(arm, *(value for value, _, _ in levels))
    for value, dashes, width in levels:
        rows = _joined(np.degrees(curve.joints) for curve in curves if curve.level == value)
        shown = amount(value, margin.measure.unit) if value else "0 (singular)"
        axes.plot(*rows.T, color=BLACK, linestyle=dashes, linewidth=width, label=f"$S$ = {shown}")
    _draw_distances(axes, problem, arm)
    drawn = zip(motions, STROKES, [*reasons, "", ""], strict=False)
    for number, (motion, (colour, dashes), reason) in enumerate(drawn):
        _draw_motion(axes, motion, colour, dashes, reason, named=number == 0)
    axes.set(xlim=(-180.0, 180.0), ylim=(-180.0, 180.0), aspect="equal")
    axes.set(xticks=np.arange(-180, 181, 90), yticks=np.arange(-180, 181, 90))
    axes.set_xlabel(axis_label("$q_1$", "deg"))
    axes.set_ylabel(axis_label("$q_2$", "deg"))
    legend_above(axes, columns=3)
    return figure


def _joined(parts: Iterable[Array]) -> Array:
    """Join curves, separated by NaN rows, shape (K, 2)."""
    gap = np.full((1, 2), np.nan)
    return np.vstack([row for part in parts for row in (part, gap)] or [gap])


def _draw_distances(axes: Any, problem: Problem, arm: PlanarArm) -> None:
    """Draw where point 3 has the radius of the start and of the end of the path (28)."""
    axis = np.linspace(-np.pi, np.pi, _GRID)
    radii = np.abs(point_3(arm, np.stack(np.meshgrid(axis, axis), axis=-1)))
    last = problem.path.duration
    for time, dashes, name in ((0.0, (0, (6, 2)), "start"), (last, (0, (1, 1.5)), "end")):
        level = abs(point_3_on_path(problem, time))
        if radii.min() < level < radii.max():
            degrees = np.degrees(axis)
            axes.contour(
                degrees, degrees, radii, levels=[level], colors=[GREY], linestyles=[dashes],
                linewidths=1.0,
            )  # fmt: skip
            axes.plot(
                [], [], color=GREY, linestyle=dashes, linewidth=1.0, label=f"reaches the {name}"
            )


def _draw_motion(
    axes: Any, motion: Motion, colour: str, dashes: Any, reason: str, *, named: bool
) -> None:
    """Draw the first two joints of a motion, wrapped to 360 degrees, from an open circle.

    The markers of its ends are in the legend if ``named``, that of a singularity always.
    """
    heading = np.degrees(motion.problem.plane.heading(motion.initial.attitude))
    places = np.linspace(0.0, motion.panels, 12 * motion.panels + 1)
    q = np.degrees(motion.evaluate(places)[2][:, :2])
    rows = wrapped(q)
    label = f"heading {digits(heading)}°" + (f",\n{reason}" if reason else "")
    axes.plot(*rows.T, color=colour, linestyle=dashes, linewidth=1.6, label=label, zorder=4)
    style: Any = {"color": colour, "zorder": 5}
    begins, ends = ("begins", "ends") if named else (None, None)
    draw_point(axes, rows[0], "o", 4.5, markerfacecolor="white", label=begins, **style)
    marker, name = ("X", "singular") if motion.ending is Ending.SINGULAR else ("o", ends)
    draw_point(axes, rows[-1], marker, 4.5, label=name, **style)


def wrapped(degrees: Array) -> Array:
    """A curve (K, 2) wrapped to [-180, 180) [deg], with NaN rows at the jumps."""
    inside = (degrees + 180.0) % 360.0 - 180.0
    revolutions = np.round((degrees - inside) / 360.0)
    (jumps,) = np.nonzero(np.diff(revolutions, axis=0).any(axis=1))
    return np.insert(inside, jumps + 1, np.nan, axis=0)


@styled
def headings_figure(
    result: HeadingMap,
    ranges: Sequence[BranchRanges] = (),
    chosen: tuple[int, float] | None = None,
) -> Figure:
    """The figure of the minimum margin over heading, with an axes per arm branch.

    Args:
        result: Map over headings.
        ranges: Feasible heading ranges; by default those of the map's samples.
        chosen: Branch and heading [rad] to mark.
    """
    curves = _curves(result, ranges)
    measure = result.problem.margin.measure
    figure = new_figure(COLUMN, 0.7 + 1.35 * len(curves))
    panels = figure.subplots(len(curves), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (branch, name, values, spans) in zip(panels, curves, strict=True):
        axes.plot(np.degrees(result.headings), values, color=BLUE, label=name)
        for number, (low, high) in enumerate(spans):
            label = "feasible" if number == 0 else None
            axes.axvspan(low, high, color=_FEASIBLE, linewidth=0.0, zorder=0, label=label)
        if (unreached := np.isnan(values)).any():
            axes.fill_between(
                np.degrees(result.headings), 0.0, 1.0, where=unreached, step="mid",
                transform=axes.get_xaxis_transform(), facecolor="white", edgecolor=GREY,
                hatch="////", linewidth=0.0, zorder=0, label="start out of reach",
            )  # fmt: skip
        margin = result.problem.margin.threshold
        if margin > 0.0:
            axes.axhline(margin, label=f"margin {digits(margin)}", **MARGIN_LINE)
        if chosen is not None and branch in (None, chosen[0]):
            axes.axvline(np.degrees(chosen[1]), color=BLACK, linestyle=":", label="chosen")
        axes.set_xlim(0.0, 360.0)
        axes.set_ylabel(axis_label(f"min |{measure.title}|", measure.unit))
        legend_above(axes, columns=3 if unreached.any() else None)
    panels[-1].set_xticks(np.arange(0, 361, 60))
    panels[-1].set_xlabel(axis_label("initial heading", "deg"))
    return figure


def _curves(
    result: HeadingMap, ranges: Sequence[BranchRanges]
) -> list[tuple[int | None, str, Array, list[list[float]]]]:
    """Branch, name, minimum margins and feasible ranges [deg] per axes."""
    motions = result.results.motions
    margins = np.where(motions.endings == LIMITED, motions.minimum, result.results.existing_margins)
    labels = result.branch_labels()
    if result.problem.redundant:
        ((_, best),) = result.by_branch(margins)
        spans = ranges[0].degrees if ranges else _sampled_spans(result, None)
        if ranges:  # others, which are followed to these headings, keep the margin there
            inside = np.array([ranges[0].depth(heading) > 0.0 for heading in result.headings])
            best = np.where(inside & ~result.problem.margin.keeps(best), np.nan, best)
        return [(None, "best start tried", best, spans)]
    known: dict[int | None, tuple[str, list[list[float]]]]
    known = {entry.branch: (branch_name(entry.label), entry.degrees) for entry in ranges}
    curves: list[tuple[int | None, str, Array, list[list[float]]]] = []
    for branch, values in result.by_branch(margins):
        sampled = branch_name(labels[branch]), _sampled_spans(result, branch)
        name, spans = known.get(branch, sampled)
        curves.append((branch, name, values, spans))
    return curves


def _sampled_spans(result: HeadingMap, branch: int | None) -> list[list[float]]:
    """Runs of feasible samples in [0, 360] deg, those across zero split in two."""
    spans = []
    for region in result.regions:
        if region.branch == branch:
            low = np.degrees(region.centre - region.radius) % 360.0
            high = low + np.degrees(region.size)
            spans += [[low, high]] if high <= 360.0 else [[0.0, high - 360.0], [low, 360.0]]
    return spans
