"""One run of a study: its result file, and the values of its row from the record of its command."""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from freefloat.ensemble.endings import DECIDERS, MOTION
from freefloat.errors import FreeFloatError, InputError
from freefloat.io.files import file_errors, written_beside
from freefloat.kinds import STUDY_COMMANDS, kind_of, named
from freefloat.limits.kinds.spacecraft import BaseRateLimit, BaseTurnLimit
from freefloat.limits.result import LimitResult, violated
from freefloat.motion.extrema import joint_extents, maximum
from freefloat.motion.motion import Ending
from freefloat.planning.simulation import Simulation, simulate
from freefloat.robot.model import range_ratios
from freefloat.so3 import degrees
from freefloat.studies.columns import (
    ERROR,
    FEASIBLE,
    INFEASIBLE,
    LIMITING,
    LIMITS_REASON,
    MARGIN_LIMITS,
    MARGIN_REASON,
    SINGULARITY_LIMITS,
    UNCHECKED,
    family,
    finite,
)
from freefloat.studies.rows import FILES, WRITABLE
from freefloat.studies.study import UNDISTURBED, Study
from freefloat.studies.study_file import Command, initial_attitude
from freefloat.studies.variation import error_of_study, scenario_from
from freefloat.studies.workers import PortableStudy

if TYPE_CHECKING:  # records of commands that few studies have
    from freefloat.planning.answer import Answer
    from freefloat.planning.margin_map import HeadingMap
    from freefloat.planning.motions import SimulatedBranch
    from freefloat.planning.plan import Plan
    from freefloat.planning.space.attitude_map import AttitudeMap


@dataclass(frozen=True, eq=False)
class RunResult:
    """Outcome of a run: its results by column, and the bytes of its result file."""

    number: int
    values: dict[str, Any]
    content: bytes | None = field(default=None, repr=False)

    def written(self, folder: Path) -> RunResult:
        """The result after its file was written in the folder of the study, and is named.

        Raises:
            InputError: If it cannot be written.
        """
        if self.content is None:
            return self
        name = f"{'undisturbed' if self.number == UNDISTURBED else f'{self.number:05d}'}.h5"
        file = folder / FILES / name
        with file_errors("output", folder / FILES, WRITABLE):
            file.parent.mkdir(exist_ok=True)
            with written_beside(file) as temporary:
                temporary.write_bytes(self.content)
        values = self.values | {"file": f"{FILES}/{name}", "bytes": len(self.content)}
        return replace(self, values=values, content=None)


def error_values(error: BaseException | str) -> dict[str, Any]:
    """The results of a run that ended in an error."""
    message = " ".join(str(error).split())
    if not isinstance(error, FreeFloatError | str):
        message = f"{type(error).__name__}: {message}".removesuffix(": ")
    return {"verdict": ERROR, "error": message}


def execute(study: PortableStudy, number: int, save_file: bool = False) -> RunResult:
    """Execute a run on one core; any error becomes its result.

    Args:
        study: The study.
        number: Number of the run, or the number of the undisturbed simulation.
        save_file: Whether to return the result file.
    """
    began = datetime.now(UTC).isoformat(timespec="milliseconds")
    begin, content = time.perf_counter(), None
    try:
        values, record = _computed(study.here, number)
        if save_file and record is not None:
            content = _file_content(record)
    except InputError as error:
        of_study = None
        if error.source in (None, str(study.here.base_source.absolute())):
            of_study = error_of_study(error, study.study.content.vary, study.study.source)
        values = error_values(of_study or error)
    except Exception as error:  # whatever the run raised is its result
        values = error_values(error)
    if "error" in values:
        values["error"] = study.original(values["error"])
    values |= {"seconds": time.perf_counter() - begin, "began": began}
    return RunResult(number, values, content)


def execute_into(study: PortableStudy, number: int, folder: Path) -> RunResult:
    """Execute a run on one core and write its result file in the folder of the study."""
    return execute(study, number, save_file=True).written(folder)


