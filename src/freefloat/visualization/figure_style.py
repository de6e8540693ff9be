"""Style of all figures, and saving them.

Figures are created without pyplot: no window opens and no global state is kept.
"""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import wraps
from itertools import cycle, product
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import matplotlib
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from matplotlib.rcsetup import cycler

from freefloat.io.files import make_folder, require_replaceable, require_writable, written_beside
from freefloat.motion.margin import ROUNDING
from freefloat.so3 import Array

COLUMN, PAGE = 3.5, 7.16
"""Widths of a column and of a page of the IEEE Transactions [inch]."""
_OKABE_ITO = "#000000 #E69F00 #56B4E9 #009E73 #0072B2 #D55E00 #CC79A7"
BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE = _OKABE_ITO.split()
"""Okabe-Ito colours without yellow."""
GREY, LIGHT, PALE = "#767676", "#B8B8B8", "#E4E4E4"
STROKES = tuple(
    zip(
        (BLUE, VERMILION, BLACK, GREEN, ORANGE, PURPLE, SKY),
        ("-", "--", "-.", ":", (0, (6, 1.5)), (0, (3, 1, 1, 1, 1, 1)), (0, (1, 2.5))),
        strict=True,
    )
)
"""Colour and dashes of the first, second, ... curve of an axes."""
_MANY, _PALEST = "viridis", 0.9
"""Colour map of more curves, and the fraction of it that is dark enough."""
MARGIN_LINE: Any = {"color": VERMILION, "linestyle": "--", "linewidth": 1.0}
_STYLE: Any = {
    "axes.axisbelow": True, "axes.grid": True, "axes.labelsize": 8.0, "axes.linewidth": 0.6,
    "axes.prop_cycle": cycler(color=[c for c, _ in STROKES], linestyle=[d for _, d in STROKES]),
    "axes.spines.right": False, "axes.spines.top": False, "axes.titlesize": 8.0,
    "figure.constrained_layout.h_pad": 0.03, "figure.constrained_layout.w_pad": 0.03,
    "figure.titlesize": 8.0, "figure.titleweight": "bold", "font.size": 8.0, "grid.color": PALE,
    "grid.linewidth": 0.5, "axes.formatter.useoffset": False, "legend.fontsize": 7.0,
    "legend.frameon": False, "lines.linewidth": 1.2, "lines.markersize": 4.0, "pdf.fonttype": 42,
    "text.usetex": False, "xtick.labelsize": 7.0, "xtick.major.width": 0.6, "ytick.labelsize": 7.0,
    "ytick.major.width": 0.6,
}  # fmt: skip
_SCREEN = 130.0
"""Resolution of figures in notebooks [dots per inch]."""
_CROWDED, _LONGEST_LINE, _BEYOND = 6, 8, 1.15
"""Entries above which a legend is set tighter, most entries in a line, and its largest width over
the width of its axes before they are laid out."""

P = ParamSpec("P")
R = TypeVar("R")


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """Decorate a function that creates, fills or saves a figure, so that it uses the style."""

    @wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> R:
        with matplotlib.rc_context(_STYLE):
            return draw(*args, **kwargs)

    return drawn


@styled
def _png(figure: Figure) -> bytes:
    with io.BytesIO() as buffer:
        figure.savefig(buffer, format="png", dpi=_SCREEN)
        return buffer.getvalue()


class _NotebookFigure(Figure):
    """A figure that a notebook shows, also where pyplot is not imported."""

    def _repr_png_(self) -> bytes:
        return _png(self)


Drawings = dict[str, Callable[[], Figure]]
"""Functions that draw figures, by name."""


class Figures(Mapping[str, Figure]):
    """Figures by name, drawn when they are asked for; a notebook shows one below the other."""

    def __init__(self, drawings: Drawings) -> None:
        self.drawings = drawings
        self._drawn: dict[str, Figure] = {}

    def __getitem__(self, name: str) -> Figure:
        if name not in self._drawn:
            self._drawn[name] = self.drawings[name]()
        return self._drawn[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.drawings)

    def __len__(self) -> int:
        return len(self.drawings)

    def _repr_html_(self) -> str:
        pictures = (base64.b64encode(_png(figure)).decode() for figure in self.values())
        return "".join(f'<img src="data:image/png;base64,{text}">' for text in pictures)


@styled
def new_figure(width: float = COLUMN, height: float = 2.4) -> Figure:
    """An empty figure of a size in inches, with constrained layout."""
    return _NotebookFigure(figsize=(width, height), layout="constrained")


