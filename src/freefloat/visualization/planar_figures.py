"""Figures of planar problems: the initial heading, and the joint space (Figs. 2a and 3)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from freefloat.ensemble.endings import LIMITED
from freefloat.ik.numbering import branch_name, short_label
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.problem import Problem
from freefloat.planning.margin_map import HeadingMap
from freefloat.planning.plane.arcs import BranchRanges
from freefloat.planning.touch_point import TouchKind, TouchPoint
from freefloat.regions.margin_curves import MarginCurve, level_curves
from freefloat.regions.planar_regions import PlanarArm, point_3, point_3_on_path, two_angles
from freefloat.so3 import Array
from freefloat.visualization import figure_style as style

_FEW, _FEASIBLE = 2, "#CFE3EF"
"""Largest number of arm branches whose labels are written in full; colour of feasible headings."""
Touching = tuple[Motion, TouchPoint]
"""A motion that just keeps the margin, and where it touches the margin curve."""
_GRID = 361
_LOW = np.array([-180.0, -90.0])
"""Smallest angles that are drawn [deg]: stretched and folded arms, with q2 near 0 and 180 degrees,
are inside."""
_BORDER, _FREE = 35.0, 60.0
"""Distance of names from the edge, and the one from other curves that is enough [deg]."""
_BESIDE = 20.0 * np.array([[np.cos(t), np.sin(t)] for t in np.arange(8) * np.pi / 4.0])
"""Places of a letter beside a touch point [deg]."""
_CLEAR: Any = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5}
"""White behind letters."""
_LETTER: Any = {"ha": "center", "va": "center", "zorder": 6, "bbox": _CLEAR}
_APART = 30.0
"""Least distance of touch points that are lettered [deg]."""
_NUDGES, _OUTWARDS = 0.05 * np.eye(2), 24.0
"""Steps to the side of larger S, and distance of a name from its curve [deg]."""
_OUTLINED: Any = {"color": style.GREEN, "markeredgecolor": style.BLACK, "zorder": 7}


@style.styled
def headings_figure(
    result: HeadingMap, ranges: Sequence[BranchRanges] = (), chosen: tuple[int, float] | None = None
) -> Figure:
    """The figure of the minimum margin over heading, with an axes per arm branch.

    Args:
        result: Map over headings.
        ranges: Feasible heading ranges; by default the ranges of the map's samples.
        chosen: Branch and heading [rad] to mark.
    """
    curves = _curves(result, ranges)
    measure = result.problem.margin.measure
    figure = style.new_figure(style.COLUMN, 0.7 + 1.35 * len(curves))
    panels = figure.subplots(len(curves), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (branch, name, values, spans) in zip(panels, curves, strict=True):
        short = short_label(name) if len(curves) > _FEW else ""
        axes.plot(np.degrees(result.headings), values, color=style.BLUE, label=short or name)
        for number, (low, high) in enumerate(spans):
            label = "feasible" if number == 0 else None
            axes.axvspan(low, high, color=_FEASIBLE, linewidth=0.0, zorder=0, label=label)
        if (unreached := np.isnan(values)).any():
            axes.fill_between(
                np.degrees(result.headings), 0.0, 1.0, where=unreached, step="mid",
                transform=axes.get_xaxis_transform(), facecolor="white", edgecolor=style.GREY,
                hatch="////", linewidth=0.0, zorder=0, label="start out of reach",
            )  # fmt: skip
        margin = result.problem.margin.threshold
        if margin > 0.0:
            axes.axhline(margin, label=f"margin {style.digits(margin)}", **style.MARGIN_LINE)
        if chosen is not None and branch in (None, chosen[0]):
            axes.axvline(np.degrees(chosen[1]), color=style.BLACK, linestyle=":", label="chosen")
        axes.set_xlim(0.0, 360.0)
        axes.set_ylabel(style.axis_label(f"min |{measure.title}|", measure.unit))
        style.legend_above(axes, columns=3 if unreached.any() else None)
    panels[-1].set_xticks(np.arange(0, 361, 60))
    panels[-1].set_xlabel(style.axis_label("initial heading", "deg"))
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
    stated: dict[int | None, BranchRanges] = {entry.branch: entry for entry in ranges}
    curves = []
    for branch, values in result.by_branch(margins):
        entry = stated.get(branch)
        spans = _sampled_spans(result, branch) if entry is None else entry.degrees
        name = branch_name(labels[branch] if entry is None else entry.label)
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


@style.styled
def joint_space_figure(
    problem: Problem,
    motions: Sequence[Motion],
    reasons: Sequence[str] = (),
    touching: Sequence[Touching] = (),
) -> Figure:
    """The figure of curves I to IV, of radii of point 3 and of motions (Figs. 2a and 3).

    Args:
        problem: Planar problem whose S depends on two joint angles.
        motions: Motions, the chosen motion first.
        reasons: What each violates besides the margin, for the legend; empty for nothing.
        touching: Motions that just keep the margin, with their touch points: C inside the path
            (Case I), E at an end (Case II).
    """
    figure = style.new_figure(style.COLUMN, 4.0 if motions or touching else 3.6)
    axes = figure.subplots()
    arm = PlanarArm.of(problem.model)
    curves = _draw_levels(axes, problem, arm)
    points = [point for _, point in touching]
    others = [motion_curve(motion) for motion in [*motions, *(motion for motion, _ in touching)]]
    drawn_before = np.vstack([*others, *(curve_in_window(np.degrees(c.joints)) for c in curves)])
    if others:
        drawn_before = _draw_distances(axes, problem, arm, points, drawn_before)
    for number, (motion, _) in enumerate(touching):
        label = None if number else "touching motion"
        rows = motion_curve(motion)
        axes.plot(*rows.T, color=style.GREEN, linestyle="-", linewidth=0.9, label=label, zorder=3)
    _draw_touch_points(axes, points, drawn_before)
    drawn = zip(motions, style.STROKES, [*reasons, "", ""], strict=False)
    for number, (motion, (colour, dashes), reason) in enumerate(drawn):
        _draw_motion(axes, motion, colour, dashes, reason, named=number == 0)
    _name_curves(axes, arm, curves, np.vstack([np.empty((0, 2)), *others]))
    axes.set(xlim=(-180.0, 180.0), ylim=(-90.0, 270.0), aspect="equal")
    axes.set(xticks=np.arange(-180, 181, 90), yticks=np.arange(-90, 271, 90))
    axes.set(xlabel=style.axis_label("$q_1$", "deg"), ylabel=style.axis_label("$q_2$", "deg"))
    style.legend_above(axes, columns=3)
    return figure


def motion_curve(motion: Motion) -> Array:
    """The motion curve: q1 and q2 along a motion as they are drawn [deg], shape (K, 2)."""
    places = np.linspace(0.0, motion.panels, 12 * motion.panels + 1)
    return curve_in_window(np.degrees(motion.evaluate(places)[2][:, :2]))


def curve_in_window(degrees: Array) -> Array:
    """A curve (K, 2) wrapped to the angles that are drawn [deg], with NaN rows at the jumps."""
    inside = (degrees - _LOW) % 360.0 + _LOW
    revolutions = np.round((degrees - inside) / 360.0)
    (jumps,) = np.nonzero(np.diff(revolutions, axis=0).any(axis=1))
    return np.insert(inside, jumps + 1, np.nan, axis=0)


def _draw_levels(axes: Any, problem: Problem, arm: PlanarArm) -> list[MarginCurve]:
    """Draw singularity and margin curves, and return the curves S = 0 and S = S0."""
    margin = problem.margin
    levels: list[tuple[float, Any, float]] = [(0.0, "-", 1.2)]
    if margin.threshold > 0.0 and margin.measure.name == "system":  # the S of (21a)
        levels += [(margin.threshold, (0, (5, 1.5)), 0.8), (-margin.threshold, (0, (1, 1.2)), 0.8)]
    curves = level_curves(arm, *(value for value, _, _ in levels))
    for value, dashes, width in levels:
        shown = style.amount(value, margin.measure.unit) if value else "0 (singular)"
        label: str | None = f"$S$ = {shown}"
        for curve in (curve for curve in curves if curve.level == value):
            rows = curve_in_window(np.degrees(curve.joints))
            axes.plot(*rows.T, color=style.BLACK, linestyle=dashes, linewidth=width, label=label)
            label = None
    return [curve for curve in curves if curve.level >= 0.0]


def _name_curves(axes: Any, arm: PlanarArm, curves: Sequence[MarginCurve], others: Array) -> None:
    """Write the names I to IV once each, singularity and margin curves on their outer sides.

    A name stands where it is far from other names and curves, shape (K, 2) [deg].
    """
    for name, curve in {curve.name: curve for curve in reversed(curves)}.items():
        place = _freest(curve_in_window(np.degrees(curve.joints)), others)
        beside = arm.determinant(two_angles(arm, np.radians(place + _NUDGES))) - curve.level
        outwards = beside if curve.level > 0.0 else -beside
        spot = place + _OUTWARDS * outwards / np.linalg.norm(outwards)
        others = np.vstack([others, place, spot])
        axes.annotate(
            name, place, spot, fontweight="bold",
            arrowprops={"arrowstyle": "-", "linewidth": 0.6, "shrinkA": 0.0, "shrinkB": 0.0},
            **_LETTER,
        )  # fmt: skip


def _freest(places: Array, others: Array) -> Array:
    """The place among (K, 2) that is farthest from others (M, 2); both may have NaN rows [deg]."""
    places, others = (rows[np.isfinite(rows).all(axis=1)] for rows in (places, others))
    inside = np.abs(places - _LOW - 180.0).max(axis=1) < 180.0 - _BORDER
    places = places[inside] if inside.any() else places
    gaps = np.linalg.norm(places[:, None] - others, axis=2).min(axis=1, initial=_FREE)
    return np.asarray(places[np.argmax(gaps)])


def _draw_touch_points(axes: Any, points: Sequence[TouchPoint], others: Array) -> None:
    """Mark touch points by kind, and letter those that are not close to another of their kind.

    Letters stand on the side that is farthest from other curves, shape (K, 2) [deg], and points.
    """
    marks = [curve_in_window(np.degrees(point.joints[:2])[None])[0] for point in points]
    others = np.vstack([others, *marks])
    tangent = [point.kind is TouchKind.TANGENT for point in points]
    for inside, marker, letter in ((True, "D", "C"), (False, "s", "E")):
        label: str | None = f"touch point {letter}"
        lettered = [np.full(2, np.inf)]
        for place in (mark for mark, kind in zip(marks, tangent, strict=True) if kind is inside):
            style.draw_point(axes, place, marker, 4.0, label=label, **_OUTLINED)
            label = None
            if min(np.linalg.norm(place - other) for other in lettered) > _APART:
                spot = _freest(place + _BESIDE, others)
                axes.text(*spot, letter, **_LETTER)
                lettered.append(place)
                others = np.vstack([others, spot])


def _draw_distances(
    axes: Any, problem: Problem, arm: PlanarArm, points: Sequence[TouchPoint], others: Array
) -> Array:
    """Draw where point 3 has the radius of the path's ends, A and B, and of others, E (28).

    Their letters stand where they are far from other curves, shape (K, 2) [deg]; returns all.
    """
    across, up = (np.radians(low) + np.linspace(0.0, 2.0 * np.pi, _GRID) for low in _LOW)
    radii = np.abs(point_3(arm, np.stack(np.meshgrid(across, up), axis=-1)))
    last = problem.path.duration
    inner = {p.time for p in points if p.kind is not TouchKind.TANGENT and 0.0 < p.time < last}
    curves = [
        (0.0, (0, (6, 2)), "A", "start"), (last, (0, (1, 1.5)), "B", "end"),
        *((time, (0, (3, 1, 1, 1)), "E", f"{style.digits(time)} s") for time in sorted(inner)),
    ]  # fmt: skip
    for time, dashes, letter, name in curves:
        level = abs(point_3_on_path(problem, time))
        if radii.min() < level < radii.max():
            curve = axes.contour(
                np.degrees(across), np.degrees(up), radii, levels=[level], colors=[style.GREY],
                linestyles=[dashes], linewidths=1.0,
            )  # fmt: skip
            place = _freest(np.vstack(curve.allsegs[0]), others)
            others = np.vstack([others, *curve.allsegs[0], place])
            axes.text(*place, f"$R_{letter}$", **_LETTER)
            label = f"$R_{letter}$ ({name})"
            axes.plot([], [], color=style.GREY, linestyle=dashes, linewidth=1.0, label=label)
    return others


def _draw_motion(
    axes: Any, motion: Motion, colour: str, dashes: Any, reason: str, *, named: bool
) -> None:
    """Draw the motion curve from an open circle.

    The markers of its ends are in the legend if ``named``, the marker of a singularity always.
    """
    heading = np.degrees(motion.setting.plane.heading(motion.initial.attitude))
    rows = motion_curve(motion)
    label = f"heading {style.digits(heading)}°" + (f",\n{reason}" if reason else "")
    axes.plot(*rows.T, color=colour, linestyle=dashes, linewidth=1.6, label=label, zorder=4)
    look: Any = {"color": colour, "zorder": 5}
    begins, ends = ("begins", "ends") if named else (None, None)
    style.draw_point(axes, rows[0], "o", 4.5, markerfacecolor="white", label=begins, **look)
    marker, name = ("X", "singular") if motion.ending is Ending.SINGULAR else ("o", ends)
    style.draw_point(axes, rows[-1], marker, 4.5, label=name, **look)
