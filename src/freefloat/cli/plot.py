"""``freefloat plot``: figures of saved plans, motions and maps."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from freefloat.cli.console import Console
from freefloat.cli.options import Json, Quiet, Threads, distinct_stems
from freefloat.io.files import make_folder

if TYPE_CHECKING:
    from freefloat.motion.motion import Motion

_Files = Annotated[
    list[Path],
    typer.Argument(metavar="FILE", help="Files of plan, simulate, map or singularities."),
]
_Folder = Annotated[
    Path | None,
    typer.Option(
        *("--output", "-o"), metavar="DIR",
        help="Folder of the figures; default NAME_figures, NAME being that of the first file.",
    ),
]  # fmt: skip


def plot(
    files: _Files,
    output: _Folder = None,
    threads: Threads = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Draw the figures of saved plans, motions and maps, as PDF and PNG.

    Of several files each has a folder of its own, and a figure compares up to four motions.

    Example: freefloat plot plan.h5

    Example: freefloat plot feasible.h5 singular.h5 -o figures
    """
    from freefloat.io.records.results import load
    from freefloat.visualization.figure_style import save_figures
    from freefloat.visualization.figures.comparison_figure import comparison_figure
    from freefloat.visualization.figures.figures import figures

    results = {name: load(file) for name, file in zip(distinct_stems(files), files, strict=True)}
    console = Console(as_json, quiet)
    folder = output or Path(f"{files[0].stem}_figures")
    make_folder("output", folder)
    written: list[Path] = []
    motions: dict[str, Motion] = {}
    with console.progress("drawing") as progress:
        for name, result in results.items():
            place = folder / name if len(results) > 1 else folder
            written += save_figures(place, figures(result, threads=threads, progress=progress))
            moving = [p.shown_motion for p in getattr(result, "phases", ()) if p.motion is not None]
            if len(moving) == 1:
                motions[name] = moving[0]
        if len(motions) > 1:
            written += save_figures(folder, {"comparison": comparison_figure(motions)})
    names = [str(file) for file in written]
    console.tables(name for name in names if name.endswith(".png"))
    console.json({"figures": names})