def plain(name: str) -> str:
    """A name that users gave, whose dollar signs begin no formula."""
    return name.replace("$", r"\$")


def axis_label(quantity: str, unit: str) -> str:
    """A quantity and its unit in brackets, if it has one; ``m^2`` becomes a superscript."""
    return f"{quantity} [{_raised(unit)}]" if _raised(unit) else quantity


def amount(value: float, unit: str) -> str:
    """A number with four digits and its unit, if it has one."""
    return f"{digits(value)} {_raised(unit)}".strip()


def _raised(unit: str) -> str:
    return "" if unit == "1" else re.sub(r"\^(-?[0-9]+)", r"$^{\1}$", unit)


def digits(value: float) -> str:
    """A number with four digits and a typographic minus sign; below 1e-12 it is zero."""
    return f"{0.0 if abs(value) < 1e-12 else value:.4g}".replace("-", "\N{MINUS SIGN}")


def edges_beside(bound: float, values: npt.ArrayLike, count: int) -> Array:
    """Edges of at most about ``count`` bars of magnitudes; no bar is partly below a bound."""
    bound *= 1.0 - ROUNDING  # values are kept up to rounding
    lowest, highest = np.min(values), np.max(values)
    drawn = max(highest, bound) - min(lowest, bound)
    width = max((highest - lowest) / count, drawn / (4 * count))
    if width <= 1e-9 * highest:  # they are equal but for rounding
        width = highest / count
    width = max(width, 1e-9 * bound) or 1.0
    first, last = (lowest - bound) / width - 1e-3, (highest - bound) / width + 1e-3
    return np.unique(np.maximum(bound + width * np.arange(np.floor(first), last + 1.0), 0.0))


def strokes(count: int) -> Any:
    """Colours and dashes of some curves, from a colour map where there are many."""
    pairs: Sequence[Any] = STROKES
    if count > len(STROKES):
        colours = matplotlib.colormaps[_MANY](np.linspace(0.0, _PALEST, count))
        pairs = list(zip(colours, cycle(("-", "--", ":"))))
    return cycler(color=[c for c, _ in pairs], linestyle=[d for _, d in pairs])


def draw_point(axes: Any, position: Array, marker: str, size: float, **style: Any) -> None:
    """Draw a marker without a line at a position, shape (2,) or (3,)."""
    axes.plot(*position[:, None], linestyle="none", marker=marker, markersize=size, **style)


def legend_above(axes: Any, columns: int | None = None, longest: int = _LONGEST_LINE) -> None:
    """Put the legend above the axes: in lines of at most some names, or centred in columns."""
    count = len(axes.get_legend_handles_labels()[1])
    crowded = columns is None and count > min(_CROWDED, longest)
    width = axes.figure.bbox.width if columns else _BEYOND * axes.get_window_extent().width
    for lines in range(max(1, -(-count // (columns or longest))), max(1, count) + 1):
        legend = axes.legend(
            loc="lower left" if columns is None else "lower center",
            bbox_to_anchor=(0.0 if columns is None else 0.5, 1.0), ncols=max(1, -(-count // lines)),
            borderaxespad=0.1, columnspacing=0.6 if crowded else 0.9,
            handlelength=1.5 if crowded else 2.0, handletextpad=0.4,
        )  # fmt: skip
        if legend.get_window_extent().width <= width:
            break


@styled
def save_figures(
    folder: str | Path,
    figures: Mapping[str, Figure],
    kinds: Sequence[str] = ("pdf", "png"),
    dots: float = 300.0,
) -> tuple[Path, ...]:
    """Write figures and return the files.

    Args:
        folder: Output folder, created if missing.
        figures: Figures by name; the names become file names.
        kinds: File formats.
        dots: Resolution of images [dots per inch].

    Raises:
        InputError: If the folder cannot be created or written to, or a file of another kind has
            the name of a figure.
    """
    make_folder("plots", Path(folder))
    files = {
        (name, kind): Path(folder) / f"{name}.{kind}" for name, kind in product(figures, kinds)
    }
    for (_, kind), file in files.items():
        require_writable("plots", file)
        require_replaceable("plots", file, kind)
    for name, figure in figures.items():
        layout = figure.get_layout_engine()
        for kind in kinds:
            picture = io.BytesIO()  # Matplotlib's own files hide errors of a full disk
            figure.savefig(picture, format=kind, dpi=dots)
            with written_beside(files[name, kind]) as temporary:
                temporary.write_bytes(picture.getvalue())
            figure.set_layout_engine("none")  # it is laid out
        figure.set_layout_engine(layout)
    return tuple(files.values())
