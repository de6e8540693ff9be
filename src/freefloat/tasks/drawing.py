"""The work of ``--plots``: figures drawn and saved; matplotlib comes only where it is wanted."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from freefloat.cli.console import progress_bar
from freefloat.motion.problem import Problem
from freefloat.planning.plan import Plan

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from freefloat.ensemble.feasibility import FeasibilityEvaluator
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


def draw_plan(folder: Path | None, plan: Plan, threads: int | None = None) -> dict[str, Any]:
    """Draw a plan; what is added to its document, nothing without a folder."""
    if folder is None:
        return {}
    from freefloat.visualization.figures import plan_figures

    with progress_bar("drawing") as progress:
        return _saved(folder, plan_figures(plan, progress, threads=threads))


def draw_heading_map(folder: Path | None, problem: Problem, found: HeadingMap) -> dict[str, Any]:
    """Draw a map over heading; as :func:`draw_plan`."""
    if folder is None:
        return {}
    from freefloat.visualization.figures import heading_map_figures

    return _saved(folder, heading_map_figures(problem, found))


def draw_attitude_map(
    folder: Path | None,
    outlook: FeasibilityEvaluator,
    found: AttitudeMap,
    document: Mapping[str, Any],
) -> dict[str, Any]:
    """Draw a map over all attitudes and what its document tells; as :func:`draw_plan`."""
    if folder is None:
        return {}
    from freefloat.planning.slices import told_marks
    from freefloat.visualization.figures import attitude_map_figures

    with progress_bar("drawing") as progress:
        figures = attitude_map_figures(found, outlook, told_marks(document), progress)
        return _saved(folder, figures)


def _saved(folder: Path, figures: dict[str, Figure]) -> dict[str, Any]:
    from freefloat.visualization.figure_style import save_figures

    return {"plots": [str(file) for file in save_figures(folder, figures)]}
