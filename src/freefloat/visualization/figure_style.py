"""How every figure looks and how it is saved: for a paper's column, in colour and in grey print.

Figures are made without pyplot: nothing opens a window, nothing is kept between them.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from functools import wraps
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import matplotlib
from cycler import cycler
from matplotlib.figure import Figure

from freefloat.errors import InputError
from freefloat.io.files import written_beside

COLUMN, PAGE = 3.5, 7.16
"""Widths of a column and of a page of the IEEE Transactions [inch]."""
BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE = (
    "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00", "#CC79A7",
)  # fmt: skip
"""Okabe and Ito's colours but for yellow, which white paper swallows."""
GREY, PALE = "#767676", "#E4E4E4"
"""For what stands behind the data: marks and areas."""
STROKES = tuple(
    zip(
        (BLUE, VERMILION, BLACK, GREEN, ORANGE, PURPLE, SKY),
        ("-", "--", "-.", ":", (0, (6, 1.5)), (0, (3, 1, 1, 1, 1, 1)), (0, (1, 2.5))),
        strict=True,
    )
)
"""Colour and dashes of the first, second, ... curve of an axes: told apart without colour, too."""
KINDS = ("pdf", "png")
"""Every figure is written as a drawing for print and as an image for screens."""

_DOTS = 200
_ROUNDING = 1e-12
_ROOMY = 6
"""Entries of a legend that leave room in a line as wide as a column."""
_STYLE: Any = {
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.labelsize": 8.0,
    "axes.linewidth": 0.6,
    "axes.prop_cycle": cycler(color=[c for c, _ in STROKES], linestyle=[d for _, d in STROKES]),
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 8.0,
    "figure.constrained_layout.h_pad": 0.03,
    "figure.constrained_layout.w_pad": 0.03,
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same on every machine
    "font.size": 8.0,
    "grid.color": PALE,
    "grid.linewidth": 0.5,
    "legend.fontsize": 7.0,
    "legend.frameon": False,
    "lines.linewidth": 1.2,
    "lines.markersize": 4.0,
    "mathtext.fontset": "dejavusans",
    "pdf.fonttype": 42,  # fonts that printers and editors can read
    "xtick.labelsize": 7.0,
    "xtick.major.width": 0.6,
    "ytick.labelsize": 7.0,
    "ytick.major.width": 0.6,
}  # fmt: skip
_UNDATED: dict[str, dict[str, Any]] = {
    "pdf": {"CreationDate": None},
    "png": {"Software": None},
}
"""So that the same figure gives the same bytes."""
_ACCEPTED = "a folder, there or to be made, that may be written to and has room"

P = ParamSpec("P")
R = TypeVar("R")


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """Draw in our look; for every function that makes or fills a figure."""

    @wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> R:
        with matplotlib.rc_context(_STYLE):
            return draw(*args, **kwargs)

    return drawn


@styled
def new_figure(width: float = COLUMN, height: float = 2.4) -> Figure:
    """An empty figure that arranges its axes itself.

    Args:
        width: :data:`COLUMN` or :data:`PAGE` [inch].
        height: [inch].
    """
    return Figure(figsize=(width, height), layout="constrained")


def axis_label(quantity: str, unit: str) -> str:
    """What an axis says: a quantity and its unit, powers raised (``m^2 kg``)."""
    raised = re.sub(r"\^(-?[0-9]+)", r"$^{\1}$", unit)
    return f"{quantity} [{raised}]"


def digits(value: float) -> str:
    """Four digits, with a minus sign that is one; nothing but rounding is zero."""
    return f"{0.0 if abs(value) < _ROUNDING else value:.4g}".replace("-", "\N{MINUS SIGN}")


def legend_above(axes: Any) -> None:
    """Put the legend of an axes on top of it, in one line, where it covers no data."""
    handles, _ = axes.get_legend_handles_labels()
    crowded = len(handles) > _ROOMY
    axes.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=max(1, len(handles)),
        borderpad=0.2, borderaxespad=0.1, columnspacing=0.6 if crowded else 0.9,
        handlelength=1.5 if crowded else 2.0, handletextpad=0.4,
    )  # fmt: skip


def figure_folder(folder: str | Path) -> Path:
    """The folder, made if it is not there; asked for before long work.

    Raises:
        InputError: If it cannot be made or written to.
    """
    path = Path(folder)
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except FileExistsError:
        raise InputError("plots", f"{path} is there and is no folder", _ACCEPTED) from None
    except OSError as error:
        raise InputError("plots", f"{path}: {error.strerror}", _ACCEPTED) from None
    return path


@styled
def save_figures(
    folder: str | Path,
    figures: Mapping[str, Figure],
    kinds: Sequence[str] = KINDS,
    dots: float = _DOTS,
) -> tuple[Path, ...]:
    """Write figures; all of them are drawn before the first file appears.

    Args:
        folder: Made if it is not there.
        figures: By name, which becomes the files' name.
        kinds: Of :data:`KINDS`.
        dots: Of images, per inch.

    Returns:
        The files, in the order of the figures.

    Raises:
        InputError: If the folder cannot be made or written to.
    """
    home, files = figure_folder(folder), []
    try:
        with ExitStack() as finished:
            for name, figure in figures.items():
                for kind in kinds:
                    file = home / f"{name}.{kind}"
                    beside = finished.enter_context(written_beside(file))
                    figure.savefig(beside, format=kind, dpi=dots, metadata=_UNDATED[kind])
                    files.append(file)
    except InputError as error:
        raise InputError("plots", error.problem, _ACCEPTED) from None
    return tuple(files)
