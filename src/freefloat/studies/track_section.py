"""The section ``track`` of a study file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from freefloat.errors import InputError
from freefloat.io.scenario.field_types import NotNegative, Positive, Section, Seed
from freefloat.io.scenario.yaml import validated

TRACK = "track."
"""What the names of its keys begin with in ``vary``."""

TRACK_SEED = f"{TRACK}seed"
"""The key that repeats a run with other random numbers."""


class TrackSection(Section):
    """Robot and controller of the command track, see ``ff.track``."""

    mass_error: NotNegative = 0.0
    """Standard deviation of the logarithm of the factor on mass and inertia of every body; 0.05 is
    about 5 %."""
    noise: NotNegative = 0.0
    """Standard deviation of measured angles [rad], and of positions [m]."""
    friction: NotNegative = 0.0
    """Dry friction in every joint [N m or N]."""
    seed: Seed = 0
    """Seed of mass errors and noise; vary it to repeat a run with others."""
    gain: NotNegative = 1.0
    """Gain of the controller on the error of the pose [1/s]."""
    period: Positive = 0.1
    """Period of the controller [s]."""
    tolerance: NotNegative = 0.02
    """Allowed distance from the path [m] and angle from its orientation [rad]."""

    def with_values(self, parameters: dict[str, Any]) -> dict[str, Any]:
        """The keys of the section, with those that vary replaced by their values."""
        return self.model_dump() | _values_below(parameters)


def is_accepted(values: Mapping[str, Any]) -> bool:
    """Whether values of a run by their names in the section are accepted."""
    try:
        TrackSection.model_validate(values)
    except ValidationError:
        return False
    return True


def require_track_values(key: str, values: Iterable[Any], source: str) -> None:
    """Check the values that a study lists for a key below ``track``.

    Raises:
        InputError: The first error.
    """
    for value in values:
        try:
            validated(TrackSection, _values_below({key: value}), Path(source))
        except InputError as error:
            raise InputError(f"vary.{key}", error.problem, error.accepted) from None


def _values_below(parameters: dict[str, Any]) -> dict[str, Any]:
    """The values of varied keys below ``track``, by their names in the section."""
    items = parameters.items()
    return {key.removeprefix(TRACK): value for key, value in items if key.startswith(TRACK)}
