"""Figure of a study: minimum margins, also over the varied parameters, and feasible fraction."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from freefloat.dynamics.measures import measure_title
from freefloat.so3 import Array
from freefloat.statistics import confidence_interval
from freefloat.visualization import figure_style as style

_MAX_PANELS = 12
_COLUMNS = 3
_HEIGHT = 2.1
"""Height of a panel [inch]."""
_MARKS = {
    "feasible": ("o", style.BLUE), "infeasible": ("x", style.ORANGE),
    "error": ("|", style.VERMILION),
}  # fmt: skip
_MAX_POINTS = 1000
"""Runs above which their density is drawn."""
_BINS = 40
"""Bars of the histogram."""
_MAX_QUANTITIES, _OF_MARGIN = 8, ("margin", "singularity")
"""Number of limiting quantities that have a bar; those that the histogram of margins shows."""
_PARTS = 20
"""Parts into which runs are divided, by the value of a parameter, to see its effect."""
_LARGEST_RATIO = 3.0
"""Ratios of limits from which they are drawn alike."""
_CELLS = 60, 40
"""Numbers of cells of a density, across and up."""
_PALEST = 0.5
"""Number of runs in a cell that would be white."""
_ESTIMATES = 200
"""Points of the running estimate."""
_LABEL_LENGTH, _NAME_LENGTH = 100, 28
"""Characters of labels that fit under all panels of a line, and of a name under a panel."""

Column = npt.NDArray[Any]


@style.styled
def study_figure(
    table: Mapping[str, Column],
    parameters: Mapping[str, str],
    unit: str = "",
    ratios: Array | None = None,
) -> Figure:
    """The figure of margins, over parameters too; runs without a margin are drawn there at zero.

    The first panels are the histogram of the margins, and the running estimate of the feasible
    fraction, by number of runs without error, with its 95 % confidence interval. Where limits
    decide most runs, the numbers of runs by limiting quantity take the place of the histogram, and
    the largest ratios of limits the place of the margins. Of more than twelve parameters those with
    the largest effect are drawn. Above 1,000 runs their panels show how many runs there are.

    Args:
        table: Columns of the runs: verdict, margin, margin_required, measure, the parameters, and
            limiting if it is known.
        parameters: Labels of the horizontal axes by column.
        unit: Unit of the margins.
        ratios: Largest ratio of a limit along each run, NaN where it is not known.
    """
    limiting = table.get("limiting", np.array([], dtype=object))
    known, others = limiting.astype(bool), ~np.isin(limiting.astype(str), _OF_MARGIN)
    limited = 2 * np.sum(known & others) > np.sum(known)
    drawn = np.nan_to_num(table["margin"])
    if limited and ratios is not None:
        largest = ratios.max(initial=1.0, where=~np.isnan(ratios))
        drawn = np.where(np.isnan(ratios), largest, ratios).clip(max=_LARGEST_RATIO)
    every = [key for key in parameters if len(set(table[key].tolist())) > 1]
    strongest = sorted(every, key=lambda key: -_effect(table[key], drawn))[:_MAX_PANELS]
    varied = [key for key in every if key in strongest]
    across = 2 if len(varied) == 4 else max(1, min(_COLUMNS, len(varied)))
    down, wide = math.ceil(len(varied) / across), 6 // across
    figure = style.new_figure(style.PAGE, 0.4 + _HEIGHT * (1 + down))
    grid = figure.add_gridspec(1 + down, 6)
    histogram, estimate = (figure.add_subplot(grid[0, half]) for half in (slice(3), slice(3, 6)))
    panels = [
        figure.add_subplot(grid[1 + row, wide * column : wide * (column + 1)])
        for row, column in (divmod(place, across) for place in range(len(varied)))
    ]
    verdicts = table["verdict"]
    required = np.unique(table["margin_required"][~np.isnan(table["margin_required"])])
    measure = next(filter(None, table["measure"]), None)
    quantity = "minimum margin" if measure is None else f"minimum |{measure_title(measure)}|"
    label = f"margin {style.amount(required[0], unit)}" if len(required) == 1 else ""
    if limited:
        _draw_limiting(histogram, limiting[known], verdicts[known])
        if ratios is not None:
            quantity, unit, required, label = "largest ratio", "1", np.ones(1), "limit"
    else:
        _draw_histogram(histogram, table["margin"], verdicts, *required if label else ())
        histogram.set_xlabel(style.axis_label(quantity, unit))
    dashed: Any = {"color": style.GREY, "linestyle": "--", "linewidth": 0.8}
    if label and not limited:
        histogram.axvline(*required, label=None if panels else label, **dashed)
    highest = drawn.max(initial=0.0) or 1.0
    lowest = min(drawn.min(initial=np.inf), highest, *(required if label else ()))
    densities = []
    for place, (axes, key) in enumerate(zip(panels, varied, strict=True)):
        densities += _panel(axes, table[key], drawn, verdicts)
        axes.set_xlabel(_short(parameters[key], _LABEL_LENGTH // across))
        if label:
            axes.axhline(*required, label=label, **dashed)
        axes.set_ylim(bottom=lowest - 0.05 * (highest - lowest or highest))
        if place % across == 0:
            label_size = 7.0  # not taller than the panel
            axes.set_ylabel(style.axis_label(quantity, unit), fontsize=label_size)
        else:
            axes.tick_params(labelleft=False)
    named = [axes.get_legend_handles_labels() for axes in (histogram, *panels[:1])]
    entries = {name: handle for each in named for handle, name in zip(*each, strict=True)}
    figure.legend(entries.values(), entries.keys(), loc="outside upper left", ncols=4)
    _draw_estimate(estimate, verdicts)
    if densities:
        most = max(density.get_array().max() for density in densities)
        for density in densities:
            density.set_clim(_PALEST, most)
        below: Any = {"location": "bottom", "shrink": 0.4, "aspect": 40}
        figure.colorbar(densities[0], ax=panels, label="runs in a cell", **below)
    if left_out := len(every) - len(varied):
        note = f"not shown: the {left_out} parameters with the least effect on the {quantity}"
        figure.supxlabel(note, fontsize=8.0)
    return figure


def _effect(values: Column, drawn: Array) -> float:
    """Variance of the means of what is drawn of equally many runs with values nearby."""
    order = np.argsort(_places(values)[0], kind="stable")
    parts = np.array_split(drawn[order], _PARTS)
    return float(np.var([part.mean() for part in parts if len(part)]))


def _draw_histogram(axes: Any, margins: Array, verdicts: Column, required: float = 0.0) -> None:
    """Draw how many runs have which margin, by verdict."""
    known = ~np.isnan(margins)
    parts = {verdict: margins[known & (verdicts == verdict)] for verdict in _MARKS}
    parts = {verdict: part for verdict, part in parts.items() if len(part)}
    axes.set_ylabel("runs")
    axes.xaxis.set_major_locator(MaxNLocator(5))
    if not parts:
        return
    edges = style.edges_beside(required, margins[known], _BINS)
    axes.hist(
        [*parts.values()], edges, stacked=True, color=[_MARKS[verdict][1] for verdict in parts],
        label=[f"{verdict} ({len(part):,})" for verdict, part in parts.items()],
    )  # fmt: skip


def _draw_limiting(axes: Any, names: Column, verdicts: Column) -> None:
    """Draw how many runs each quantity limits, by verdict, the most frequent at the top."""
    limiting, counts = np.unique(names, return_counts=True)
    shown = limiting[np.argsort(counts, kind="stable")][-_MAX_QUANTITIES:]
    left = np.zeros(len(shown))
    for verdict, (_, colour) in _MARKS.items():
        runs = np.array([np.sum((names == name) & (verdicts == verdict)) for name in shown])
        if runs.any():
            label = f"{verdict} ({int((verdicts == verdict).sum()):,})"
            places = [name.replace(" of ", "\nof ") for name in shown]
            axes.barh(places, runs, left=left, color=colour, label=label)
            left = left + runs
    axes.set_xlabel("runs by limiting quantity")
    axes.tick_params(axis="y", labelsize=6.5)


def _panel(axes: Any, values: Column, margins: Array, verdicts: Column) -> list[Any]:
    """Draw margins over a parameter; return the density, if runs are no points."""
    places, names = _places(values)
    if names is not None:
        axes.set_xticks(range(len(names)), names, rotation=30, ha="right")
    else:
        axes.xaxis.set_major_locator(MaxNLocator(5))
    if len(places) > _MAX_POINTS:
        return [axes.hist2d(
            places, margins, _CELLS, cmin=1, norm=LogNorm(1), cmap="Blues", rasterized=True
        )[3]]  # fmt: skip
    for verdict, (mark, colour) in _MARKS.items():
        chosen = verdicts == verdict
        if not chosen.any():
            continue
        axes.plot(
            places[chosen], margins[chosen], mark, color=colour, linestyle="none", markersize=3.0,
            label=f"{verdict} ({int(chosen.sum()):,})", alpha=0.7,
        )  # fmt: skip
    return []


def _draw_estimate(axes: Any, verdicts: Column) -> None:
    """Draw the feasible fraction of the first runs over their number."""
    feasible = (verdicts == "feasible")[verdicts != "error"]
    axes.set_xlabel("runs")
    axes.set_ylabel("feasible fraction")
    axes.set_ylim(-0.02, 1.02)
    if not len(feasible):
        return
    counts = np.unique(np.geomspace(1, len(feasible), _ESTIMATES).astype(int))
    feasible_counts = np.cumsum(feasible)[counts - 1]
    low, high = np.transpose(
        [confidence_interval(int(k), int(n)) for k, n in zip(feasible_counts, counts, strict=True)]
    )
    alone = len(counts) == 1
    axes.plot(counts, feasible_counts / counts, "o" if alone else "-", color=style.BLUE)
    look: Any = {"color": style.BLUE, "alpha": 0.2, "label": "95 % confidence interval"}
    axes.fill_between(counts, low, high, linewidth=3.0 if alone else 0.0, **look)
    axes.set_xscale("log")
    axes.legend(loc="best")


def _places(values: Column) -> tuple[Array, list[str] | None]:
    """Axis positions: the numbers themselves, or indices with names of other values."""
    if values.dtype != object:
        return np.asarray(values, dtype=float), None
    names, places = np.unique(values, return_inverse=True)
    return places.astype(float), [_short(str(name), _NAME_LENGTH) for name in names]


def _short(text: str, length: int) -> str:
    """Shorten a long text to its last words and escape its dollar signs."""
    if len(text) > length:
        words = re.sub(r"^[^ .[]*[ .](?!\[)", "", text[1 - length :])
        text = f"\N{HORIZONTAL ELLIPSIS}{words}"
    return style.plain(text)
