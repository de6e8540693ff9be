"""Chunks of runs that are computed side by side, by the command of the study."""

from __future__ import annotations

from collections.abc import Iterator

from freefloat.so3 import IntArray
from freefloat.studies import ensembles
from freefloat.studies.columns import Columns
from freefloat.studies.ensembles import Chunk, integrated
from freefloat.studies.portable import PortableStudy
from freefloat.studies.study import Command, Study

_SLOW_CHUNK = 64
"""Runs of a chunk where bodies are compared, which takes far longer than all else."""


def chunks(study: Study, groups: IntArray, missing: IntArray) -> Iterator[Chunk]:
    """Yield the missing runs that are computed side by side, some at a time.

    Args:
        study: The study.
        groups: Number of the group of each run, see :func:`.run_values.group_numbers`.
        missing: Numbers of runs, ascending.
    """
    if study.content.command is Command.TRACK:
        from freefloat.studies.track_runs import track_chunks  # imports slowly

        return track_chunks(study, missing)
    size = _SLOW_CHUNK if study.compares_bodies else ensembles.CHUNK
    return ensembles.chunks(groups, missing, size)


def computed(study: PortableStudy, chunk: Chunk, threads: int | None = None) -> Columns:
    """Compute the runs of a chunk; return the rows of those that are decided.

    Args:
        study: The study.
        chunk: The runs.
        threads: Number of threads; default is one per core.
    """
    if study.study.content.command is Command.TRACK:
        from freefloat.studies.track_runs import tracked

        return tracked(study, chunk, threads)
    return integrated(study, chunk, threads)
