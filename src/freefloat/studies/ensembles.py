"""Rows of the runs that ensembles decide, many at a time."""

from __future__ import annotations

import time
from collections.abc import Iterator
from datetime import UTC, datetime
from itertools import compress

import numpy as np

from freefloat.concurrency import available_cores
from freefloat.ensemble.disturbed_verdicts import ManyMotions
from freefloat.ensemble.endings import DECIDERS
from freefloat.ensemble.known_limits import LimitValues
from freefloat.kinds import STUDY_COMMANDS, named
from freefloat.limits.kinds import KINDS
from freefloat.motion.motion import Ending
from freefloat.robot.model import range_ratios
from freefloat.so3 import Array, BoolArray, IntArray
from freefloat.studies.columns import (
    FEASIBLE,
    INFEASIBLE,
    LIMITING,
    LIMITS_REASON,
    MARGIN_LIMITS,
    MARGIN_REASON,
    NUMBER,
    SINGULARITY_LIMITS,
    UNCHECKED,
    Column,
    Columns,
    family,
)
from freefloat.studies.disturbances import NO_ROWS, Chunk, group_numbers
from freefloat.studies.groups import Group, grouped
from freefloat.studies.study import Study
from freefloat.studies.workers import PortableStudy

CHUNK = 4096
"""Runs that are integrated and stored together."""
_SLOW_CHUNK = 64
"""Runs of a chunk with limits that are checked one motion after the other."""


