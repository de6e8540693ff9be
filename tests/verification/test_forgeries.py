"""Every number of every kind of result is compared with a recomputed one, or named as not verified.

The values of a record are found by its classes alone, so that a new field takes part.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import freefloat as ff
from freefloat.errors import FreeFloatError
from freefloat.motion.problem import Problem
from freefloat.robot.model import FreeFloatingModel
from freefloat.verification.check import recomputed
from freefloat.verification.leaves import compare
from freefloat.verification.report import CheckReport
from tests.commands import document
from tests.test_result_kinds import result

INPUTS = Problem, ff.Search, ff.Limits, FreeFloatingModel
SMALLEST = 1e-7
"""Numbers below this are rounding, of which no digit is compared."""

Place = tuple[Any, ...]


def leaves(value: Any, place: Place = ()) -> Iterator[tuple[Place, Any]]:
    """All values of a record but its question, and all tuples; each with its place."""
    if isinstance(value, INPUTS) or place[-1:] == ("following",):
        return
    if isinstance(value, tuple | Mapping) or is_dataclass(value):
        if type(value) is tuple and value:
            yield place, value
        for key, entry in parts(value).items():
            yield from leaves(entry, (*place, key))
    else:
        yield place, value


def parts(value: Any) -> dict[Any, Any]:
    if is_dataclass(value):
        return {entry.name: getattr(value, entry.name) for entry in fields(value)}
    if hasattr(value, "_asdict"):
        return dict(value._asdict())
    return dict(value if isinstance(value, Mapping) else enumerate(value))


def altered(value: Any, place: Place, new: Any) -> Any:
    """A record with another value at a place."""
    if not place:
        return new
    key, *rest = place
    changed = altered(parts(value)[key], tuple(rest), new)
    if is_dataclass(value):
        return replace(value, **{key: changed})  # type: ignore[type-var]
    if hasattr(value, "_replace"):
        return value._replace(**{key: changed})
    entries = parts(value) | {key: changed}
    return entries if isinstance(value, Mapping) else tuple(entries.values())


def forgeries(value: Any) -> list[Any]:
    """Other values in place of one."""
    if isinstance(value, bool):
        return [not value]
    if isinstance(value, Enum):
        return [member for member in type(value) if member is not value][:1]
    if isinstance(value, str):
        return [value + "x"]
    if isinstance(value, int):
        return [value + 1, 10 * value + 3, -value - 1]
    if isinstance(value, float):
        return list(numbers(value))
    if isinstance(value, np.ndarray):
        chosen = np.flatnonzero(np.isfinite(value) & (np.abs(value) > SMALLEST))
        if value.dtype.kind not in "iuf" or not len(chosen):
            return []
        n = int(chosen[len(chosen) // 2])
        return [with_number(value, n, new) for new in numbers(value.flat[n].item())]
    return [value[:-1]] if isinstance(value, tuple) else []


def numbers(value: float) -> Iterator[Any]:
    if math.isfinite(value) and abs(value) > SMALLEST:
        yield from (type(value)(new) for new in (1.01 * value + isinstance(value, int), 10 * value))
        if value > 0 or isinstance(value, float):
            yield -value
    elif math.isfinite(value):
        yield value + 0.5


def with_number(values: Any, n: int, new: float) -> Any:
    changed = values.copy()
    if values.dtype.kind == "u":
        new %= 256
    changed.flat[n] = new
    return changed


def names(place: Place) -> str:
    """The name of a place in reports, without numbers."""
    return ".".join(str(part) for part in place if not str(part).isdecimal())


def named(report: Any) -> set[str]:
    listed = (*report.not_verified, *report.given)
    return {names(tuple(name.split("."))) for name in listed}


def is_named(place: Place, report: Any) -> bool:
    name = names(place)
    return any(name == entry or entry.startswith(f"{name}.") for entry in named(report))


@cache
def recomputed_of(kind: str) -> Any:
    """What is recomputed of a true result: nothing of a forged value is in it."""
    return recomputed(result(kind))[1]


KINDS = "plan", "motion", "goal", "manoeuvre", "map", "attitude map", "singularity map"


def missed(kind: str, judge: Callable[[Any, Place], Any]) -> Iterator[str]:
    """Forgeries that a report neither denies nor names."""
    true = result(kind)
    for place, value in leaves(true):
        for new in forgeries(value):
            try:
                forged = altered(true, place, new)
            except FreeFloatError:  # it is no such record
                continue
            report = judge(forged, place)
            if report.passed and not is_named(place, report):
                yield f"{'.'.join(map(str, place))}: {value} -> {new}"
