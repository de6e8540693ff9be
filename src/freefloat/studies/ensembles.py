"""Rows of the runs that ensembles decide, many at a time."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from datetime import UTC, datetime
from typing import Any

import numpy as np

from freefloat.ensemble.endings import DECIDERS
from freefloat.ensemble.many_motions import ManyMotions
from freefloat.motion.motion import Ending
from freefloat.so3 import Array, IntArray, heading_of
from freefloat.studies.groups import Group, group_of
from freefloat.studies.row import FEASIBLE, INFEASIBLE
from freefloat.studies.study import Study
from freefloat.studies.values import MARGIN_REASON

_CHUNK = 4096
"""Runs that are integrated and stored together."""
Columns = Mapping[str, Sequence[Any]]
"""Rows by column as the database stores them."""


def decided_rows(
    study: Study, groups: IntArray, missing: IntArray, threads: int
) -> Iterator[Columns]:
    """Integrate missing runs and yield the rows of those that are decided, chunk by chunk.

    Args:
        study: The study.
        groups: Number of the group of each run, see :func:`.run_values.group_numbers`.
        missing: Numbers of the runs, ascending.
        threads: Number of threads.
    """
    with ThreadPoolExecutor(1) as ahead:  # integrates a chunk while rows of the last are written
        integrated: Future[Columns] | None = None
        for group, numbers in _chunks(study, groups, missing):
            following = ahead.submit(_rows, group, numbers, threads)
            if integrated is not None:
                yield integrated.result()
            integrated = following
        if integrated is not None:
            yield integrated.result()


def _chunks(study: Study, groups: IntArray, missing: IntArray) -> Iterator[tuple[Group, IntArray]]:
    """Groups and the numbers of their missing runs, some at a time."""
    _, first_runs = np.unique(groups, return_index=True)
    first_of = dict(zip(groups[first_runs].tolist(), first_runs.tolist(), strict=True))
    for chunk in np.split(missing, np.flatnonzero(np.diff(missing // _CHUNK)) + 1):
        for number in np.unique(groups[chunk]).tolist():
            group = group_of(study, first_of[number]) if number >= 0 else None
            if group is not None:
                yield group, chunk[groups[chunk] == number]


def _rows(group: Group, numbers: IntArray, threads: int) -> Columns:
    """Integrate runs of a group; return the rows of those that are decided."""
    began, begin = datetime.now(UTC).isoformat(timespec="milliseconds"), time.perf_counter()
    numbers, motions = group.integrate(numbers, threads)
    decided = np.flatnonzero(group.are_decided(motions))
    each = (time.perf_counter() - begin) / max(len(numbers), 1)
    columns = _columns(group, numbers, motions, decided)
    columns["seconds"], columns["began"] = [each] * len(decided), [began] * len(decided)
    return columns


def _columns(
    group: Group, numbers: IntArray, motions: ManyMotions, decided: IntArray
) -> dict[str, Sequence[Any]]:
    feasible, completed, singular = (
        values[decided] for values in (motions.feasible, motions.completed, motions.singular)
    )
    reasons = np.where(completed, MARGIN_REASON, Ending.SINGULAR.value)
    attitudes, times = motions.attitudes[decided], motions.ended_at[decided]
    columns: dict[str, Sequence[Any]] = {
        "number": numbers[decided].tolist(),
        "verdict": np.where(feasible, FEASIBLE, INFEASIBLE).tolist(),
        "parameters": _parameters(group.study, numbers[decided]),
        "reason": np.where(feasible, "", reasons).tolist(),
        "measure": [group.problem.margin.measure.name] * len(decided),
        "margin": motions.minimum_margins[decided].tolist(),
        "margin_time": motions.minimum_times[decided].tolist(),
        "margin_required": motions.thresholds[decided].tolist(),
        "completed": completed.astype(int).tolist(),
        "singular_time": [
            t if end else None for t, end in zip(times.tolist(), singular.tolist(), strict=True)
        ],
        "branch": motions.branches[decided].tolist(),
        "attitude": _texts(attitudes),
        "joints": _texts(motions.joints[decided]),
        "limits": ["{}"] * len(decided),
        "decided_by": [DECIDERS[k] for k in motions.deciders[decided].tolist()],
    }
    if group.problem.task.planar:
        columns["heading_deg"] = np.degrees([heading_of(a) for a in attitudes]).tolist()
    if group.ranges:
        ratios = group.ratios_of_ranges(motions)[decided]
        texts = json.dumps(ratios.tolist())[1:-1].split(", ")
        columns["limits_kept"] = [1 if kept else None for kept in feasible.tolist()]
        columns["limits"] = [
            f'{{"joint_range": {text}}}' if kept else "{}"
            for text, kept in zip(texts, feasible.tolist(), strict=True)
        ]
    return columns


def _parameters(study: Study, numbers: IntArray) -> list[str]:
    """The varied keys and their values in runs, as JSON texts."""
    if not len(numbers):
        return []
    first, places = int(numbers[0]), (numbers - numbers[0]).tolist()
    values = study.variation.values(first, int(numbers[-1]) + 1 - first)
    names = [json.dumps(key) for key in values]
    columns = [_texts(column) if isinstance(column, np.ndarray) else list(map(json.dumps, column))
               for column in values.values()]  # fmt: skip
    texts = [", ".join(map(": ".join, zip(names, row, strict=True)))
             for row in zip(*columns, strict=True)]  # fmt: skip
    return [f"{{{texts[place]}}}" for place in places]


def _texts(array: Array) -> list[str]:
    """Rows of an array as JSON texts, numbers or lists."""
    if not len(array):
        return []
    if len(array) > 1 and (array == array[0]).all():  # such as the same attitude of all runs
        return _texts(array[:1]) * len(array)
    text = json.dumps(array.tolist())
    if array.ndim == 1:
        return text[1:-1].split(", ")
    return [f"[{row}]" for row in text[2:-2].split("], [")]
