"""What was found in a robot's file: where, what is wrong, what to write instead."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

from freefloat.errors import ModelError


class Severity(StrEnum):
    """How bad it is; the worst comes first."""

    DEFECT = "defect"
    """The model cannot be loaded."""
    DOUBT = "doubt"
    """It loads, but is probably not what was meant."""
    NOTE = "note"
    """It is sound; how it is read should be known."""


@dataclass(frozen=True)
class UrdfDiagnostic:
    """One thing found in a URDF.

    Attributes:
        severity: How bad it is.
        file: The file, or ``"URDF text"``.
        line: Where in it the element concerned begins, counted from 1.
        element: The link or joint concerned, as in ``"joint elbow"``.
        problem: What is wrong, with its numbers.
        remedy: What to write instead.
    """

    severity: Severity
    file: str
    line: int
    element: str
    problem: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.element}: {self.problem}; {self.remedy}"

    def error(self) -> ModelError:
        """The same as an error, for whoever cannot go on."""
        return ModelError(self.element, self.problem, self.remedy, self.file, self.line)


def by_severity(findings: Iterable[UrdfDiagnostic]) -> tuple[UrdfDiagnostic, ...]:
    """In order: the worst first, then by line."""
    order = list(Severity)
    return tuple(sorted(findings, key=lambda one: (order.index(one.severity), one.line)))
