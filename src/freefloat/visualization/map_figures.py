"""Figures of maps over all attitudes: slices of their ball, histograms, touch points."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Annulus, Circle, Patch
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import MaxNLocator
from scipy.ndimage import distance_transform_edt

from freefloat.ensemble.endings import COMPLETED, LIMITED, SINGULAR, UNREACHED
from freefloat.ensemble.feasibility import has_wrist_flipped_branches
from freefloat.ik.numbering import branch_name
from freefloat.motion.extrema import closest_approach
from freefloat.motion.integration import integrate_motion
from freefloat.motion.margin import keeps_threshold
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.touch_point import TouchKind
from freefloat.so3 import Array
from freefloat.visualization import figure_style as style
from freefloat.visualization.slices import Slice, rotation_vectors

_COMPONENTS = ("x", "y", "z")
_SHADES = "viridis"
_MARKERS = {"best": ("*", 9.0), "robust": ("D", 5.0), "nearest": ("^", 6.0)}
_MARKERS["chosen"] = _MARKERS["best"]
_OTHER_MARKER = ("o", 5.0)
_HALO = [Stroke(linewidth=2.2, foreground="white"), Normal()]
"""A white edge around markers, through which the map is seen."""
_BINS, _MAX_PANELS = 48, 12
_TITLE_LENGTH = 58
"""Characters that fit above a histogram."""
_CURVE_POINTS = 401
_STROKES = style.STROKES[:1] + style.STROKES[2:]
"""Strokes without the stroke of the margin."""
_INSIDE, _AT_END = ("D", "touch point C"), ("s", "touch point E")
"""Marker and name, C inside the path (Case I), E at an end (Case II), as in Fig. 3."""


@style.styled
def slices_figure(result: AttitudeMap, slices: Sequence[Slice]) -> Figure:
    """The figure of the best branch's minimum margin in slices, a row of three per mark."""
    rows, redundant = len(slices) // 3, result.problem.redundant
    threshold = result.problem.margin.threshold
    figure = style.new_figure(style.PAGE, 0.75 + 2.2 * rows)
    panels = figure.subplots(rows, 3, squeeze=False).ravel()
    highest = max(result.largest_margin, *(float(np.nanmax(plane.margins)) for plane in slices))
    norm = Normalize(threshold, max(highest, threshold))
    for axes, plane in zip(panels, slices, strict=True):
        _draw_slice(axes, plane, norm)
    if highest > threshold:
        bar = figure.colorbar(
            ScalarMappable(norm, _SHADES), ax=panels.tolist(), shrink=0.9, aspect=30.0, pad=0.02
        )
        bar.set_label(_label(result, f"\nof the best {'start' if redundant else 'arm branch'}"))
        bar.ax.spines["outline"].set_linewidth(0.6)
    marks = {str(line.get_label()): line for axes in panels for line in axes.get_lines()}
    handles = [*marks.values(), *_patches(result, slices)]
    step = np.degrees(slices[0].ticks[1] - slices[0].ticks[0])
    cells = f"Computed every {step:.1f}°, linear in between."
    figure.legend(
        handles=handles, title=cells, title_fontsize=7.0, loc="outside lower center",
        ncols=max(1, len(handles)),
    )  # fmt: skip
    return figure


def _patches(result: AttitudeMap, slices: Sequence[Slice]) -> list[Patch]:
    """The legend's entries of the areas without a colour that are in a slice."""
    words = f"all {'starts' if result.problem.redundant else 'branches'} below the margin"
    words += f" {style.digits(result.problem.margin.threshold)}"
    words += " or beyond a limit" if result.limited else ""
    grey: Any = {"facecolor": style.PALE, "label": words}
    hatched: Any = {"facecolor": "white", "hatch": "////", "label": "start of the path not reached"}
    seen = [
        [(plane.reached & (plane.margins == 0.0))[plane.inside].any(),
         (~plane.reached)[plane.inside].any()] for plane in slices
    ]  # fmt: skip
    drawn = zip(np.any(seen, axis=0), (grey, hatched), strict=True)
    return [Patch(edgecolor=style.GREY, linewidth=0.5, **look) for shown, look in drawn if shown]


def _label(result: AttitudeMap, words: str = "") -> str:
    measure = result.problem.margin.measure
    return style.axis_label(f"minimum |{measure.title}|{words}", measure.unit)


