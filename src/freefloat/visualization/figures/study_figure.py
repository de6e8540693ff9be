"""Figure of a study: minimum margins over the varied parameters, and the feasible fraction."""

from __future__ import annotations

import math
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
from freefloat.visualization.figure_style import (
    BLUE,
    COLUMN,
    GREY,
    ORANGE,
    PAGE,
    VERMILION,
    amount,
    axis_label,
    new_figure,
    styled,
)

_MAX_PANELS = 11
_COLUMNS = 3
_HEIGHT = 2.1
"""Height of a panel [inch]."""
_MARKS = {"feasible": ("o", BLUE), "infeasible": ("x", ORANGE), "error": ("|", VERMILION)}
_MAX_POINTS = 5000
"""Runs above which their density is drawn."""
_PARTS = 20
"""Parts into which runs are divided, by the value of a parameter, to see its effect."""
_CELLS = 60, 40
"""Numbers of cells of a density, across and up."""
_ESTIMATES = 200
"""Points of the running estimate."""
_LABEL_LENGTH = 28
"""Characters that fit under a panel."""

Column = npt.NDArray[Any]


@styled
def study_figure(
    table: Mapping[str, Column], parameters: Mapping[str, str], unit: str = ""
) -> Figure:
    """The figure of margins over parameters; runs without a margin are drawn at zero.

    Of more than eleven parameters those with the largest effect are drawn. Above 5,000 runs panels
    show how many runs there are. The last panel is the running estimate of
    the feasible fraction, by number of runs without error, with its 95 % confidence interval.

    Args:
        table: Columns of the runs: verdict, margin, margin_required, measure and the parameters.
        parameters: Labels of the horizontal axes by column.
        unit: Unit of the margins.
    """
    margins = np.nan_to_num(table["margin"])
    every = [key for key in parameters if len(set(table[key].tolist())) > 1]
    strongest = sorted(every, key=lambda key: -_effect(table[key], margins))[:_MAX_PANELS]
    varied = [key for key in every if key in strongest]
    across = 2 if len(varied) == 3 else min(_COLUMNS, len(varied) + 1)
    down = math.ceil((len(varied) + 1) / across)
    figure = new_figure(COLUMN if across == 1 else PAGE, 0.4 + _HEIGHT * down)
    panels = list(figure.subplots(down, across, squeeze=False).flat)
    verdicts = table["verdict"]
    required = np.unique(table["margin_required"][~np.isnan(table["margin_required"])])
    measure = next(filter(None, table["measure"]), None)
    quantity = "minimum margin" if measure is None else f"minimum |{measure_title(measure)}|"
    drawn = None
    for place, (axes, key) in enumerate(zip(panels, varied, strict=False)):
        drawn = _panel(axes, table[key], margins, verdicts)
        axes.set_xlabel(_short(parameters[key]))
        if len(required) == 1:
            label = f"margin {amount(required[0], unit)}"
            axes.axhline(*required, color=GREY, linestyle="--", linewidth=0.8, label=label)
        axes.set_ylim(bottom=-0.02 * margins.max(initial=1e-9))
        if place % across == 0:
            axes.set_ylabel(axis_label(quantity, unit))
        else:
            axes.tick_params(labelleft=False)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=4)
    if drawn is not None:
        figure.colorbar(
            drawn, ax=panels[: len(varied)], label="runs in a cell", location="top", shrink=0.4,
            aspect=40,
        )  # fmt: skip
    _draw_estimate(panels[len(varied)], verdicts)
    for axes in panels[len(varied) + 1 :]:
        axes.remove()
    if left_out := len(every) - len(varied):
        figure.supxlabel(
            f"not shown: the {left_out} parameters with the least effect", fontsize=8.0
        )
    return figure


def _effect(values: Column, margins: Array) -> float:
    """Variance of the mean margins of equally many runs with values nearby."""
    order = np.argsort(_places(values)[0], kind="stable")
    parts = np.array_split(margins[order], _PARTS)
    return float(np.var([part.mean() for part in parts if len(part)]))


def _panel(axes: Any, values: Column, margins: Array, verdicts: Column) -> Any:
    """Draw margins over a parameter; return the density, None where runs are points."""
    places, names = _places(values)
    if names is not None:
        axes.set_xticks(range(len(names)), names, rotation=30, ha="right")
    else:
        axes.xaxis.set_major_locator(MaxNLocator(5))
    if len(places) > _MAX_POINTS:
        return axes.hist2d(
            places, margins, _CELLS, cmin=1, norm=LogNorm(1), cmap="Blues", rasterized=True
        )[3]
    for verdict, (mark, colour) in _MARKS.items():
        chosen = verdicts == verdict
        if not chosen.any():
            continue
        axes.plot(
            places[chosen], margins[chosen], mark, color=colour, linestyle="none", markersize=3.0,
            label=f"{verdict} ({int(chosen.sum())})", alpha=0.7,
        )  # fmt: skip
    return None


def _draw_estimate(axes: Any, verdicts: Column) -> None:
    """Draw the feasible fraction of the first runs over their number."""
    feasible = (verdicts == "feasible")[verdicts != "error"]
    axes.set_xlabel("runs")
    axes.set_ylabel("feasible fraction")
    axes.yaxis.set_label_position("right")
    axes.yaxis.tick_right()
    axes.set_ylim(-0.02, 1.02)
    if not len(feasible):
        return
    counts = np.unique(np.geomspace(1, len(feasible), _ESTIMATES).astype(int))
    found = np.cumsum(feasible)[counts - 1]
    low, high = np.transpose(
        [confidence_interval(int(k), int(n)) for k, n in zip(found, counts, strict=True)]
    )
    axes.plot(counts, found / counts, color=BLUE)
    label = "95 % confidence interval"
    axes.fill_between(counts, low, high, color=BLUE, alpha=0.2, linewidth=0.0, label=label)
    axes.set_xscale("log")
    axes.legend(loc="best")


def _places(values: Column) -> tuple[Array, list[str] | None]:
    """Axis positions: the numbers themselves, or indices with names of other values."""
    if values.dtype != object:
        return np.asarray(values, dtype=float), None
    names, places = np.unique(values, return_inverse=True)
    return places.astype(float), [_short(str(name)) for name in names]


def _short(text: str) -> str:
    """Shorten a long text to its end and escape its dollar signs."""
    if len(text) > _LABEL_LENGTH:
        text = text.removeprefix("robot.")
    if len(text) > _LABEL_LENGTH:
        text = "\N{HORIZONTAL ELLIPSIS}" + text[1 - _LABEL_LENGTH :]
    return text.replace("$", r"\$")
