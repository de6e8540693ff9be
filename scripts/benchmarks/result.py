"""Measurements: how they are timed, stored and formatted."""

from __future__ import annotations

import json
import math
import os
import resource
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from rich.table import Table


@dataclass(frozen=True)
class Result:
    """Duration of something, and of its competitor in the same run.

    Attributes:
        what: What is measured.
        seconds: Duration with freefloat.
        against: The competitor.
        baseline: Duration of the competitor [s].
        wanted: Required ``ratio``.
        limit: Largest permitted duration [s].
        remark: Text in parentheses after ``what``.
    """

    what: str
    seconds: float
    against: str = ""
    baseline: float | None = None
    wanted: float | None = None
    limit: float | None = None
    remark: str = ""

    @property
    def ratio(self) -> float | None:
        """Duration of the competitor over that of freefloat."""
        return None if self.baseline is None else self.baseline / self.seconds

    @property
    def required(self) -> str:
        """The required ratio and duration in words."""
        bounds = [f"at least {self.wanted:.3g} ×"] if self.wanted else []
        return ", ".join(bounds + ([f"at most {self.limit:g} s"] if self.limit else []))

    @property
    def met(self) -> bool:
        fast = self.wanted is None or self.ratio is None or self.ratio >= self.wanted
        return fast and (self.limit is None or self.seconds <= self.limit)


def race(*contestants: Callable[[], object], rounds: int) -> list[float]:
    """Best time of each [s]; timed alternately, so that load on the computer affects all."""
    best = [np.inf] * len(contestants)
    for _ in range(rounds):
        for i, contestant in enumerate(contestants):
            start = time.perf_counter()
            contestant()
            best[i] = min(best[i], time.perf_counter() - start)
    return best


def processor_time(work: Callable[[], object]) -> tuple[float, float]:
    """Duration and processor time of a function and the processes that it starts [s]."""

    def used() -> float:
        processes = resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN
        usages = [resource.getrusage(process) for process in processes]
        return sum(usage.ru_utime + usage.ru_stime for usage in usages)

    start, before = time.perf_counter(), used()
    work()
    return time.perf_counter() - start, used() - before


def computer_name() -> str:
    """Number of cores of this computer."""
    cores = len(os.sched_getaffinity(0))
    return f"{cores} core{'s' * (cores > 1)}"


def save(computer: str, results: Sequence[Result], file: Path) -> None:
    rows = [{**asdict(result), "ratio": result.ratio, "met": result.met} for result in results]
    document = {"computer": computer, "results": rows}
    file.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def load(file: Path) -> tuple[str, list[Result]]:
    """Computer and results of a file."""
    document = json.loads(file.read_text(encoding="utf-8"))
    fields = Result.__dataclass_fields__
    rows = [{key: row[key] for key in fields} for row in document["results"]]
    return document["computer"], [Result(**row) for row in rows]


def duration_text(seconds: float) -> str:
    """Time with three digits and a unit."""
    rounded = float(f"{seconds:.3g}")
    unit, size = next(
        (unit, size) for unit, size in (("s", 1.0), ("ms", 1e3), ("µs", 1e6))
        if rounded * size >= 1.0 or unit == "µs"
    )  # fmt: skip
    value = rounded * size
    decimals = max(0, 2 - math.floor(math.log10(value)))
    return f"{value:,.{decimals}f} {unit}"


def ratio_text(ratio: float | None) -> str:
    """Ratio with two digits."""
    if ratio is None:
        return ""
    rounded = float(f"{ratio:.2g}")
    return f"{rounded:.0f} ×" if rounded >= 10.0 else f"{rounded:.1f} ×"


def markdown(computer: str, results: Sequence[Result], requirements: bool = True) -> str:
    """Table in Markdown; with requirements, one that is missed is in bold beside the ratio."""
    lines = [
        f"| on {computer} | time | compared with | its time | ratio |",
        "|---|---|---|---|---|",
    ]
    for result in results:
        what = f"{result.what} ({result.remark})" if result.remark else result.what
        baseline = "" if result.baseline is None else duration_text(result.baseline)
        ratio = ratio_text(result.ratio)
        seconds = duration_text(result.seconds)
        if requirements and not result.met:
            exact = "" if result.ratio is None else f"{result.ratio:.3g} × "
            ratio = f"{exact}**({result.required} required)**"
        lines.append(f"| {what} | {seconds} | {result.against} | {baseline} | {ratio} |")
    return "\n".join(lines)


def table(results: Sequence[Result]) -> Table:
    """Table for a terminal, with the requirements."""
    made = Table(title="freefloat against plain code, same computer, same run")
    for column in ("what", "time", "compared with", "its time", "ratio", "required", "remark"):
        made.add_column(column)
    for result in results:
        wanted = result.required
        made.add_row(
            result.what, duration_text(result.seconds), result.against,
            "" if result.baseline is None else duration_text(result.baseline),
            ratio_text(result.ratio),
            f"{wanted}: met" if wanted and result.met else wanted and f"[bold red]{wanted}: missed",
            result.remark,
        )  # fmt: skip
    return made