def _draw_slice(axes: Any, plane: Slice, norm: Normalize) -> None:
    """Draw a slice: coloured if feasible, grey if not, hatched if the start is not reached."""
    radius = np.degrees(np.sqrt(max(0.0, np.pi**2 - plane.offset**2)))
    white: Any = {"facecolor": "white", "edgecolor": style.GREY}
    axes.add_patch(Circle((0.0, 0.0), radius, linewidth=0.0, hatch="////", **white))
    ones, pale = np.ones_like(plane.margins), ListedColormap([style.PALE])
    _draw_area(axes, plane, plane.reached, ones, pale)
    _draw_area(axes, plane, plane.margins > 0.0, plane.margins, _SHADES, norm)
    axes.add_patch(Annulus((0.0, 0.0), 360.0, 360.0 - radius, linewidth=0.8, zorder=2.2, **white))
    right, up = plane.across
    if plane.mark is not None:
        place = np.degrees(rotation_vectors(plane.mark.attitude[None])[0])
        marker, size = _MARKERS.get(plane.mark.name, _OTHER_MARKER)
        style.draw_point(
            axes, place[[right, up]], marker, size, markerfacecolor="none",
            markeredgecolor=style.VERMILION, markeredgewidth=1.1, path_effects=_HALO,
            label=plane.mark.name, zorder=4,
        )  # fmt: skip
    _frame(axes, plane)


def _draw_area(
    axes: Any, plane: Slice, within: Any, values: Array, colours: Any, norm: Normalize | None = None
) -> None:
    """Draw values between samples, linear, in the area that ends halfway to samples outside it."""
    if not within.any():
        return
    ticks = np.degrees(plane.ticks)
    nearest = distance_transform_edt(~within, return_distances=False, return_indices=True)
    look = {"shading": "gouraud", "rasterized": True, "zorder": 2}
    shown = axes.pcolormesh(ticks, ticks, values[tuple(nearest)], cmap=colours, norm=norm, **look)
    area = axes.contourf(ticks, ticks, within.astype(float), [0.5, 2.0], alpha=0.0)
    shown.set_clip_path(area.get_paths()[0], transform=axes.transData)


def _frame(axes: Any, plane: Slice) -> None:
    """Set limits, ticks, labels and the title."""
    right, up = (_COMPONENTS[component] for component in plane.across)
    axes.set(xlim=(-188.0, 188.0), ylim=(-188.0, 188.0), aspect="equal")
    axes.set(xticks=np.arange(-180, 181, 90), yticks=np.arange(-180, 181, 90))
    axes.grid(visible=False)
    axes.set_xlabel(style.axis_label(rf"rotation vector, $\rho_{right}$", "deg"))
    axes.set_ylabel(style.axis_label(rf"$\rho_{up}$", "deg"), labelpad=0.0)
    name = "centre" if plane.mark is None else plane.mark.name
    degrees = np.degrees(plane.offset)
    axes.set_title(rf"{name}: $\rho_{_COMPONENTS[plane.normal]}={degrees:.1f}$°")


@style.styled
def histogram_figure(result: AttitudeMap) -> Figure:
    """The figure of the minimum margin's distribution over attitudes, per arm branch.

    The titles give the percentages of all outcomes. Of more than twelve branches those with most
    feasible attitudes are drawn.
    """
    every = result.branch_margins()
    margin = result.problem.margin
    largest = sorted(every, key=lambda group: -np.count_nonzero(margin.keeps(group[1])))
    chosen = [branch for branch, _ in largest[:_MAX_PANELS]]
    groups = [group for group in every if group[0] in chosen]
    titles = [_outcomes(result, *group) for group in groups]
    lines = sum(title.count("\n") + 1 for title in titles)
    figure = style.new_figure(style.COLUMN, 0.75 + 0.6 * max(1, len(groups)) + 0.13 * lines)
    panels = figure.subplots(max(1, len(groups)), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    if len(every) > len(groups):
        shown = f"{len(groups)} of {len(every)} branches"
        figure.suptitle(f":\nthe {shown} with most feasible attitudes")
    highest = max((float(values.max()) for _, values in groups), default=0.0)
    highest = highest if highest > 0.0 else 1.0
    edges = style.edges_beside(margin.threshold, [0.0, highest], _BINS)
    handles: dict[str, Any] = {}
    for axes, title, (_, values) in zip(panels, titles, groups, strict=False):
        _draw_bars(axes, values, edges, margin.threshold)
        axes.set_title(title, fontsize=7.0, loc="left")
        handles |= dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True))
    panels[-1].set_xlabel(_label(result))
    panels[-1].xaxis.set_major_locator(MaxNLocator(5))
    panels[-1].yaxis.set_major_locator(MaxNLocator(3, min_n_ticks=2))
    figure.supylabel("attitudes [%]", fontsize=8.0)
    figure.legend(
        handles.values(), handles, loc="outside lower center", ncols=max(1, len(handles)),
        columnspacing=1.0, handlelength=1.5,
    )  # fmt: skip
    return figure


