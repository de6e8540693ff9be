"""One case of a study: from its number to a row and a file, whatever happens."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import yaml

from freefloat.io.scenario import Scenario
from freefloat.io.schema import ScenarioFile
from freefloat.io.validation import validated
from freefloat.motion.problem import Problem
from freefloat.paths.path import samples_text
from freefloat.so3 import heading_of
from freefloat.studies.answer import Asked
from freefloat.studies.files import UnpackedFiles
from freefloat.studies.result import (
    FEASIBLE,
    INFEASIBLE,
    CaseResult,
    Row,
    error_row,
    finite,
    told,
)
from freefloat.studies.schema import Case
from freefloat.studies.study import Study


@dataclass(frozen=True, eq=False)
class CaseRunner:
    """Runs the cases of a study beside its files.

    Attributes:
        study: The study.
        files: Its files, unpacked.
    """

    study: Study
    files: UnpackedFiles

    def run(self, number: int) -> CaseResult:
        """Run one case on one core; what goes wrong is told in its row."""
        began, begin = datetime.now(UTC), time.perf_counter()
        file = self.files.folder / f"case_{number}.h5"
        try:
            row = self._answered(number, file if self.study.content.files else None)
            content = file.read_bytes() if self.study.content.files else None
        except Exception as error:  # solvers have failures of their own; the others go on
            row, content = error_row(number, self.files.told(told(error))), None
        finally:
            file.unlink(missing_ok=True)
        seconds = time.perf_counter() - begin
        row |= {"began": began.isoformat(timespec="milliseconds"), "seconds": seconds}
        return CaseResult(finite(row), content)

    def _answered(self, number: int, file: Path | None) -> Row:
        study, files = self.study, self.files
        document = study.document(number)
        source = files.below(study.base_source)
        content = validated(ScenarioFile, files.led_to_copies(document), source)
        samples = content.path.samples
        text = None if samples is None else samples_text(source.parent / samples)
        scenario = Scenario(source, yaml.safe_dump(document, sort_keys=False), content, text)
        asked = Asked(scenario, replace(scenario, source=study.base_source), self._told, file)
        start = study.start(number)
        return row_of(number, study.content.task, asked.answer(study.content.task, start))

    def _told(self, problem: Problem) -> Problem:
        """A problem whose robot names the files it came from instead of their copies."""
        description, told = problem.model.description, self.files.told
        named = replace(description, text=told(description.text), source=told(description.source))
        return replace(problem, model=replace(problem.model, description=named))


def row_of(number: int, task: Case, document: Mapping[str, Any]) -> Row:
    """The row of a case that was answered: what its command's document tells, in brief."""
    if task is Case.MAP:
        return _map_row(number, document)
    findings = document["limits"]
    row: Row = {
        "case": number,
        "verdict": INFEASIBLE,
        "error": None,
        "reason": document.get("reason", ""),
        **_motion_row(document),
        "limits_kept": all(one["kept"] for one in findings) if findings else None,
        "limits": {one["limit"]: one["ratio"] for one in findings},
    }
    if task is Case.PLAN:
        for key in ("robust_radius_deg", "deviation_deg", "feasible_fraction"):
            row[key] = document[key]
        row |= _ranges_row(document["attitude_ranges_deg"])
        row["verdict"] = FEASIBLE if document["feasible"] else INFEASIBLE
        return row
    broken = [one["limit"] for one in findings if not one["kept"]]
    row["reason"] = _reason(document, broken)
    row["verdict"] = INFEASIBLE if row["reason"] else FEASIBLE
    return row


def _reason(document: Mapping[str, Any], broken: list[str]) -> str:
    """Why a motion does not serve; empty where it does."""
    if not document["completed"]:
        return str(document["ending"])
    if not document["min_margin"]["kept"]:
        return "The margin is not kept."
    return f"Limits are not kept: {', '.join(broken)}." if broken else ""


def _motion_row(document: Mapping[str, Any]) -> Row:
    """Of the chosen motion; nothing where a plan has none."""
    least, singular, initial = (document[key] for key in ("min_margin", "singular", "initial"))
    row: Row = {"completed": document["completed"]}
    row["measure"] = least and least["measure"]
    row["margin"], row["margin_time"] = (least and least[key] for key in ("value", "time"))
    row["margin_required"] = least and least["required"]
    row["singular_time"] = singular and singular["time"]
    row["branch"] = document["branch"]
    row["attitude"] = initial and initial["attitude"]
    row["heading_deg"] = None
    if initial and initial["attitude"][:2] == [0.0, 0.0]:
        row["heading_deg"] = math.degrees(heading_of(initial["attitude"]))
    row["joints"] = initial and initial["joints"]
    row["residuals"] = document["residuals"]
    return row


def _ranges_row(entries: Sequence[Mapping[str, Any]]) -> Row:
    """Of the headings that serve, by arm branch, and the share of those that any branch serves."""
    if not entries:
        return {}
    ends = sorted(span for entry in entries for span in entry["ranges"])
    share, reached = 0.0, 0.0
    for low, high in ends:
        share += max(0.0, high - max(low, reached))
        reached = max(reached, high)
    ranges = {str(entry["branch"]): entry["ranges"] for entry in entries}
    return {"attitude_ranges_deg": ranges, "feasible_fraction": share / 360.0}


def _map_row(number: int, document: Mapping[str, Any]) -> Row:
    best, robust = document["best"], document["robust"]
    margin = document["margin"]
    planar = not isinstance(margin, dict)
    served = document["feasible_fraction"] > 0.0 or (best is not None and not planar)
    return {
        "case": number,
        "verdict": FEASIBLE if served else INFEASIBLE,
        "error": None,
        "reason": "" if served else "no attitude tried keeps the margin",
        "measure": None if planar else margin["measure"],
        "margin": best and best["value"],
        "margin_required": margin if planar else margin["value"],
        "branch": best and best["branch"],
        "attitude": best and best["attitude"],
        "heading_deg": best and best.get("heading_deg"),
        "robust_radius_deg": robust and robust["radius_deg"],
        "feasible_fraction": document["feasible_fraction"],
        "motion_fraction": document["motion_fraction"],
    }
