"""Figure of a study: minimum margins of the runs over the varied parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from freefloat.so3 import Array
from freefloat.visualization.figure_style import (
    BLUE,
    COLUMN,
    GREY,
    ORANGE,
    PAGE,
    VERMILION,
    axis_label,
    new_figure,
    styled,
)

_MAX_PANELS = 12
_COLUMNS = 3
_HEIGHT = 2.1
"""Height of a panel [inch]."""
_MARKS = {"feasible": ("o", BLUE), "infeasible": ("x", ORANGE), "error": ("|", VERMILION)}
_LABEL_LENGTH = 28
"""Characters that fit under a panel."""


@styled
def study_figure(
    table: Mapping[str, list[Any]], parameters: Mapping[str, str], unit: str = ""
) -> Figure:
    """Return the figure of margins over parameters; runs without a margin are drawn at zero.

    Args:
        table: Columns of the runs, among them case, verdict, margin, margin_required and measure.
        parameters: Labels of the horizontal axes by column.
        unit: Unit of the margins.
    """
    varied = [key for key in parameters if len(set(map(repr, table[key]))) > 1]
    shown = varied[:_MAX_PANELS] or ["case"]
    across = min(_COLUMNS, len(shown))
    down = math.ceil(len(shown) / across)
    figure = new_figure(COLUMN if across == 1 else PAGE, 0.4 + _HEIGHT * down)
    panels = figure.subplots(down, across, squeeze=False, sharey=True)
    verdicts = np.array(table["verdict"])
    margins = np.array(table["margin"], dtype=float)
    for axes, key in zip(panels.flat, shown, strict=False):
        _panel(axes, parameters.get(key, "run"), table[key], margins, verdicts)
    for axes in list(panels.flat)[len(shown) :]:
        axes.remove()
    required = {value for value in table["margin_required"] if value is not None}
    measure = next(filter(None, table["measure"]), None)
    for axes in panels.flat[: len(shown)] if len(required) == 1 else ():
        axes.axhline(*required, color=GREY, linestyle="--", linewidth=0.8)
    for row in panels:
        row[0].set_ylim(bottom=-0.02 * np.nanmax([*margins, 1e-9]))
        quantity = "minimum margin" if measure is None else f"minimum |{measure}|"
        row[0].set_ylabel(axis_label(quantity, unit))
    handles, labels = panels.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=3)
    return figure


def _panel(
    axes: Any, label: str, values: Sequence[Any], margins: Array, verdicts: np.ndarray[Any, Any]
) -> None:
    places, names = _places(values)
    floor = np.where(np.isfinite(margins), margins, 0.0)
    for verdict, (mark, colour) in _MARKS.items():
        chosen = verdicts == verdict
        axes.plot(
            places[chosen], floor[chosen], mark, color=colour, linestyle="none", markersize=3.0,
            label=f"{verdict} ({int(chosen.sum())})", alpha=0.7,
        )  # fmt: skip
    if names is not None:
        axes.set_xticks(range(len(names)), names, rotation=30, ha="right")
    axes.set_xlabel(_short(label))


def _places(values: Sequence[Any]) -> tuple[Array, list[str] | None]:
    """Return axis positions: the numbers themselves, or indices with names of other values."""
    if all(value is None or isinstance(value, int | float) for value in values):
        return np.array(values, dtype=float), None
    names = list(dict.fromkeys(map(str, values)))
    places = np.array([names.index(str(value)) for value in values], dtype=float)
    return places, list(map(_short, names))


def _short(text: str) -> str:
    """Shorten a long text to its end and escape its dollar signs."""
    if len(text) > _LABEL_LENGTH:
        text = "\N{HORIZONTAL ELLIPSIS}" + text[1 - _LABEL_LENGTH :]
    return text.replace("$", r"\$")
