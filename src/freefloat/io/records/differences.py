"""Differences between a JSON document and that of the record that it describes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from freefloat.verification.comparisons import magnitude_range

_RELATIVE, _ABSOLUTE = 1e-6, 1e-9
"""Deviation of a number in a document from the same number of its record: rounding."""


def differences(
    stated: Any, recomputed: Any, key: str = "", errors: bool = False
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
    if isinstance(stated, dict) and isinstance(recomputed, dict):
        for name in (name for name in stated if name in recomputed):
            inner = f"{key}.{name}" if key else name
            residuals = name == "residuals"
            yield from differences(stated[name], recomputed[name], inner, errors or residuals)
    elif isinstance(stated, list) and isinstance(recomputed, list):
        if len(stated) != len(recomputed):
            yield key, stated, recomputed
            return
        if key.endswith("attitude") and np.dot(stated, recomputed) < 0.0:  # of opposite sign
            recomputed = [-value for value in recomputed]
        for index, pair in enumerate(zip(stated, recomputed, strict=True)):
            yield from differences(*pair, f"{key}[{index}]", errors)
    elif not _agree(stated, recomputed, errors):
        yield key, stated, recomputed


def _agree(stated: Any, recomputed: Any, errors: bool) -> bool:
    if isinstance(stated, str) and isinstance(recomputed, str):
        return True
    if not {type(stated), type(recomputed)} <= {int, float}:
        return type(stated) is type(recomputed) and bool(stated == recomputed)
    if errors:
        low, high = magnitude_range(recomputed)
        return bool(low <= stated <= high)
    return math.isclose(stated, recomputed, rel_tol=_RELATIVE, abs_tol=_ABSOLUTE)
