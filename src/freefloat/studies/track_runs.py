"""Rows of runs of the command track, those that follow the same motion side by side."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from datetime import UTC, datetime

import numpy as np

from freefloat.concurrency import available_cores
from freefloat.errors import FreeFloatError
from freefloat.so3 import IntArray
from freefloat.studies.columns import NUMBER, Columns, finite
from freefloat.studies.portable import PortableStudy
from freefloat.studies.records import followed_motion
from freefloat.studies.run_values import NO_ROWS, Chunk
from freefloat.studies.study import Study
from freefloat.studies.track_section import is_accepted
from freefloat.studies.values import tracking_values

_FEWEST, _CHUNK = 8, 256
"""Smallest and largest number of runs that are simulated together."""


def track_chunks(study: Study, missing: IntArray) -> Iterator[Chunk]:
    """Yield missing runs that follow the same motion with the same period, some at a time.

    Runs of small groups are left out.

    Args:
        study: A study with the command track.
        missing: Numbers of the runs, ascending.
    """
    groups: dict[tuple[str, float], list[int]] = {}
    for number in missing.tolist():
        key = json.dumps(study.inputs(number)), study.tracking(number)["period"]
        groups.setdefault(key, []).append(number)
        if len(groups[key]) == _CHUNK:
            yield _chunk(groups.pop(key))
    for numbers in groups.values():
        if len(numbers) >= _FEWEST:
            yield _chunk(numbers)


def _chunk(numbers: list[int]) -> Chunk:
    return Chunk(numbers[0], np.array(numbers))


def tracked(study: PortableStudy, chunk: Chunk, threads: int | None = None) -> Columns:
    """Simulate the runs of a chunk; return their rows, none if their motion is an error.

    Runs whose arguments are not accepted have no row: they are executed one by one.

    Args:
        study: The study.
        chunk: The runs.
        threads: Number of threads; default is one per core.
    """
    here, threads = study.here, threads or available_cores()
    began, begin = datetime.now(UTC).isoformat(timespec="milliseconds"), time.perf_counter()
    arguments = {number: here.tracking(number) for number in chunk.numbers.tolist()}
    arguments = {number: values for number, values in arguments.items() if is_accepted(values)}
    if not arguments:
        return NO_ROWS
    try:
        inputs = json.dumps(here.inputs(chunk.first))
        followed = followed_motion(inputs, here.base_source.absolute())
        rows = [
            finite(values) for values in tracking_values(followed, [*arguments.values()], threads)
        ]
    except FreeFloatError:  # which is found again where the runs are executed one by one
        return NO_ROWS
    each = (time.perf_counter() - begin) * threads / len(rows)  # of a core
    for row in rows:
        row |= {"seconds": each, "began": began}
    return {NUMBER: [*arguments], **{name: [row[name] for row in rows] for name in rows[0]}}