def _computed(study: Study, number: int) -> tuple[dict[str, Any], Any]:
    """Execute the command; return the results by column, and the record that files store."""
    source, inputs = study.base_source.absolute(), study.inputs(number)
    if module := STUDY_COMMANDS.get(study.content.command):
        return named(f"{module}:values")(study, number), None
    record = computed_record(study.content.command, source, **inputs)
    contact = {} if study.contact_unchecked is None else {"contact": UNCHECKED}
    return finite(record_values(record)) | contact, record


def computed_record(
    command: Command, source: Path, *, document: dict[str, Any], start: dict[str, Any]
) -> Any:
    """The map, the simulation, or what ``plan`` finds for a scenario.

    Args:
        command: The command to execute.
        source: The scenario's file, for relative paths.
        document: Data of the scenario.
        start: Start of a simulation, see :meth:`.study.Study.start`.
    """
    scenario = scenario_from(document, source)
    if command is Command.PLAN:
        return scenario.plan(threads=1)
    if command is Command.MAP:
        return scenario.map(threads=1)
    problem, branch = scenario.problem(), start.get("branch")
    attitude = initial_attitude(problem, start)
    if "joints" in start:  # near the arm branch; with neither the best is simulated
        joints = problem.model.joint_vector(start["joints"], "start.joints")
        if problem.redundant:  # whose arm branches are others with another robot
            problem = problem.replace(start_joints=joints)
        elif nearest := problem.nearest(joints, problem.branches(attitude), np.inf):
            branch = nearest.index
    return simulate(problem, attitude, branch=branch)


def _file_content(record: Any) -> bytes:
    with tempfile.TemporaryDirectory(prefix="freefloat-") as folder:
        file = Path(folder) / "result.h5"
        named("io.results:save")(record, file)  # HDF5 imports slowly
        return file.read_bytes()


def record_values(record: Any) -> dict[str, Any]:
    """The results of a simulation, a map, or what ``plan`` finds."""
    values: dict[str, Any] = named(kind_of(record, saved=True).values)(record)
    return values


def simulation_values(simulation: Simulation) -> dict[str, Any]:
    """The values of a simulation."""
    chosen, limits = simulation.chosen, simulation.limit_results
    names = ", ".join(result.limit for result in violated(limits))
    reason = ""
    if not chosen.motion.completed:
        reason = chosen.motion.ending.value
    elif not chosen.feasible:
        reason = MARGIN_REASON
    elif names:
        reason = LIMITS_REASON.format(names)
    values = {"verdict": INFEASIBLE if reason else FEASIBLE, "reason": reason}
    values |= motion_values(chosen) | _extreme_values(chosen) | _limiting(simulation)
    return values | limit_values(limits) | {"decided_by": DECIDERS[MOTION]}


def plan_values(plan: Plan) -> dict[str, Any]:
    """The values of a plan."""
    motion = {"completed": False} if plan.chosen is None else motion_values(plan.chosen)
    values = {
        **verdict_values(plan), **motion, **limit_values(plan.limit_results),
        "robust_radius_deg": degrees(plan.robust_radius), "deviation_deg": degrees(plan.deviation),
        "feasible_fraction": plan.feasible_fraction,
    }  # fmt: skip
    ranges = {entry.branch: json.dumps(entry.degrees) for entry in plan.ranges or ()}
    return values | family("attitude_ranges_deg", ranges)


def verdict_values(answer: Answer) -> dict[str, Any]:
    """Whether an answer is feasible, why, and what limits it."""
    verdict = FEASIBLE if answer.feasible else INFEASIBLE
    return {"verdict": verdict, "reason": answer.reason, **_limiting(answer)}


def map_values(result: AttitudeMap | HeadingMap) -> dict[str, Any]:
    """The values of a map over attitudes or headings."""
    problem, feasible, best = result.problem, result.feasible_found, result.best
    values = {
        "verdict": FEASIBLE if feasible else INFEASIBLE,
        "reason": "" if feasible else "no attitude tried keeps the margin",
        "measure": problem.margin.measure.name,
        "margin": best and best.minimum_margin,
        "margin_required": problem.margin.threshold,
        "feasible_fraction": result.feasible_fraction,
        "motion_fraction": result.motion_fraction,
        "branch": best and best.branch,
        "robust_radius_deg": result.robust and degrees(result.robust.radius),
    }
    if best is None:
        return values
    heading = degrees(problem.plane.heading(best.attitude)) if problem.has_headings else None
    return {**values, "heading_deg": heading, **attitude_values(best.attitude.tolist())}


