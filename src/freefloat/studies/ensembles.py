"""Rows of the runs that ensembles decide, many at a time."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from itertools import compress
from typing import Any

import numpy as np

from freefloat.concurrency import available_cores
from freefloat.ensemble.disturbed_verdicts import ManyMotions
from freefloat.ensemble.endings import DECIDERS
from freefloat.kinds import STUDY_COMMANDS, named
from freefloat.limits.kinds import KINDS
from freefloat.motion.motion import Ending
from freefloat.robot.model import range_ratios
from freefloat.so3 import Array, IntArray
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
    """Yield the missing runs that are computed side by side, some at a time.

    Args:
        study: The study.
        missing: Numbers of runs, ascending.
    """
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
    decided = np.flatnonzero(group.are_decided(motions))
    each = (time.perf_counter() - begin) * threads / len(chunk.numbers)  # of a core
    columns = {NUMBER: numbers[decided], **_columns(group, motions, decided)}
    return columns | {"seconds": np.full(len(decided), each), "began": [began] * len(decided)}


def _columns(group: Group, motions: ManyMotions, decided: IntArray) -> dict[str, Column]:
    """Results of decided motions by column."""
    margin_kept, completed, singular = (
        values[decided] for values in (motions.feasible, motions.completed, motions.singular)
    )
    feasible = group.are_feasible(motions)[decided]
    reasons = np.where(completed, MARGIN_REASON, Ending.SINGULAR.value)
    ratios = np.where(completed[:, None], motions.limits.ratios[decided], np.nan)
    violated = ratios > 1.0
    codes = violated @ (1 << np.arange(len(group.limit_names)))
    _, first, which = np.unique(codes, return_index=True, return_inverse=True)
    order = [kind.name for kind in KINDS]  # as for motions
    sets = (sorted(compress(group.limit_names, row), key=order.index)
            for row in violated[first].tolist())  # fmt: skip
    limits = np.array([LIMITS_REASON.format(", ".join(names)) for names in sets])
    reasons = np.where(margin_kept, limits[which], reasons)
    attitudes, joints = motions.attitudes[decided], motions.joints[decided]
    columns: dict[str, Column] = {
        "verdict": np.where(feasible, FEASIBLE, INFEASIBLE),
        "reason": np.where(feasible, "", reasons),
        "measure": [group.problem.margin.measure.name] * len(decided),
        "margin": motions.minimum_margins[decided],
        "margin_time": motions.minimum_times[decided],
        "margin_required": motions.thresholds[decided],
        "completed": completed,
        "singular_time": np.where(singular, motions.ended_at[decided], np.nan),
        "branch": motions.branches[decided],
        **{f"attitude.{axis}": column for axis, column in zip("xyzw", attitudes.T, strict=True)},
        **{f"joints.{index}": column for index, column in enumerate(joints.T)},
        "decided_by": np.array(DECIDERS)[motions.deciders[decided]],
    }
    columns |= _extremes(group, motions, decided) | _limiting(group, motions, decided)
    if group.problem.has_headings:
        plane = group.problem.plane
        columns["heading_deg"] = np.degrees([plane.heading(attitude) for attitude in attitudes])
    if group.study.contact_unchecked is not None:
        columns["contact"] = [UNCHECKED] * len(decided)
    if group.limit_names:
        names = [f"limits.{name}" for name in group.limit_names]
        kept, known = (values[decided].tolist() for values in group.keep_limits(motions))
        columns["limits_kept"] = [
            one if certain else None for one, certain in zip(kept, known, strict=True)
        ]
        columns |= dict(zip(names, ratios.T, strict=True))
    return columns


def _extremes(group: Group, motions: ManyMotions, decided: IntArray) -> dict[str, Column]:
    """Final attitudes, and largest rates, turns and range ratios of motions that complete."""
    completed = motions.completed[decided]

    def of_completed(values: Array) -> Array:
        return np.where(completed, values[decided].T, np.nan)

    ranges = group.problem.model.joint_ranges
    bounded = np.flatnonzero(np.isfinite(ranges).any(axis=0))
    used = np.maximum(*range_ratios(ranges, motions.lower, motions.upper))
    families: dict[str, Iterable[tuple[Any, Array]]] = {
        "final_attitude": zip("xyzw", motions.final_attitudes[decided].T, strict=True),
        "joint_rates": enumerate(of_completed(motions.rates)),
        "range_ratios": zip(bounded, of_completed(used)[bounded], strict=True),
    }
    named = {f"{name}.{k}": column for name, columns in families.items() for k, column in columns}
    turns = np.degrees(of_completed(motions.turns))
    return {"base_rate": of_completed(motions.base_rates), "base_turn_deg": turns, **named}


def _limiting(group: Group, motions: ManyMotions, decided: IntArray) -> dict[str, Column]:
    """What is nearest to its bound along each motion, or farthest beyond it, and when."""
    with np.errstate(divide="ignore", invalid="ignore"):
        margin = (motions.thresholds / motions.minimum_margins)[decided, None]
    limits = motions.limits
    ratios = np.hstack([margin, limits.ratios[decided]])
    times = np.hstack([motions.minimum_times[decided, None], limits.times[decided]])
    places = np.hstack([np.zeros((len(decided), 1), int), limits.places[decided]])
    largest = np.where(np.isnan(ratios), -np.inf, ratios).argmax(axis=1)
    rows = np.arange(len(decided))
    names = [[MARGIN_LIMITS]] + [
        [LIMITING.format(name, place) for place in of_limit]
        for name, of_limit in zip(group.limit_names, group.limit_places, strict=True)
    ]
    limiting = [
        names[limit][place]
        for limit, place in zip(largest.tolist(), places[rows, largest].tolist(), strict=True)
    ]
    singular = motions.singular[decided]
    return {
        "limiting": np.where(singular, SINGULARITY_LIMITS, limiting).tolist(),
        "limiting_time": np.where(singular, motions.ended_at[decided], times[rows, largest]),
    }
