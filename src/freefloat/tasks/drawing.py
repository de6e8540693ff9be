"""The work of ``--plots``: figures drawn and saved; matplotlib comes only where it is wanted."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from freefloat.cli.console import progress_bar
from freefloat.planning.plan import Plan

if TYPE_CHECKING:
    from freefloat.planning.attitude_map import AttitudeMap
    from freefloat.planning.heading_map import HeadingMap


def refuse_bad_folder(folder: Path | None) -> None:
    """Make the folder for figures before the work, or say why that cannot be.

    Raises:
        InputError: If it cannot be made or written to.
    """
    if folder is not None:
        from freefloat.visualization.figure_style import figure_folder

        figure_folder(folder)


def draw(
    folder: Path | None, result: Plan | AttitudeMap | HeadingMap, threads: int | None = None
) -> dict[str, Any]:
    """Draw a plan or a map; what is added to its document, nothing without a folder."""
    if folder is None:
        return {}
    from freefloat.visualization.figure_style import save_figures
    from freefloat.visualization.figures import figures

    with progress_bar("drawing") as progress:
        files = save_figures(folder, figures(result, threads=threads, progress=progress))
    return {"plots": [str(file) for file in files]}


def save_plan_page(file: Path | None, plan: Plan, scenario: str) -> dict[str, Any]:
    """Write the page of a plan's motion.

    Args:
        file: Where; None for no page.
        plan: The plan.
        scenario: Its name, the title.

    Returns:
        What is added to the plan's document: ``html``, the file, or None without a motion.

    Raises:
        InputError: If the file cannot be written.
    """
    if file is None:
        return {}
    if plan.chosen is None:
        return {"html": None}
    from freefloat.visualization.playback import (
        playback,  # MeshCat takes a third of a second to import
    )

    playback({f"{scenario}, {plan.chosen.branch.label}": plan.chosen.motion}, scenario).save(file)
    return {"html": str(file)}


def page_lines(document: Mapping[str, Any]) -> list[str]:
    """The line of the table that names the page."""
    if "html" not in document:
        return []
    return [f"Page: {document['html'] or 'none, there is no motion to show'}"]
