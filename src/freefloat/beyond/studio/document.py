"""A scenario with edits."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from freefloat.io.scenario.scenario import Scenario, load_scenario
from freefloat.io.scenario.yaml import parse_yaml


@dataclass(frozen=True, eq=False)
class Document:
    """A scenario with edits.

    Attributes:
        name: What it was opened as.
        source: Its file.
        text: Its text, with the comments of the file while it is not edited.
        content: The data of the text, without keys whose value is null.
        ends: Ends of the sliders.
    """

    name: str
    source: Path
    text: str = field(repr=False)
    content: dict[str, Any] = field(repr=False)
    ends: dict[str, list[float]] = field(repr=False)

    @classmethod
    def opened(cls, name: str) -> Document:
        """Open a file or a bundled scenario.

        Raises:
            InputError: If it is no scenario.
        """
        scenario = load_scenario(name)
        text, source = scenario.text, scenario.source
        content = _without_null(parse_yaml(text, source))
        return cls(name, source, text, content, _slider_ends(scenario))

    @property
    def file_name(self) -> str:
        """Name of the file of its plan."""
        return f"{self.source.stem}.h5"

    def with_content(self, content: dict[str, Any]) -> Document:
        """The document with other content."""
        text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None)
        return Document(self.name, self.source, text, content, self.ends)


def _without_null(value: Any) -> Any:
    """The data without keys whose value is null, which mean the same as no keys."""
    if isinstance(value, dict):
        return {key: _without_null(part) for key, part in value.items() if part is not None}
    return [_without_null(part) for part in value] if isinstance(value, list) else value


def _slider_ends(scenario: Scenario) -> dict[str, list[float]]:
    """Ends of the sliders of a scenario that was opened: momentum [N m s], duration [s]."""
    momentum = max(1.0, 2.0 * max(map(abs, scenario.content.momentum)))
    with scenario.error_context():
        duration = scenario.content.timing.to_timing().duration
        goal = scenario.content.goal
        duration = duration if goal is None else goal.duration or duration
    return {"momentum": [-momentum, momentum], "duration": [0.2 * duration, 4.0 * duration]}
