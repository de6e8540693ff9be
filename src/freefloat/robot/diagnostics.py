"""Errors and warnings about a URDF."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from freefloat.errors import ModelError


class Severity(StrEnum):
    """How severe a diagnostic is."""

    ERROR = "error"
    """The model cannot be loaded."""
    WARNING = "warning"
    """The model loads, but the URDF probably does not say what was meant."""


@dataclass(frozen=True)
class UrdfDiagnostic:
    """An error or a warning about one element of a URDF.

    Attributes:
        severity: Whether the model can be loaded.
        file: The file, or ``"URDF text"``.
        line: Line on which the element begins, counted from 1.
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

    def exception(self) -> ModelError:
        """The diagnostic as an exception."""
        return ModelError(self.element, self.problem, self.remedy, self.file, self.line)
