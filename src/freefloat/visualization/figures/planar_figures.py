"""The figure of planar problems over the initial heading."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from freefloat.ensemble.endings import LIMITED
from freefloat.ik.labels import branch_name, short_label
from freefloat.planning.margin_map import HeadingMap
from freefloat.planning.plane.arcs import BranchRanges
from freefloat.so3 import Array
from freefloat.visualization.figure_style import (
    BLACK,
    BLUE,
    COLUMN,
    GREY,
    MARGIN_LINE,
    axis_label,
    digits,
    legend_above,
    new_figure,
    styled,
)

_FEW = 2
"""Largest number of arm branches whose labels are written in full."""
_FEASIBLE = "#CFE3EF"


@styled
def headings_figure(
    result: HeadingMap,
    ranges: Sequence[BranchRanges] = (),
    chosen: tuple[int, float] | None = None,
) -> Figure:
    """The figure of the minimum margin over heading, with an axes per arm branch.

    Args:
        result: Map over headings.
        ranges: Feasible heading ranges; by default those of the map's samples.
        chosen: Branch and heading [rad] to mark.
    """
    curves = _curves(result, ranges)
    measure = result.problem.margin.measure
    figure = new_figure(COLUMN, 0.7 + 1.35 * len(curves))
    panels = figure.subplots(len(curves), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (branch, name, values, spans) in zip(panels, curves, strict=True):
        short = short_label(name) if len(curves) > _FEW else ""
        axes.plot(np.degrees(result.headings), values, color=BLUE, label=short or name)
        for number, (low, high) in enumerate(spans):
            label = "feasible" if number == 0 else None
            axes.axvspan(low, high, color=_FEASIBLE, linewidth=0.0, zorder=0, label=label)
        if (unreached := np.isnan(values)).any():
            axes.fill_between(
                np.degrees(result.headings), 0.0, 1.0, where=unreached, step="mid",
                transform=axes.get_xaxis_transform(), facecolor="white", edgecolor=GREY,
                hatch="////", linewidth=0.0, zorder=0, label="start out of reach",
            )  # fmt: skip
        margin = result.problem.margin.threshold
        if margin > 0.0:
            axes.axhline(margin, label=f"margin {digits(margin)}", **MARGIN_LINE)
        if chosen is not None and branch in (None, chosen[0]):
            axes.axvline(np.degrees(chosen[1]), color=BLACK, linestyle=":", label="chosen")
        axes.set_xlim(0.0, 360.0)
        axes.set_ylabel(axis_label(f"min |{measure.title}|", measure.unit))
        legend_above(axes, columns=3 if unreached.any() else None)
    panels[-1].set_xticks(np.arange(0, 361, 60))
    panels[-1].set_xlabel(axis_label("initial heading", "deg"))
    return figure


def _curves(
    result: HeadingMap, ranges: Sequence[BranchRanges]
) -> list[tuple[int | None, str, Array, list[list[float]]]]:
    """Branch, name, minimum margins and feasible ranges [deg] per axes."""
    motions = result.results.motions
    margins = np.where(motions.endings == LIMITED, motions.minimum, result.results.existing_margins)
    labels = result.branch_labels()
    if result.problem.redundant:
        ((_, best),) = result.by_branch(margins)
        spans = ranges[0].degrees if ranges else _sampled_spans(result, None)
        if ranges:  # others, which are followed to these headings, keep the margin there
            inside = np.array([ranges[0].depth(heading) > 0.0 for heading in result.headings])
            best = np.where(inside & ~result.problem.margin.keeps(best), np.nan, best)
        return [(None, "best start tried", best, spans)]
    known: dict[int | None, tuple[str, list[list[float]]]]
    known = {entry.branch: (branch_name(entry.label), entry.degrees) for entry in ranges}
    curves: list[tuple[int | None, str, Array, list[list[float]]]] = []
    for branch, values in result.by_branch(margins):
        sampled = branch_name(labels[branch]), _sampled_spans(result, branch)
        name, spans = known.get(branch, sampled)
        curves.append((branch, name, values, spans))
    return curves


def _sampled_spans(result: HeadingMap, branch: int | None) -> list[list[float]]:
    """Runs of feasible samples in [0, 360] deg, those across zero split in two."""
    spans = []
    for region in result.regions:
        if region.branch == branch:
            low = np.degrees(region.centre - region.radius) % 360.0
            high = low + np.degrees(region.size)
            spans += [[low, high]] if high <= 360.0 else [[0.0, high - 360.0], [low, 360.0]]
    return spans
