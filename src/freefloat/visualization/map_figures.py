"""Figures of maps over all attitudes: cuts through the ball of rotation vectors, and histograms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch

from freefloat.ensemble.feasibility import UNREACHED, has_wrist_flipped_branches
from freefloat.ensemble.kernels.integration import COMPLETED, SINGULAR
from freefloat.motion.problem import is_kept
from freefloat.planning.attitude_map import AttitudeMap
from freefloat.planning.slices import Slice, rotation_vectors
from freefloat.so3 import Array
from freefloat.visualization.figure_style import (
    BLUE,
    COLUMN,
    GREY,
    PAGE,
    PALE,
    VERMILION,
    axis_label,
    new_figure,
    styled,
)

_COMPONENTS = ("x", "y", "z")
_SHADES = "viridis"
_MARKERS = {"best": ("*", 11.0), "robust": ("D", 6.0), "nearest": ("^", 7.0)}
_OTHER_MARKER = ("o", 6.0)
_BINS = 48


def map_figures(found: AttitudeMap, slices: Sequence[Slice]) -> dict[str, Figure]:
    """All figures of a map, by name: ``map_slices`` and ``map_histogram``.

    Args:
        found: The map.
        slices: Of the same problem, from :func:`freefloat.planning.slices.map_slices`.
    """
    return {"map_slices": slices_figure(found, slices), "map_histogram": histogram_figure(found)}


@styled
def slices_figure(found: AttitudeMap, slices: Sequence[Slice]) -> Figure:
    """S_min of the best arm branch in planes of rotation vectors, a row for every mark.

    Args:
        found: The map, for what is measured and how far it goes.
        slices: Three for every mark.
    """
    rows = len(slices) // 3
    figure = new_figure(PAGE, 0.75 + 2.2 * rows)
    panels = figure.subplots(rows, 3, squeeze=False).ravel()
    margin = found.problem.margin
    highest = max(float(found.margins.max()), *(float(np.nanmax(one.least)) for one in slices))
    norm = Normalize(
        margin.threshold, highest if highest > margin.threshold else margin.threshold + 1.0
    )
    for axes, one in zip(panels, slices, strict=True):
        shown = _draw_slice(axes, one, norm)
    bar = figure.colorbar(shown, ax=panels.tolist(), shrink=0.9, aspect=30.0, pad=0.02)
    bar.set_label(_label(found, "of the best arm branch"))
    bar.outline.set_linewidth(0.6)
    entries: list[Any] = [
        Patch(facecolor=PALE, edgecolor=GREY, linewidth=0.5, label="margin broken by all branches"),
        Patch(facecolor="white", edgecolor=GREY, linewidth=0.5, hatch="////",
              label="start of the path out of reach"),
    ]  # fmt: skip
    drawn: dict[str, Any] = {}
    for axes in panels:
        for line in axes.get_lines():
            drawn.setdefault(str(line.get_label()), line)
    figure.legend(
        handles=[*drawn.values(), *entries], loc="outside upper center",
        ncols=len(drawn) + len(entries),
    )  # fmt: skip
    return figure


def _label(found: AttitudeMap, words: str) -> str:
    measure = found.problem.margin.measure
    return axis_label(f"least |{measure.name}| {words}", measure.unit)


def _draw_slice(axes: Any, one: Slice, norm: Normalize) -> Any:
    """One plane: colours where the margin is kept, grey where not, hatched where unreached."""
    ticks, inside = np.degrees(one.ticks), ~np.isnan(one.least)
    ball = Circle((0.0, 0.0), _radius(one), facecolor="white", edgecolor=GREY, linewidth=0.8)
    axes.add_patch(ball)
    unreached = Circle((0.0, 0.0), _radius(one), facecolor="none", edgecolor=GREY, linewidth=0.0,
                       hatch="////")  # fmt: skip
    axes.add_patch(unreached)
    broken = np.where(inside & one.reached & (one.least == 0.0), 1.0, np.nan)
    good = np.where(inside & (one.least > 0.0), one.least, np.nan)
    style = {"shading": "nearest", "rasterized": True, "clip_path": ball, "zorder": 2}
    axes.pcolormesh(ticks, ticks, broken, cmap=ListedColormap([PALE]), **style)
    shown = axes.pcolormesh(ticks, ticks, good, cmap=_SHADES, norm=norm, **style)
    right, up = one.across
    if one.mark is not None:
        place = np.degrees(rotation_vectors(one.mark.attitude[None])[0])
        marker, size = _MARKERS.get(one.mark.name, _OTHER_MARKER)
        axes.plot(
            place[right], place[up], linestyle="none", marker=marker, markersize=size,
            markerfacecolor=VERMILION, markeredgecolor="white", markeredgewidth=0.8,
            label=one.mark.name, zorder=4,
        )  # fmt: skip
    _frame(axes, one)
    return shown


def _radius(one: Slice) -> float:
    """Of the disc in which the plane cuts the ball [deg]."""
    return float(np.degrees(np.sqrt(max(0.0, np.pi**2 - one.offset**2))))


def _frame(axes: Any, one: Slice) -> None:
    """Components and degrees along the axes, the plane on top."""
    right, up = (_COMPONENTS[component] for component in one.across)
    axes.set(xlim=(-188.0, 188.0), ylim=(-188.0, 188.0), aspect="equal")
    axes.set_xticks(np.arange(-180, 181, 90))
    axes.set_yticks(np.arange(-180, 181, 90))
    axes.grid(visible=False)
    axes.set_xlabel(axis_label(rf"rotation vector, $\rho_{right}$", "deg"))
    axes.set_ylabel(axis_label(rf"$\rho_{up}$", "deg"), labelpad=0.0)
    name = "centre" if one.mark is None else one.mark.name
    degrees = np.degrees(one.offset)
    axes.set_title(rf"{name}: $\rho_{_COMPONENTS[one.normal]}={degrees:.1f}$°")


@styled
def histogram_figure(found: AttitudeMap) -> Figure:
    """How S_min is distributed over the attitudes, arm branch by arm branch.

    Motions that become singular have none; how many they are is told beside the bars.
    """
    families, names = found.branch_margins(), found.branch_labels()
    twins = has_wrist_flipped_branches(found.problem)
    margin = found.problem.margin
    rows = max(1, len(families))
    figure = new_figure(COLUMN, 0.5 + 0.85 * rows)
    panels = figure.subplots(rows, 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    highest = max((float(values.max()) for _, values in families), default=0.0)
    edges = np.linspace(0.0, highest if highest > 0.0 else 1.0, _BINS + 1)
    for axes, (branch, values) in zip(panels, families, strict=False):
        _draw_bars(axes, values, edges, margin.threshold)
        name = f"{names[branch][:-1]}±" if twins else names[branch]
        axes.set_title(f"{name}\n{_shares(found, branch, values)}", fontsize=7.0, loc="left")
    panels[-1].set_xlabel(_label(found, "on the way"))
    figure.supylabel("attitudes [%]", fontsize=8.0)
    return figure


def _draw_bars(axes: Any, values: Array, edges: Array, margin: float) -> None:
    """Bars blue where the margin is kept, grey where it is broken, and a line at it."""
    share = np.full(len(values), 100.0 / len(values))
    good = is_kept(values, margin)
    parts = (good, ~good & (values > 0.0))
    axes.hist(
        [values[part] for part in parts], edges, weights=[share[part] for part in parts],
        color=[BLUE, GREY], stacked=True, linewidth=0.0,
    )  # fmt: skip
    if margin > 0.0:
        axes.axvline(margin, color=VERMILION, linestyle="--", linewidth=1.0)


def _shares(found: AttitudeMap, branch: int | None, values: Array) -> str:
    """What share of the attitudes keeps the margin, falls below it, or does not get so far."""
    endings = found.endings if branch is None else found.endings[:, [branch]]
    ahead = np.zeros(len(values), dtype=bool)
    shares = []
    for part, words in (
        (is_kept(values, found.problem.margin.threshold), "keep the margin"),
        ((endings == COMPLETED).any(axis=1), "fall below"),
        ((endings == SINGULAR).any(axis=1), "get singular"),
        ((endings != UNREACHED).any(axis=1), "given up"),
        (np.ones(len(values), dtype=bool), "out of reach"),
    ):
        own = part & ~ahead
        ahead = ahead | part
        if own.any() or words == "keep the margin":
            shares.append(f"{100.0 * own.mean():.1f} % {words}")
    return ", ".join(shares)
