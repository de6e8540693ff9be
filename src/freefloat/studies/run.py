"""One run of a study: a scenario in, a row of results and a result file out."""

from __future__ import annotations

import dataclasses
import math
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from freefloat.errors import FreeFloatError, InputError
from freefloat.io.results import save
from freefloat.io.scenario import Scenario
from freefloat.limits.check import LimitChecker
from freefloat.limits.limits import LimitResult
from freefloat.motion.motion import Ending
from freefloat.motion.problem import Problem
from freefloat.motion.simulation import SimulatedBranch, simulate
from freefloat.planning.planar_ranges import BranchRanges
from freefloat.so3 import heading_of, heading_quaternion
from freefloat.studies.schema import Command
from freefloat.studies.study import Study, scenario_from

FEASIBLE, INFEASIBLE, ERROR = "feasible", "infeasible", "error"
"""Verdicts."""


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


@dataclass(frozen=True)
class Row:
    """Results of a run; None where a command does not compute a value.

    Attributes:
        number: Number of the run.
        verdict: ``feasible``, ``infeasible`` or ``error``.
        parameters: The varied keys and their values.
        error: Message of the error that ended the run.
        reason: Why the run is infeasible, or why a plan's attitude was chosen.
        measure: Name of the singularity measure.
        margin: Minimum margin of the chosen motion; of a map the largest one.
        margin_time: Time of the closest approach [s].
        margin_required: Margin threshold.
        completed: Whether the motion reached the end of the path.
        singular_time: Time of the dynamic singularity [s].
        branch: Arm branch.
        attitude: Initial attitude, quaternion x, y, z, w.
        heading_deg: Initial heading [degrees].
        joints: Initial joint values [rad or m].
        residuals: Largest errors of the motion by quantity.
        limits_kept: Whether the motion keeps all limits.
        limits: Ratio of the largest value to the limit, by limit.
        robust_radius_deg: Attitude tolerance [degrees].
        deviation_deg: Angle from the attitude ``search.from_attitude`` [degrees].
        feasible_fraction: Fraction of attitudes with a feasible motion.
        motion_fraction: Fraction of feasible motions.
        attitude_ranges_deg: Feasible heading ranges by arm branch [degrees].
        seconds: Duration of the computation [s].
        began: When the computation started, UTC.
        file: Result file, relative to the study's folder.
        bytes: Its size.
    """

    number: int
    verdict: str
    parameters: dict[str, Any]
    error: str | None = None
    reason: str | None = None
    measure: str | None = None
    margin: float | None = None
    margin_time: float | None = None
    margin_required: float | None = None
    completed: bool | None = None
    singular_time: float | None = None
    branch: int | None = None
    attitude: list[float] | None = None
    heading_deg: float | None = None
    joints: list[float] | None = None
    residuals: dict[str, float] | None = None
    limits_kept: bool | None = None
    limits: dict[str, float] | None = None
    robust_radius_deg: float | None = None
    deviation_deg: float | None = None
    feasible_fraction: float | None = None
    motion_fraction: float | None = None
    attitude_ranges_deg: dict[str, list[list[float]]] | None = None
    seconds: float | None = None
    began: str | None = None
    file: str | None = None
    bytes: int | None = None


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
    with tempfile.TemporaryDirectory(prefix="freefloat-") as folder:
        file = Path(folder) / "result.h5" if run.save else None
        values = execute_command[run.command](run, scenario, problem, file)
        content = None if file is None else file.read_bytes()
    return RunResult(Row(run.number, parameters=run.parameters, **finite(values)), content)


def _simulate(run: Run, scenario: Scenario, problem: Problem, file: Path | None) -> dict[str, Any]:
    with scenario.error_context():
        checker = LimitChecker(problem, scenario.limits(problem.model))
    simulation = simulate(problem, _attitude(problem, run.start), branch=run.start.get("branch"))
    chosen = simulation.chosen
    limits = checker.results(chosen.motion)
    if file is not None:
        save(simulation, file)
    violated = [str(result.limit) for result in limits if not result.kept]
    reason = ""
    if not chosen.motion.completed:
        reason = chosen.motion.ending.value
    elif not problem.margin.is_kept(chosen.closest_approach.value):
        reason = "The margin is not kept."
    elif violated:
        reason = f"Limits are not kept: {', '.join(violated)}."
    verdict = INFEASIBLE if reason else FEASIBLE
    return {"verdict": verdict, "reason": reason, **_motion(chosen), **_limits(limits)}