def motion_values(chosen: SimulatedBranch) -> dict[str, Any]:
    """The values of a motion by itself."""
    motion = chosen.motion
    attitude = motion.initial.attitude.tolist()
    planar = motion.setting.has_headings
    return {
        **margin_values(chosen),
        "branch": chosen.branch.index,
        **attitude_values(attitude),
        "heading_deg": degrees(motion.setting.plane.heading(attitude)) if planar else None,
        **family("joints", dict(enumerate(motion.initial.joints.tolist()))),
        **family("residuals", motion.residuals().to_dict()),
    }


def margin_values(chosen: SimulatedBranch, start: float = 0.0) -> dict[str, Any]:
    """How far a motion that begins at a time [s] gets, and how near to a singularity."""
    motion, margin = chosen.motion, chosen.closest_approach
    singular = motion.ending is Ending.SINGULAR
    return {
        "completed": motion.completed, "measure": margin.measure, "margin": chosen.minimum_margin,
        "margin_time": start + margin.time, "margin_required": motion.setting.margin.threshold,
        "singular_time": start + motion.final.time if singular else None,
    }  # fmt: skip


def _extreme_values(chosen: SimulatedBranch) -> dict[str, Any]:
    """Final attitude, and largest rates, turn and range ratios of a motion that completes."""
    motion, (lower, upper) = chosen.motion, chosen.motion.model.joint_ranges
    values = attitude_values(motion.final.attitude.tolist(), "final_attitude")
    if not (motion.completed and motion.panels):
        return values
    rates, extents = np.abs(motion.node_rates[..., 3:]), joint_extents(motion)
    used = np.maximum(*range_ratios((lower, upper), extents.low, extents.high)).tolist()
    bounded = np.flatnonzero(np.isfinite([lower, upper]).any(axis=0)).tolist()
    return values | {
        "base_rate": BaseRateLimit(motion.setting, 1.0).worst(motion).worst,
        "base_turn_deg": degrees(BaseTurnLimit(motion.setting, np.pi).worst(motion).worst),
        **family("joint_rates", {
            joint: maximum(rates[..., joint : joint + 1]).value for joint in range(rates.shape[2])
        }),
        **family("range_ratios", {joint: used[joint] for joint in bounded}),
    }  # fmt: skip


def _limiting(answer: Answer) -> dict[str, Any]:
    """What is nearest to its bound along the motions, or farthest beyond it, and when."""
    nearest: list[tuple[float, str | None, float | None]] = [(-np.inf, None, None)]
    for phase in answer.phases:
        start, chosen, limits = phase.start, phase.chosen, phase.limit_results
        if chosen is not None:
            motion, margin = chosen.motion, chosen.closest_approach
            if motion.ending is Ending.SINGULAR:
                nearest.append((np.inf, SINGULARITY_LIMITS, start + motion.final.time))
            ratio = motion.setting.margin.threshold / margin.value if margin.value else np.inf
            nearest.append((ratio, MARGIN_LIMITS, start + margin.time))
        nearest += [(r.ratio, LIMITING.format(r.limit, r.where), start + r.time) for r in limits]
    _, name, time = max(nearest, key=lambda entry: entry[0])
    return {"limiting": name, "limiting_time": time}


def limit_values(limits: Sequence[LimitResult]) -> dict[str, Any]:
    """Whether limits are kept, and the ratio of each."""
    ratios = {result.limit: result.ratio for result in limits}
    return {"limits_kept": not violated(limits) if limits else None, **family("limits", ratios)}


def attitude_values(quaternion: Sequence[float], name: str = "attitude") -> dict[str, Any]:
    """The columns of a quaternion x, y, z, w."""
    return family(name, dict(zip("xyzw", quaternion, strict=True)))
