"""Figures of planar problems: joint space, minimum margin over initial heading."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from freefloat.ensemble.endings import LIMITED
from freefloat.ik.branches import branch_name
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.problem import Problem
from freefloat.planning.plane.arcs import BranchRanges
from freefloat.planning.plane.heading_map import HeadingMap
from freefloat.planning.touching.touch_point import TouchKind, TouchPoint
from freefloat.regions.margin_curves import MarginCurve, level_curves
from freefloat.regions.planar_regions import PlanarArm, point_3, point_3_on_path
from freefloat.so3 import Array
from freefloat.visualization.figure_style import (
    BLACK,
    BLUE,
    COLUMN,
    GREEN,
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
_LOW = np.array([-180.0, -90.0])
"""Smallest angles that are drawn [deg]: stretched and folded arms, with q2 near 0 and 180 degrees,
are inside."""


@styled
def joint_space_figure(
    problem: Problem,
    motions: Sequence[Motion],
    reasons: Sequence[str] = (),
    touch_points: Sequence[TouchPoint] = (),
) -> Figure:
    """The figure of S = 0, S = +-S0, radii of point 3, motions and touch points (Figs. 2a and 3).

    Args:
        problem: Planar problem whose S depends on two joint angles.
        motions: Motions, the chosen motion first.
        reasons: What each violates besides the margin, for the legend; empty for nothing.
        touch_points: Touch points to mark; with motions, also the distances of the path's ends are
            drawn.
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
        shown = amount(value, margin.measure.unit) if value else "0 (singular)"
        label: str | None = f"$S$ = {shown}"
        for curve in (curve for curve in curves if curve.level == value):
            rows = wrapped(np.degrees(curve.joints))
            axes.plot(*rows.T, color=BLACK, linestyle=dashes, linewidth=width, label=label)
            label = None
    _name_curves(axes, [curve for curve in curves if curve.level >= 0.0])
    if motions:
        _draw_distances(axes, problem, arm)
    drawn = zip(motions, STROKES, [*reasons, "", ""], strict=False)
    for number, (motion, (colour, dashes), reason) in enumerate(drawn):
        _draw_motion(axes, motion, colour, dashes, reason, named=number == 0)
    _draw_touch_points(axes, touch_points)
    axes.set(xlim=(-180.0, 180.0), ylim=(-90.0, 270.0), aspect="equal")
    axes.set(xticks=np.arange(-180, 181, 90), yticks=np.arange(-90, 271, 90))
    axes.set_xlabel(axis_label("$q_1$", "deg"))
    axes.set_ylabel(axis_label("$q_2$", "deg"))
    legend_above(axes, columns=3)
    return figure


def _name_curves(axes: Any, curves: Sequence[MarginCurve]) -> None:
    """Write the names I to IV once each, those of singularity curves above, of others below."""
    named = {curve.name: curve for curve in reversed(curves)}
    for name, curve in sorted(named.items()):
        place = wrapped(np.degrees(curve.joints))
        place = place[np.isfinite(place).all(axis=1)]
        side, share = (1.0, 0.35) if curve.level == 0.0 else (-1.0, 0.7)
        axes.annotate(
            name, place[int(share * len(place))], (0.0, 15.0 * side), textcoords="offset points",
            fontweight="bold", ha="center", va="center", zorder=6,
            arrowprops={"arrowstyle": "-", "linewidth": 0.6, "shrinkA": 0.0, "shrinkB": 0.0},
        )  # fmt: skip


def _draw_touch_points(axes: Any, points: Sequence[TouchPoint]) -> None:
    """Mark touch points: C inside the path (Case I), E at an end (Case II), as in Fig. 3."""
    for inside, marker, label in ((True, "D", "touch point C"), (False, "s", "touch point E")):
        places = [p.joints[:2] for p in points if (p.kind is TouchKind.TANGENT) is inside]
        for number, joints in enumerate(places):
            style = {"color": GREEN, "markeredgecolor": BLACK, "zorder": 7}
            name = label if number == 0 else None
            place = wrapped(np.degrees(joints)[None])[0]
            draw_point(axes, place, marker, 4.5, label=name, **style)


def _draw_distances(axes: Any, problem: Problem, arm: PlanarArm) -> None:
    """Draw where point 3 has the radius of the start and of the end of the path (28)."""
    across, up = (np.radians(low) + np.linspace(0.0, 2.0 * np.pi, _GRID) for low in _LOW)
    radii = np.abs(point_3(arm, np.stack(np.meshgrid(across, up), axis=-1)))
    last = problem.path.duration
    for time, dashes, name in ((0.0, (0, (6, 2)), "start"), (last, (0, (1, 1.5)), "end")):
        level = abs(point_3_on_path(problem, time))
        if radii.min() < level < radii.max():
            axes.contour(
                np.degrees(across), np.degrees(up), radii, levels=[level], colors=[GREY],
                linestyles=[dashes], linewidths=1.0,
            )  # fmt: skip
            axes.plot(
                [], [], color=GREY, linestyle=dashes, linewidth=1.0, label=f"reaches the {name}"
            )


def _draw_motion(
    axes: Any, motion: Motion, colour: str, dashes: Any, reason: str, *, named: bool
) -> None:
    """Draw the first two joints of a motion, wrapped, from an open circle.

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
    """A curve (K, 2) wrapped to the angles that are drawn [deg], with NaN rows at the jumps."""
    inside = (degrees - _LOW) % 360.0 + _LOW
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
