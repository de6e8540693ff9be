"""Parts of records from their JSON documents: the inverse of ``to_dict``."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from freefloat.limits.limits import LimitKind, LimitResult
from freefloat.motion.certificate import Certificate, Comparison, Proven, Worst

Document = dict[str, Any]
_RELATIVE, _ABSOLUTE = 1e-6, 1e-9
"""Deviation of a number in a document from the same number of its record: rounding."""
_ERROR_FACTOR, _SMALL_ERROR = 10.0, 1e-7
"""Numbers that are errors of a motion agree to an order of magnitude only."""


def certificate_of(document: Document | None) -> Certificate | None:
    """Certificate of its document."""
    if document is None:
        return None
    worst = {
        key: None if document[key] is None else Worst(**document[key])
        for key in ("end_effector_position", "end_effector_attitude", "momentum",
                    "centre_of_mass", "rates")
    }  # fmt: skip
    return Certificate(**{
        **document,
        **worst,
        "least": tuple(Proven(**entry) for entry in document["least"]),
        "integration": Comparison(**document["integration"]),
    })  # fmt: skip


def limit_results_of(documents: list[Document]) -> tuple[LimitResult, ...]:
    """Results of limits; null stands for a value without a bound."""
    results = []
    for document in documents:
        values = dict(document)
        for key in ("worst", "allowed", "ratio"):
            values[key] = math.inf if document[key] is None else document[key]
        values["limit"], values["notes"] = LimitKind(document["limit"]), tuple(document["notes"])
        results.append(LimitResult(**values))
    return tuple(results)


def radians(degrees: float | None) -> float | None:
    """An angle of a document [rad]."""
    return None if degrees is None else float(np.radians(degrees))


def differences(
    stated: Any, recomputed: Any, key: str = "", *, errors: bool = False
) -> Iterator[tuple[str, Any, Any]]:
    """Numbers, truth values and lengths in which a document differs from that of its record.

    Texts are not compared, nor keys that only one of the two has.

    Args:
        stated: The document in a file.
        recomputed: The document of the record.
        key: Key path of both.
        errors: Whether they are errors, of which only the order of magnitude is compared.

    Yields:
        Key path, stated and recomputed value.
    """
    if isinstance(stated, Mapping) and isinstance(recomputed, Mapping):
        for name in (name for name in stated if name in recomputed):
            inner = f"{key}.{name}" if key else name
            yield from differences(
                stated[name], recomputed[name], inner, errors=errors or name == "residuals"
            )
    elif isinstance(stated, list) and isinstance(recomputed, list):
        if len(stated) != len(recomputed):
            yield key, stated, recomputed
            return
        if key.endswith("attitude") and _are_opposite(stated, recomputed):
            recomputed = [-value for value in recomputed]
        for index, pair in enumerate(zip(stated, recomputed, strict=True)):
            yield from differences(*pair, f"{key}[{index}]", errors=errors)
    elif isinstance(recomputed, str) and isinstance(stated, str):
        return
    elif not _agree(stated, recomputed, errors):
        yield key, stated, recomputed


def _agree(stated: Any, recomputed: Any, errors: bool) -> bool:
    numbers = all(
        isinstance(value, int | float) and not isinstance(value, bool)
        for value in (stated, recomputed)
    )
    if not numbers:
        return type(stated) is type(recomputed) and bool(stated == recomputed)
    if errors:
        low, high = recomputed / _ERROR_FACTOR, recomputed * _ERROR_FACTOR
        return bool(low - _SMALL_ERROR <= stated <= high + _SMALL_ERROR)
    return bool(abs(stated - recomputed) <= _ABSOLUTE + _RELATIVE * abs(recomputed))


def _are_opposite(stated: list[Any], recomputed: list[Any]) -> bool:
    """Whether two quaternions have opposite signs."""
    numbers = all(isinstance(value, int | float) for value in stated)
    return numbers and sum(a * b for a, b in zip(stated, recomputed, strict=True)) < 0.0
