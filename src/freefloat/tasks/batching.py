"""The work of ``batch``: cases run as far as they are not done, then tables, figure and page."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from freefloat.cli.console import case_progress
from freefloat.errors import FreeFloatError, InputError, ModelError
from freefloat.io.scenario import parse_scenario
from freefloat.motion.problem import Problem
from freefloat.studies.files import StudyFiles
from freefloat.studies.folder import JOURNAL, StudyFolder, finished_rows, study_folder
from freefloat.studies.result import ERROR, finite
from freefloat.studies.schema import Case
from freefloat.studies.study import Study
from freefloat.studies.summary import study_summary
from freefloat.tasks.warm_up import warm_up, warm_up_branches

_START_UP = 3.0
"""Seconds until workers on this machine are there; on a busy one it is twice as long."""
_TRIED = 20
"""Cases looked at for one that can be built."""


@dataclass(frozen=True)
class Wishes:
    """What the command line says of a batch.

    Attributes:
        output: The folder.
        workers: How many processes to start, or None for one a core.
        scheduler: Address of a Dask scheduler to use instead, or None.
        report: Whether to write the page.
    """

    output: Path | None = None
    workers: int | None = None
    scheduler: str | None = None
    report: bool = False

    def __post_init__(self) -> None:
        if self.workers is not None and self.scheduler is not None:
            problem = "--scheduler was given, too: it has workers of its own"
            raise InputError("workers", problem, "one of the two")


def run_study(
    study: Study,
    output: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    report: bool = False,
) -> dict[str, Any]:
    """Run the cases of a study that are not done yet, side by side.

    Scripts that call this keep their own work under ``if __name__ == "__main__":``, because every
    worker reads the script once more.

    Args:
        study: As :func:`~freefloat.studies.study.load_study` reads it.
        output: Folder for the journal, the tables and the figure; in a folder of the same study
            the rest of it is done.
        workers: How many processes to start; one a core when left out.
        scheduler: Address of a Dask scheduler whose workers are used instead.
        report: Whether to write a page, too.

    Returns:
        The summary: counts, shares, spreads, and the files written.

    Raises:
        InputError: If the study cannot be run, or the folder not be written to.
    """
    return study_document(study, Wishes(Path(output), workers, scheduler, report))


def study_document(study: Study, wishes: Wishes) -> dict[str, Any]:
    """Run the cases that are not done yet; what ``batch`` answers.

    Raises:
        InputError: If the study cannot be run, or the folder not be written to.
    """
    if wishes.output is None:
        raise InputError(
            "output", "it is missing", "-o DIR, a folder for the results; or --dry-run"
        )
    begin, files = time.perf_counter(), StudyFiles.of(study)
    with study_folder(wishes.output, study, files) as folder:
        missing = folder.missing
        if missing:
            _run(folder, files, missing, wishes)
        summary = study_summary(study, folder.rows)
        written = _conclude(folder, summary, wishes.report)
    return {
        **summary,
        "output": str(wishes.output),
        "computed": len(missing),
        "reused": study.count - len(missing),
        "seconds": time.perf_counter() - begin,
        "files": written,
    }


def _run(folder: StudyFolder, files: StudyFiles, missing: Sequence[int], wishes: Wishes) -> None:
    study = folder.study
    problem = _first_problem(study, missing)
    if wishes.scheduler is None and problem is not None:
        _warm(study, problem)  # else every worker would compile for itself
    from freefloat.studies.runner import run_cases  # Dask takes most of a second to import

    results = run_cases(study, files, missing, workers=wishes.workers, scheduler=wishes.scheduler)
    with case_progress(study.count, study.count - len(missing)) as tell, closing(results):
        for result in results:
            folder.record(result)
            tell(result.row["verdict"] == ERROR)


def _first_problem(study: Study, numbers: Sequence[int]) -> Problem | None:
    """The problem of the first case that can be built.

    Raises:
        ModelError: If the robot is unfit, and the same in all cases.
    """
    same = not any(key.partition(".")[0] == "robot" for key in study.content.vary)
    for number in numbers[:_TRIED]:
        try:
            text = yaml.safe_dump(study.document(number), sort_keys=False)
            return parse_scenario(text, study.base_source).problem()
        except ModelError:
            if same:
                raise
        except FreeFloatError:
            continue
    return None


def _warm(study: Study, problem: Problem) -> None:
    if study.content.task is Case.SIMULATE:
        warm_up_branches(problem)
    else:
        warm_up(problem, threads=1)


def _conclude(
    folder: StudyFolder, summary: dict[str, Any], with_report: bool
) -> dict[str, str | None]:
    """Write what tells of all cases; the files by what they are."""
    from freefloat.studies.figure import drawn_columns, study_figure
    from freefloat.studies.report import save_report
    from freefloat.studies.table import save_table, study_table
    from freefloat.visualization.figure_style import save_figures

    table = study_table(folder.study, folder.rows)
    parquet, csv = save_table(folder.path, table)
    parameters = list(drawn_columns(table, list(folder.study.content.vary)))
    figure = study_figure(table, parameters)
    drawing, picture = save_figures(folder.path, {"summary": figure})
    page = None
    if with_report:
        page = save_report(folder.path, folder.study, summary, table, parameters, figure)
    written = {"journal": folder.path / JOURNAL, "parquet": parquet, "csv": csv,
               "figure": drawing, "picture": picture, "report": page}  # fmt: skip
    return {name: None if file is None else str(file) for name, file in written.items()}


def dry_run_document(study: Study, wishes: Wishes) -> dict[str, Any]:
    """The cases of a study, and how long they will take; two of them are run, where none was."""
    files = StudyFiles.of(study)
    rows = {} if wishes.output is None else finished_rows(wishes.output, study, files)
    missing = [number for number in range(study.count) if number not in rows]
    seconds = [row["seconds"] for row in rows.values() if row.get("seconds") is not None]
    from freefloat.studies.cluster import cores

    workers = None if wishes.scheduler is not None else wishes.workers or cores()
    each, timed = (sum(seconds) / len(seconds), "journal") if seconds else (None, None)
    start_up = 0.0 if wishes.scheduler is not None or not missing else _START_UP
    if each is None and missing:
        begin = time.perf_counter()
        each, timed = _timed(study, files, missing)
        start_up += max(0.0, time.perf_counter() - begin - 2.0 * (each or 0.0))
    side_by_side = min(workers or 1, cores(), len(missing) or 1)
    total = None if each is None else start_up + each * len(missing) / side_by_side
    return {
        "study": study.source,
        "base": str(study.base_source),
        "task": str(study.content.task),
        "count": study.count,
        "done": len(rows),
        "workers": workers,
        "seconds_each": each,
        "start_up_seconds": start_up,
        "timed": timed,
        "seconds": total,
        "cases": [{"case": number, "done": number in rows,
                   "parameters": finite(study.parameters(number))}
                  for number in range(study.count)],
    }  # fmt: skip


def _timed(study: Study, files: StudyFiles, missing: Sequence[int]) -> tuple[float | None, str]:
    """Seconds of the longer of two cases, kernels compiled before.

    They are the first that is answered, which may end early in a singularity, and one of the middle
    after it.
    """
    from freefloat.studies.run import CaseRunner

    problem = _first_problem(study, missing)
    if problem is not None:
        _warm(study, problem)
    with tempfile.TemporaryDirectory(prefix="freefloat-") as place:
        runner = CaseRunner(study, files.unpack(Path(place)))
        tried = []
        for number in missing[:_TRIED]:
            row = runner.run(number).row
            if row["verdict"] != ERROR:
                middle = missing[len(missing) // 2]
                again = runner.run(middle).row if middle > number else row
                if again is row or again["verdict"] == ERROR:
                    return row["seconds"], f"case {number}"
                longer = max(row["seconds"], again["seconds"])
                return longer, f"the longer of cases {number} and {middle}"
            tried.append(row)
    first = tried[0]
    told = f"none of the first cases can be answered, case {first['case']}: {first['error']}"
    return None, told
