"""Rows of runs of the command track, those that follow the same motion side by side."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from freefloat.beyond.engines.tracking import Tracking, track_many
from freefloat.concurrency import available_cores
from freefloat.errors import FreeFloatError
from freefloat.planning.plan import Plan
from freefloat.planning.simulation import Simulation
from freefloat.so3 import IntArray
from freefloat.studies.columns import FEASIBLE, INFEASIBLE, MARGIN_REASON, NUMBER, Columns, finite
from freefloat.studies.disturbances import NO_ROWS, Chunk
from freefloat.studies.run import computed_record, motion_values, record_values
from freefloat.studies.study import Study
from freefloat.studies.study_file import TRACK, Command
from freefloat.studies.workers import PortableStudy

_FEWEST, _CHUNK = 8, 256
"""Smallest and largest number of runs that are simulated together."""


def chunks(study: Study, missing: IntArray) -> Iterator[Chunk]:
    """Yield missing runs that follow the same motion with the same period, some at a time.

    Runs of small groups are left out.

    Args:
        study: A study with the command track.
        missing: Numbers of the runs, ascending.
    """
    groups: dict[tuple[str, float], list[int]] = {}
    for number in missing.tolist():
        key = json.dumps(study.inputs(number)), _arguments(study, number)["period"]
        groups.setdefault(key, []).append(number)
        if len(groups[key]) == _CHUNK:
            yield _chunk(groups.pop(key))
    yield from (_chunk(numbers) for numbers in groups.values() if len(numbers) >= _FEWEST)


def _chunk(numbers: list[int]) -> Chunk:
    return Chunk(numbers[0], np.array(numbers))


def values(study: Study, number: int) -> dict[str, Any]:
    """The values of one run."""
    inputs = json.dumps(study.inputs(number))
    followed = followed_motion(inputs, study.base_source.absolute())
    (values,) = _all_values(followed, [_arguments(study, number)])
    row: dict[str, Any] = finite(values)
    return row


def _arguments(study: Study, number: int) -> dict[str, Any]:
    """The arguments of :func:`.tracking.track` in a run."""
    items = study.parameters(number).items()
    varied = {key.removeprefix(TRACK): value for key, value in items if key.startswith(TRACK)}
    return study.content.track.model_dump() | varied


def computed(study: PortableStudy, chunk: Chunk, threads: int | None = None) -> Columns:
    """Simulate the runs of a chunk; return their rows, none if their motion is an error.

    Args:
        study: The study.
        chunk: The runs.
        threads: Number of threads; default is one per core.
    """
    here, threads = study.here, threads or available_cores()
    began, begin = datetime.now(UTC).isoformat(timespec="milliseconds"), time.perf_counter()
    arguments = {number: _arguments(here, number) for number in chunk.numbers.tolist()}
    try:
        inputs = json.dumps(here.inputs(chunk.first))
        followed = followed_motion(inputs, here.base_source.absolute())
        rows = [finite(values) for values in _all_values(followed, [*arguments.values()], threads)]
    except FreeFloatError:  # which is found again where the runs are executed one by one
        return NO_ROWS
    each = (time.perf_counter() - begin) * threads / len(rows)  # of a core
    for row in rows:
        row |= {"seconds": each, "began": began}
    return {NUMBER: [*arguments], **{name: [row[name] for row in rows] for name in rows[0]}}


@lru_cache(maxsize=8)
def followed_motion(inputs: str, source: Path) -> Plan | Simulation:
    """What the command track follows: a simulation from a start, else the plan of the first path.

    Inputs are arguments of :func:`computed_record` as JSON text, which many runs share; the source
    is the scenario's file.
    """
    arguments = json.loads(inputs)
    command = Command.SIMULATE if arguments["start"] else Command.PLAN
    record = computed_record(command, source, **arguments)
    followed: Plan | Simulation = getattr(record, "path", record)  # of a manoeuvre: its first path
    return followed


def _all_values(
    followed: Plan | Simulation, arguments: Sequence[dict[str, Any]], threads: int = 1
) -> list[dict[str, Any]]:
    """The values of runs in which controllers follow a motion; residuals are their errors.

    If the motion ends early, all runs have the values of the followed record.

    Args:
        followed: What to follow.
        arguments: Arguments of :func:`.tracking.track` of each run, with the same period.
        threads: Number of threads.
    """
    chosen = followed.chosen
    if chosen is None or not chosen.motion.completed:
        return [record_values(followed)] * len(arguments)
    columns: dict[str, Any] = {key: [run[key] for run in arguments] for key in arguments[0]}
    period, *_ = columns.pop("period")
    trackings = track_many(followed, **columns, period=period, threads=threads)
    motion = motion_values(chosen)
    return [motion | _tracking_values(tracking) for tracking in trackings]


def _tracking_values(tracking: Tracking) -> dict[str, Any]:
    reason = ""
    if not tracking.margin_kept:
        reason = MARGIN_REASON
    elif not tracking.on_path:
        reason = "The end-effector leaves the path."
    return {
        "verdict": INFEASIBLE if reason else FEASIBLE,
        "reason": reason,
        "margin": tracking.minimum_margin,
        "margin_time": tracking.margin_time,
        "residuals.end_effector_position": tracking.peak_position_error,
        "residuals.end_effector_attitude": tracking.peak_orientation_error,
        "residuals.final_position": tracking.final_position_error,
    }
