"""A study as a figure: the margin that each case keeps, over what was varied."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
from matplotlib.figure import Figure

from freefloat.so3 import Array
from freefloat.studies.result import ERROR, FEASIBLE, INFEASIBLE
from freefloat.visualization.figure_style import (
    BLUE,
    COLUMN,
    GREY,
    ORANGE,
    PAGE,
    VERMILION,
    new_figure,
    styled,
)

_MOST = 12
"""Panels; studies that vary more show the first ones."""
_ACROSS = 3
_HEIGHT = 2.1
_MARKS = {FEASIBLE: ("o", BLUE), INFEASIBLE: ("x", ORANGE), ERROR: ("|", VERMILION)}
_WORDS = 28
"""Letters of a parameter's name that fit under a panel."""


@styled
def study_figure(table: pa.Table, parameters: Sequence[str]) -> Figure:
    """Margins over each varied parameter; cases without a margin stand on the lower edge.

    Args:
        table: Of the cases.
        parameters: Its columns to draw over.
    """
    shown = [key for key in parameters if _varies(table[key].to_pylist())][:_MOST] or ["case"]
    across = min(_ACROSS, len(shown))
    down = math.ceil(len(shown) / across)
    figure = new_figure(COLUMN if across == 1 else PAGE, 0.4 + _HEIGHT * down)
    panels = figure.subplots(down, across, squeeze=False, sharey=True)
    verdicts = np.array(table["verdict"].to_pylist())
    margins = np.array(table["margin"].to_pylist(), dtype=float)
    for axes, key in zip(panels.flat, shown, strict=False):
        _panel(axes, key, table[key].to_pylist(), margins, verdicts)
    for axes in list(panels.flat)[len(shown) :]:
        axes.remove()
    required = {value for value in table["margin_required"].to_pylist() if value is not None}
    measure = next((one for one in table["measure"].to_pylist() if one is not None), None)
    for axes in panels.flat[: len(shown)] if len(required) == 1 else ():
        axes.axhline(*required, color=GREY, linestyle="--", linewidth=0.8)
    for row in panels:
        row[0].set_ylim(bottom=-0.02 * np.nanmax([*margins, 1e-9]))
        row[0].set_ylabel("least margin" if measure is None else f"least |{measure}|")
    handles, labels = panels.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=3)
    return figure


def _varies(values: Sequence[Any]) -> bool:
    return len({repr(value) for value in values}) > 1


def _panel(
    axes: Any, key: str, values: Sequence[Any], margins: Array, verdicts: np.ndarray[Any, Any]
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
    axes.set_xlabel(_short(key))


def _places(values: Sequence[Any]) -> tuple[Array, list[str] | None]:
    """Where values stand on an axis: numbers where they are, others side by side with names."""
    if all(value is None or isinstance(value, int | float) for value in values):
        return np.array(values, dtype=float), None
    names = list(dict.fromkeys(map(str, values)))
    places = np.array([names.index(str(value)) for value in values], dtype=float)
    return places, list(map(_short, names))


def _short(text: str) -> str:
    """The end of a long text, without what mathematics would read into it."""
    plain = text.replace("$", r"\$")
    return plain if len(plain) <= _WORDS else "\N{HORIZONTAL ELLIPSIS}" + plain[1 - _WORDS :]


def drawn_columns(table: pa.Table, keys: Sequence[str]) -> Iterator[str]:
    """The columns of varied keys, those of their entries among them."""
    for name in table.column_names:
        if any(name == key or name.startswith(f"{key}.") for key in keys):
            yield name
