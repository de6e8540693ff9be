"""One measurement, and how several are raced and told."""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from rich.table import Table


@dataclass(frozen=True)
class Result:
    """How long something takes, and what else takes how long in the same run.

    Attributes:
        what: Is measured.
        seconds: Of ours.
        against: What it is compared with.
        baseline: Seconds of that.
        wanted: ``ratio`` should be this or more.
        limit: Seconds should be this or less.
        remark: What a reader has to know.
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
        """Baseline over ours."""
        return None if self.baseline is None else self.baseline / self.seconds

    @property
    def met(self) -> bool:
        fast = self.wanted is None or self.ratio is None or self.ratio >= self.wanted
        return fast and (self.limit is None or self.seconds <= self.limit)


def race(*contestants: Callable[[], object], rounds: int) -> list[float]:
    """The best time of each [s], taken in turns so that a slow spell of the machine hits all."""
    best = [np.inf] * len(contestants)
    for _ in range(rounds):
        for i, contestant in enumerate(contestants):
            start = time.perf_counter()
            contestant()
            best[i] = min(best[i], time.perf_counter() - start)
    return best


def machine() -> str:
    """All that is told of the machine."""
    cores = len(os.sched_getaffinity(0))
    return f"{cores} core{'s' * (cores > 1)}"


def save(results: Sequence[Result], file: Path) -> None:
    rows = [{**asdict(result), "ratio": result.ratio, "met": result.met} for result in results]
    document = {"machine": machine(), "results": rows}
    file.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def load(file: Path) -> tuple[str, list[Result]]:
    """The machine and what was measured on it."""
    document = json.loads(file.read_text(encoding="utf-8"))
    fields = Result.__dataclass_fields__
    rows = [{key: row[key] for key in fields} for row in document["results"]]
    return document["machine"], [Result(**row) for row in rows]


def told(seconds: float) -> str:
    """Three digits and a unit."""
    rounded = float(f"{seconds:.3g}")
    unit, size = next(
        (unit, size) for unit, size in (("s", 1.0), ("ms", 1e3), ("µs", 1e6))
        if rounded * size >= 1.0 or unit == "µs"
    )  # fmt: skip
    value = rounded * size
    decimals = max(0, 2 - math.floor(math.log10(value)))
    return f"{value:,.{decimals}f} {unit}"


def told_ratio(ratio: float | None) -> str:
    """Two digits and a cross."""
    if ratio is None:
        return ""
    rounded = float(f"{ratio:.2g}")
    return f"{rounded:.0f} ×" if rounded >= 10.0 else f"{rounded:.1f} ×"


def markdown(machine: str, results: Sequence[Result]) -> str:
    """The table that README shows."""
    lines = [
        f"| on {machine} | takes | compared with | that takes | ratio |",
        "|---|---|---|---|---|",
    ]
    for result in results:
        what = f"{result.what} ({result.remark})" if result.remark else result.what
        baseline = "" if result.baseline is None else told(result.baseline)
        ratio = told_ratio(result.ratio)
        lines.append(
            f"| {what} | {told(result.seconds)} | {result.against} | {baseline} | {ratio} |"
        )
    return "\n".join(lines)


def table(results: Sequence[Result]) -> Table:
    """The same for a terminal, with what was wanted."""
    made = Table(title="freefloat against plain code, same machine, same run")
    for column in ("what", "takes", "compared with", "that takes", "ratio", "wanted", "remark"):
        made.add_column(column)
    for result in results:
        bounds = [f">= {result.wanted:g}"] if result.wanted else []
        wanted = ", ".join(bounds + ([f"<= {result.limit:g} s"] if result.limit else []))
        made.add_row(
            result.what, told(result.seconds), result.against,
            "" if result.baseline is None else told(result.baseline), told_ratio(result.ratio),
            wanted if result.met else f"[bold red]{wanted}", result.remark,
        )  # fmt: skip
    return made
