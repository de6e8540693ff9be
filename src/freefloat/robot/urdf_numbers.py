"""Numbers in attributes of a URDF; what is wrong with them is collected as diagnostics."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from freefloat.robot.description import Severity, UrdfDiagnostic
from freefloat.robot.urdf_text import Element
from freefloat.so3 import Array, frozen

MAGNITUDE = 1e12
"""Largest accepted number: squares of larger ones overflow."""
ROUNDED = 1e-3
"""Error of a unit vector or quaternion written with three digits."""
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")


class AttributeReader:
    """Reads numbers, and collects what is wrong with elements and attributes.

    Attributes:
        diagnostics: What was collected.
    """

    def __init__(self, source: str) -> None:
        """Read for a file, which diagnostics name."""
        self.diagnostics: list[UrdfDiagnostic] = []
        self._source = source

    def number(self, element: Element, key: str) -> float:
        """The number of an attribute; zero where it is missing, NaN where it is wrong."""
        return float(self.numbers(element, key, "0")[0])

    def numbers(self, element: Element, key: str, default: str) -> Array:
        """The numbers of an attribute, as many as the default has; NaN where they are wrong."""
        text = default if element is None else element.get(key, default)
        words = text.split()
        count = len(default.split())
        accepted = "a finite number" if count == 1 else f"{count} finite numbers"
        if len(words) == count and are_numbers(words):
            values = frozen([float(word) for word in words])
            if np.abs(values).max() <= MAGNITUDE or element.tag == "limit":
                return values
            accepted += f" of at most {MAGNITUDE:g}"
        problem = f'<{element.tag} {key}="{text}"> is not {accepted}'
        remedy = f"{accepted}; expressions are not evaluated"
        self.report(Severity.ERROR, element, problem, remedy)
        return np.full(count, np.nan)

    def report(self, severity: Severity, element: Element, problem: str, remedy: str) -> None:
        """Collect a diagnostic about the link or joint that an element belongs to."""
        owner = element
        while owner.getparent() is not None and owner.getparent().tag != "robot":
            owner = owner.getparent()
        name = f"{owner.tag} {owner.get('name', '')}".strip()
        line = element.sourceline
        self.diagnostics.append(UrdfDiagnostic(severity, self._source, line, name, problem, remedy))


def text_of(values: npt.ArrayLike) -> str:
    """Numbers as the text of an attribute, with all digits."""
    return " ".join(map(repr, np.ravel(values).tolist()))


def are_numbers(words: Sequence[str]) -> bool:
    """Whether all words are finite decimal numbers."""
    return all(_NUMBER.fullmatch(word) and math.isfinite(float(word)) for word in words)
