"""How records show themselves in a notebook: one line, arrays by their shapes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np

_LONGEST, _MOST = 60, 7
"""Letters of a text, and numbers of an array, that are shown whole."""


def brief(record: Any) -> str:
    """A dataclass in one line: what is short in full, records and arrays by name and shape.

    A class takes it as its own with ``__repr__ = brief``.
    """
    shown = (f"{one.name}={_short(getattr(record, one.name))}" for one in fields(record))
    return f"{type(record).__name__}({', '.join(shown)})"


def _short(value: Any) -> str:
    if isinstance(value, Enum):
        return f"{type(value).__name__}.{value.name}"
    if isinstance(value, np.ndarray):
        if value.ndim == 1 and value.size <= _MOST:
            return f"[{' '.join(f'{number:.6g}' for number in value)}]"
        return f"array{value.shape}"
    if is_dataclass(value):
        return f"{type(value).__name__}(...)"
    if isinstance(value, tuple | list | Mapping) and not _plain(value):
        kinds = {type(one).__name__ for one in (value if not isinstance(value, Mapping) else ())}
        return f"<{len(value)} {kinds.pop() if len(kinds) == 1 else 'entries'}>"
    if callable(value):
        return "..."
    text = repr(value)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."


def _plain(value: Any) -> bool:
    """Whether a tuple, list or mapping is short and holds nothing but numbers and words."""
    inner = [*value, *value.values()] if isinstance(value, Mapping) else value
    return all(one is None or isinstance(one, int | float | str) for one in inner)
