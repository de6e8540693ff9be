"""A scenario with edits."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from freefloat.errors import InputError
from freefloat.io.yaml import parse_yaml, read_text
from freefloat.robot.names import find_scenario


@dataclass(frozen=True, eq=False)
class Document:
    """A scenario with edits.

    Attributes:
        name: What it was opened as.
        source: Its file.
        text: Its text, with the comments of the file while it is not edited.
        content: The data of the text.
        ends: Ends of the sliders.
    """

    name: str
    source: Path
    text: str = field(repr=False)
    content: dict[str, Any] = field(repr=False)
    ends: dict[str, list[float]] = field(repr=False)

    @classmethod
    def opened(cls, name: str) -> Document:
        """Open a file or a bundled scenario; raises InputError."""
        source = find_scenario(name)
        text = read_text(source)
        content = parse_yaml(text, source)
        try:
            return cls(name, source, text, content, _slider_ends(content))
        except (KeyError, TypeError, ValueError):
            problem = "it has no timing.duration, or its momentum is no vector"
            raise InputError("scenario", problem, "a scenario", str(source)) from None

    @property
    def file_name(self) -> str:
        """Name of the file of its plan."""
        return f"{self.source.stem}.h5"

    def with_content(self, content: dict[str, Any]) -> Document:
        """The document with other content."""
        text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None)
        return Document(self.name, self.source, text, content, self.ends)


def _slider_ends(content: dict[str, Any]) -> dict[str, list[float]]:
    """Ends of the sliders of a scenario that was opened: momentum [N m s], duration [s]."""
    momentum = max(1.0, 2.0 * float(np.abs(content.get("momentum", [0.0])).max()))
    duration = float(content["timing"]["duration"])
    return {"momentum": [-momentum, momentum], "duration": [0.2 * duration, 4.0 * duration]}
