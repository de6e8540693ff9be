"""What becomes of a case: a verdict, a row for journal and tables, a file."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from freefloat.errors import FreeFloatError

Row = dict[str, Any]
FEASIBLE, INFEASIBLE, ERROR = "feasible", "infeasible", "error"
"""Verdicts."""


@dataclass(frozen=True)
class CaseResult:
    """What became of a case.

    Attributes:
        row: For journal and tables, values that JSON knows.
        file: Bytes of the result file; None where there is none.
    """

    row: Row
    file: bytes | None = None


def told(error: BaseException) -> str:
    """An error in one line."""
    if isinstance(error, FreeFloatError):
        return str(error)
    words = " ".join(str(error).split())
    return f"{type(error).__name__}: {words}" if words else type(error).__name__


def error_row(number: int, cause: str) -> Row:
    """The row of a case that failed."""
    return {"case": number, "verdict": ERROR, "error": cause}


def finite(value: Any) -> Any:
    """The same with None for numbers that are none: JSON has no others."""
    if isinstance(value, dict):
        return {key: finite(one) for key, one in value.items()}
    if isinstance(value, list):
        return [finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