def _draw_bars(axes: Any, values: Array, edges: Array, margin: float) -> None:
    """Draw bars, blue for feasible motions and grey below the margin, and the margin as a line."""
    feasible = keeps_threshold(values, margin)
    below = ~feasible & (values > 0.0)
    parts = (feasible, style.BLUE, "margin kept"), (below, style.LIGHT, "below the margin")
    for part, colour, name in parts:
        if part.any():
            weights = np.full(np.count_nonzero(part), 100.0 / len(values))
            look = {"color": colour, "linewidth": 0.0, "label": name}
            axes.hist(values[part], edges, weights=weights, **look)
    if margin > 0.0:
        axes.axvline(margin, label=f"margin {style.digits(margin)}", **style.MARGIN_LINE)


def _outcomes(result: AttitudeMap, branch: int | None, values: Array) -> str:
    """The name of a branch and the percentages of its outcomes, wrapped."""
    names = result.branch_labels()
    flipped = has_wrist_flipped_branches(result.problem)
    name = f"{names[branch][:-1]}±" if flipped else branch_name(names[branch])
    feasible, *others = _percentages(result, branch, values)
    parts = (f"{name}: {feasible}", ", ".join(others))
    return "\n".join(fill(part, _TITLE_LENGTH) for part in parts if part)


def _percentages(result: AttitudeMap, branch: int | None, values: Array) -> list[str]:
    """The percentages of attitudes by best outcome of their branches."""
    endings = result.results.motions.endings[:, slice(None) if branch is None else [branch]]
    outcomes = {
        "keep the margin": result.problem.margin.keeps(values),
        "below it": (endings == COMPLETED).any(axis=1),
        "violate a limit": (endings == LIMITED).any(axis=1),
        "singular": (endings == SINGULAR).any(axis=1),
        "stopped early": (endings != UNREACHED).any(axis=1),
        "not reached": np.ones(len(values), dtype=bool),
    }
    first = np.argmax(np.vstack([*outcomes.values()]), axis=0)
    parts = zip(outcomes, np.bincount(first, minlength=len(outcomes)) / len(values), strict=True)
    return [f"{100.0 * part:.1f} % {words}" for words, part in parts
            if part > 0.0 or words == "keep the margin"]  # fmt: skip


@style.styled
def touch_points_figure(result: AttitudeMap) -> Figure:
    """The figure of S along the motions from a map's first attitudes that touch points yield.

    Args:
        result: A map with touch points; as many are drawn as there are strokes.
    """
    problem = result.problem
    measure, threshold = problem.margin.measure, problem.margin.threshold
    figure = style.new_figure(height=2.6)
    axes = figure.subplots()
    axes.axhline(0.0, color=style.BLACK, linewidth=0.6)
    for sign, label in ((1.0, f"margin ±{style.amount(threshold, measure.unit)}"), (-1.0, None)):
        axes.axhline(sign * threshold, label=label, **style.MARGIN_LINE)
    for point, (colour, dashes) in zip(result.touch or (), _STROKES, strict=False):
        branches = {branch.index: branch for branch in problem.branches(point.attitude)}
        motion = integrate_motion(problem, point.attitude, branches[point.branch or 0].joints)
        times, _, joints = motion.evaluate(np.linspace(0.0, motion.panels, _CURVE_POINTS))
        axes.plot(times, measure(joints), color=colour, linestyle=dashes, linewidth=1.0)
        closest = closest_approach(motion, measure)
        place = np.array([closest.time, closest.sign * closest.value])
        marker, name = _INSIDE if point.kind in (None, TouchKind.TANGENT) else _AT_END
        known = {line.get_label() for line in axes.lines}
        style.draw_point(
            axes, place, marker, 4.0, color=colour, markeredgecolor=style.BLACK, zorder=5,
            clip_on=False, label=None if name in known else name,
        )  # fmt: skip
    axes.set_xlim(0.0, problem.path.duration)
    axes.set_xlabel(style.axis_label("time", "s"))
    axes.set_ylabel(style.axis_label(f"$S$ ({measure.title})", measure.unit))
    style.legend_above(axes)
    return figure
