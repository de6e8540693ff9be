"""One run of a study: a scenario in, a row of results and a result file out."""

from __future__ import annotations

import dataclasses
import math
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

from freefloat.errors import FreeFloatError, InputError
from freefloat.io.results import save
from freefloat.io.scenario import Scenario
from freefloat.motion.problem import Problem
from freefloat.planning.simulation import simulate
from freefloat.so3 import heading_quaternion
from freefloat.studies.row import ERROR, Row, finite, map_values, plan_values, simulation_values
from freefloat.studies.schema import Command
from freefloat.studies.study import Study, scenario_from

Files = tuple[tuple[str, bytes], ...]


@dataclass(frozen=True, eq=False)
class Run:
    """A run of a study, with all that a worker needs.

    Attributes:
        number: Number of the run.
        command: The command to execute.
        document: Data of the scenario file.
        source: The base scenario's file; relative names in the scenario are relative to its folder.
        start: Start of a simulation: attitude or heading_deg, and branch.
        parameters: The varied keys and their values.
        save: Whether to return the result file.
        files: Absolute paths and contents of the files that the scenario names; empty for a
            worker that reads them itself.
    """

    number: int
    command: Command
    document: dict[str, Any] = field(repr=False)
    source: Path
    start: dict[str, Any]
    parameters: dict[str, Any]
    save: bool = False
    files: Files = field(default=(), repr=False)

    @classmethod
    def of(cls, study: Study, number: int, files: Files = ()) -> Run:
        """Return a run of a study."""
        return cls(
            number, study.content.command, study.document(number), study.base_source.absolute(),
            study.start(number), study.parameters(number), study.content.files, files,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class RunResult:
    """Outcome of a run.

    Attributes:
        row: Its results.
        content: Bytes of its result file.
    """

    row: Row
    content: bytes | None = field(default=None, repr=False)


def error_result(run: Run, error: BaseException | str) -> RunResult:
    """Return the result of a run that ended in an error."""
    message = " ".join(str(error).split())
    if not isinstance(error, FreeFloatError | str):
        message = f"{type(error).__name__}: {message}".removesuffix(": ")
    return RunResult(Row(run.number, ERROR, run.parameters, error=message))


def execute(run: Run) -> RunResult:
    """Execute a run on one core; any error becomes its row."""
    began, begin = datetime.now(UTC).isoformat(timespec="milliseconds"), time.perf_counter()
    root = Path(_copies(run.files).name if run.files else "/")
    try:
        result = _execute(run, root / run.source.relative_to("/"))
    except Exception as error:
        result = error_result(run, error)
        if run.files:  # name the original files instead of their copies
            message = str(result.row.error).replace(str(root), "")
            result = RunResult(dataclasses.replace(result.row, error=message))
    row = dataclasses.replace(result.row, began=began, seconds=time.perf_counter() - begin)
    return RunResult(row, result.content)


@lru_cache(maxsize=2)
def _copies(files: Files) -> tempfile.TemporaryDirectory[str]:
    """Write copies of files below a temporary folder, each at its own path."""
    folder = tempfile.TemporaryDirectory(prefix="freefloat-")
    for path, content in files:
        copy = Path(folder.name) / Path(path).relative_to("/")
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(content)
    return folder


def _execute(run: Run, source: Path) -> RunResult:
    source.parent.mkdir(parents=True, exist_ok=True)  # for names that begin with ..
    scenario = scenario_from(run.document, source)
    problem = scenario.problem()
    execute_command = {Command.PLAN: _plan, Command.MAP: _map, Command.SIMULATE: _simulate}
    record, values = execute_command[run.command](run, scenario, problem)
    content = None
    if run.save:
        with tempfile.TemporaryDirectory(prefix="freefloat-") as folder:
            file = Path(folder) / "result.h5"
            save(record, file)
            content = file.read_bytes()
    return RunResult(Row(run.number, parameters=run.parameters, **finite(values)), content)


def _simulate(run: Run, scenario: Scenario, problem: Problem) -> tuple[Any, dict[str, Any]]:
    attitude, branch = _attitude(problem, run.start), run.start.get("branch")
    simulation = simulate(problem, attitude, branch=branch, limits=scenario.limits())
    return simulation, simulation_values(simulation)


def _attitude(problem: Problem, start: Mapping[str, Any]) -> Any:
    if "heading_deg" not in start:
        return start["attitude"]
    heading = start["heading_deg"]
    if not problem.task.planar:
        raise InputError("heading_deg", f"task {problem.task} is not planar", "attitude")
    if not isinstance(heading, int | float) or not math.isfinite(heading):
        raise InputError("heading_deg", f"{heading} was given", "a finite number of degrees")
    return heading_quaternion(math.radians(heading))


def _plan(_: Run, scenario: Scenario, problem: Problem) -> tuple[Any, dict[str, Any]]:
    from freefloat.planning.planner import plan

    with scenario.error_context():
        limits = scenario.limits(problem.model)
        result = plan(problem, scenario.search(), limits, threads=1)
    return result, plan_values(result)


def _map(_: Run, scenario: Scenario, problem: Problem) -> tuple[Any, dict[str, Any]]:
    from freefloat.planning.mapping import attitude_map

    search = scenario.search()
    with scenario.error_context():
        result = attitude_map(problem, search.samples, seed=search.seed, threads=1)
    return result, map_values(result)
