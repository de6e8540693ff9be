"""The ``timing`` section of scenario files: its keys, and the time law that they describe."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from freefloat.io.scenario.field_types import Number, Section
from freefloat.paths.time_laws import TimeLaw
from freefloat.paths.timing import Stop, Timing


class StopSection(Section):
    """An instant at which the end-effector rests."""

    s: Number
    """Path parameter, in (0, 1)."""
    t: Number
    """Time [s]."""


class TimingSection(Section):
    """Time law of the path."""

    duration: Number
    """Duration of the whole motion [s]."""
    law: TimeLaw = TimeLaw.QUINTIC
    """Time law between rests."""
    stops: list[StopSection] = Field(default=[])
    """Rests between start and end."""
    speeds: list[tuple[Number, ...]] = Field(default=[])
    """Times [s] and speeds ds/dt [1/s] of the law ``optimal``, linear in between, or with d²s/dt²
    [1/s²] in a third column cubic, from rest to rest. Without them ``plan`` finds the fastest
    timing; until then the law is quintic."""

    def to_timing(self) -> Timing:
        """The time law; raises an InputError if it is invalid."""
        stops = tuple(Stop(stop.s, stop.t) for stop in self.stops)
        return Timing(self.duration, self.law, stops, tuple(self.speeds))


def timing_content(timing: Timing) -> dict[str, Any]:
    """Content of the ``timing`` section that describes a time law."""
    return {
        "duration": float(timing.duration),
        "law": str(timing.law),
        "stops": [{"s": float(stop.s), "t": float(stop.t)} for stop in timing.stops],
        "speeds": [list(row) for row in timing.speeds],
    }