def _attitude(problem: Problem, start: Mapping[str, Any]) -> Any:
    if "heading_deg" not in start:
        return start["attitude"]
    heading = start["heading_deg"]
    if not problem.task.planar:
        raise InputError("heading_deg", f"task {problem.task} is not planar", "attitude")
    if not isinstance(heading, int | float) or not math.isfinite(heading):
        raise InputError("heading_deg", f"{heading} was given", "a finite number of degrees")
    return heading_quaternion(math.radians(heading))


def _motion(chosen: SimulatedBranch) -> dict[str, Any]:
    motion, margin = chosen.motion, chosen.closest_approach
    attitude = motion.initial.attitude.tolist()
    in_plane = attitude[:2] == [0.0, 0.0]
    return {
        "completed": motion.completed,
        "measure": margin.measure,
        "margin": margin.value,
        "margin_time": margin.time,
        "margin_required": motion.problem.margin.threshold,
        "singular_time": motion.final.time if motion.ending is Ending.SINGULAR else None,
        "branch": chosen.branch.index,
        "attitude": attitude,
        "heading_deg": math.degrees(heading_of(attitude)) if in_plane else None,
        "joints": motion.initial.joints.tolist(),
        "residuals": dataclasses.asdict(motion.residuals()),
    }


def _limits(limits: Sequence[LimitResult]) -> dict[str, Any]:
    return {
        "limits_kept": all(result.kept for result in limits) if limits else None,
        "limits": {str(result.limit): result.ratio for result in limits},
    }


def _plan(_: Run, scenario: Scenario, problem: Problem, file: Path | None) -> dict[str, Any]:
    from freefloat.planning.planner import plan

    with scenario.error_context():
        limits = scenario.limits(problem.model)
        result = plan(problem, scenario.search(), limits, threads=1)
    if file is not None:
        save(result, file)
    fraction = None if result.map is None else result.map.feasible_fraction
    return {
        "verdict": FEASIBLE if result.feasible else INFEASIBLE,
        "reason": result.reason,
        **({"completed": False} if result.chosen is None else _motion(result.chosen)),
        **_limits(result.limit_results),
        "robust_radius_deg": _degrees(result.robust_radius),
        "deviation_deg": _degrees(result.deviation),
        "feasible_fraction": fraction,
        **_ranges(result.ranges),
    }


def _degrees(angle: float | None) -> float | None:
    return None if angle is None else float(np.degrees(angle))


def _ranges(branches: Sequence[BranchRanges]) -> dict[str, Any]:
    """Feasible heading ranges by branch, and the fraction of headings in any of them."""
    if not branches:
        return {}
    ranges = {str(entry.branch): entry.to_dict()["ranges"] for entry in branches}
    fraction, covered = 0.0, 0.0
    for low, high in sorted(span for spans in ranges.values() for span in spans):
        fraction += max(0.0, high - max(low, covered)) / 360.0
        covered = max(covered, high)
    return {"attitude_ranges_deg": ranges, "feasible_fraction": fraction}


def _map(_: Run, scenario: Scenario, problem: Problem, file: Path | None) -> dict[str, Any]:
    from freefloat.planning.mapping import attitude_map

    search, planar = scenario.search(), problem.task.planar
    with scenario.error_context():
        result = attitude_map(problem, search.samples, seed=search.seed, threads=1)
    if file is not None:
        save(result, file)
    document = result.to_dict()
    best, robust = document["best"] or {}, document["robust"] or {}
    feasible = result.feasible_fraction > 0.0 or bool(best and not planar)
    return {
        "verdict": FEASIBLE if feasible else INFEASIBLE,
        "reason": "" if feasible else "no attitude tried keeps the margin",
        "measure": None if planar else problem.margin.measure.name,
        "margin": best.get("value"),
        "margin_required": problem.margin.threshold,
        "branch": best.get("branch"),
        "attitude": best.get("attitude"),
        "heading_deg": best.get("heading_deg"),
        "robust_radius_deg": robust.get("radius_deg"),
        "feasible_fraction": result.feasible_fraction,
        "motion_fraction": document["motion_fraction"],
    }


def finite(value: Any) -> Any:
    """Replace numbers that JSON does not know by None."""
    if isinstance(value, dict):
        return {key: finite(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