def chunks(study: Study, missing: IntArray) -> Iterator[Chunk]:
    """Yield the missing runs, numbers ascending, that are computed side by side, some at a time."""
    if module := STUDY_COMMANDS.get(study.content.command):
        yield from named(f"{module}:chunks")(study, missing)
        return
    size = _SLOW_CHUNK if study.has_slow_limits else CHUNK
    groups = group_numbers(study)
    _, first_runs = np.unique(groups, return_index=True)
    first_of = dict(zip(groups[first_runs].tolist(), first_runs.tolist(), strict=True))
    missing = missing[groups[missing] >= 0]
    for some in np.split(missing, np.flatnonzero(np.diff(missing // size)) + 1):
        for number in np.unique(groups[some]).tolist():
            yield Chunk(first_of[number], some[groups[some] == number])


def computed(study: PortableStudy, chunk: Chunk, threads: int | None = None) -> Columns:
    """Compute the runs of a chunk; return the rows of the runs that are decided.

    Args:
        study: The study.
        chunk: The runs.
        threads: Number of threads; default is one per core.
    """
    if module := STUDY_COMMANDS.get(study.study.content.command):
        columns: Columns = named(f"{module}:computed")(study, chunk, threads)
        return columns
    group, _ = grouped(study.here, chunk.first)
    if group is None:
        return NO_ROWS
    began, begin = datetime.now(UTC).isoformat(timespec="milliseconds"), time.perf_counter()
    threads = threads or available_cores()
    numbers, motions = group.integrate(chunk.numbers, threads)
    decided = group.are_decided(motions)
    each = (time.perf_counter() - begin) * threads / len(chunk.numbers)  # of a core
    numbers, motions = numbers[decided], _selected(motions, decided)
    columns = {NUMBER: numbers, **_columns(group, motions)}
    return columns | {"seconds": np.full(len(numbers), each), "began": [began] * len(numbers)}


def _selected(motions: ManyMotions, chosen: BoolArray) -> ManyMotions:
    arrays = {name: array[chosen] for name, array in vars(motions).items() if name != "limits"}
    limits = LimitValues._make(array[chosen] for array in motions.limits)
    return ManyMotions(**arrays, limits=limits)


def _columns(group: Group, motions: ManyMotions) -> dict[str, Column]:
    """Results of decided motions by column."""
    feasible, completed = group.are_feasible(motions), motions.completed
    reasons = np.where(completed, MARGIN_REASON, Ending.SINGULAR.value)
    ratios = np.where(completed[:, None], motions.limits.ratios, np.nan)
    violated = ratios > 1.0
    codes = violated @ (1 << np.arange(len(group.limit_names)))
    _, first, which = np.unique(codes, return_index=True, return_inverse=True)
    order = [kind.name for kind in KINDS]  # as for motions
    sets = (sorted(compress(group.limit_names, row), key=order.index)
            for row in violated[first].tolist())  # fmt: skip
    limits = np.array([LIMITS_REASON.format(", ".join(names)) for names in sets])
    reasons = np.where(motions.feasible, limits[which], reasons)
    columns: dict[str, Column] = {
        "verdict": np.where(feasible, FEASIBLE, INFEASIBLE),
        "reason": np.where(feasible, "", reasons),
        "measure": [group.problem.margin.measure.name] * len(motions),
        "margin": motions.minimum_margins,
        "margin_time": motions.minimum_times,
        "margin_required": motions.thresholds,
        "completed": completed,
        "singular_time": np.where(motions.singular, motions.ended_at, np.nan),
        "branch": motions.branches,
        **family("attitude", dict(zip("xyzw", motions.attitudes.T, strict=True))),
        **family("joints", dict(enumerate(motions.joints.T))),
        "decided_by": np.array(DECIDERS)[motions.deciders],
    }
    columns |= _extremes(group, motions) | _limiting(group, motions)
    if group.problem.has_headings:
        headings = map(group.problem.plane.heading, motions.attitudes)
        columns["heading_deg"] = np.degrees([*headings])
    if group.study.contact_unchecked is not None:
        columns["contact"] = [UNCHECKED] * len(motions)
    if group.limit_names:
        kept, known = (values.tolist() for values in group.keep_limits(motions))
        columns["limits_kept"] = [
            one if certain else None for one, certain in zip(kept, known, strict=True)
        ]
        columns |= family("limits", dict(zip(group.limit_names, ratios.T, strict=True)))
    return columns


def _extremes(group: Group, motions: ManyMotions) -> dict[str, Column]:
    """Final attitudes, and largest rates, turns and range ratios of motions that complete."""

    def of_completed(values: Array) -> Array:
        return np.where(motions.completed, values.T, np.nan)

    ranges = group.problem.model.joint_ranges
    bounded = np.flatnonzero(np.isfinite(ranges).any(axis=0))
    used = np.maximum(*range_ratios(ranges, motions.lower, motions.upper))
    used = of_completed(used)
    return {
        "base_rate": of_completed(motions.base_rates),
        "base_turn_deg": np.degrees(of_completed(motions.turns)),
        **family("final_attitude", dict(zip("xyzw", motions.final_attitudes.T, strict=True))),
        **family("joint_rates", dict(enumerate(of_completed(motions.rates)))),
        **family("range_ratios", {joint: used[joint] for joint in bounded}),
    }


def _limiting(group: Group, motions: ManyMotions) -> dict[str, Column]:
    """What is nearest to its bound along each motion, or farthest beyond it, and when."""
    with np.errstate(divide="ignore", invalid="ignore"):
        margin = (motions.thresholds / motions.minimum_margins)[:, None]
    limits = motions.limits
    ratios = np.hstack([margin, limits.ratios])
    times = np.hstack([motions.minimum_times[:, None], limits.times])
    places = np.hstack([np.zeros((len(motions), 1), int), limits.places])
    largest = np.where(np.isnan(ratios), -np.inf, ratios).argmax(axis=1)
    rows = np.arange(len(motions))
    names = [[MARGIN_LIMITS]] + [
        [LIMITING.format(name, place) for place in of_limit]
        for name, of_limit in zip(group.limit_names, group.limit_places, strict=True)
    ]
    limiting = [
        names[limit][place]
        for limit, place in zip(largest.tolist(), places[rows, largest].tolist(), strict=True)
    ]
    return {
        "limiting": np.where(motions.singular, SINGULARITY_LIMITS, limiting).tolist(),
        "limiting_time": np.where(motions.singular, motions.ended_at, times[rows, largest]),
    }
