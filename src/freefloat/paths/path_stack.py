"""Paths of several end-effectors that are travelled at the same time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from freefloat.errors import InputError, require_type
from freefloat.paths.path import EndEffectorPath
from freefloat.paths.timed_path import Prescription, TimedPath
from freefloat.paths.timing import Timing
from freefloat.so3 import Array, IntArray, frozen

_APART = 1e-6
"""Smallest distance of breaks, as a fraction of the duration."""


def path_key(arm: str) -> str:
    """The key of an arm's path in scenario files; the first arm has no name."""
    return f"robot.arms.{arm}.law.path" if arm else "path"


@dataclass(frozen=True, eq=False)
class PathStack(TimedPath):
    """The path of the first end-effector, with those of the end-effectors of further arms.

    Twists are stacked, that of the first end-effector first; everything else that concerns one
    end-effector is that of the first.

    Attributes:
        first: The path of the first end-effector.
        further: Paths by the names of the arms, in the order of the model's, with its time law.

    Example:
        >>> lines = [[[0.9, y, 0.0], [0.6, y, 0.0]] for y in (0.2, -0.2)]
        >>> paths = [ff.EndEffectorPath(ff.paths.PolynomialCurve.line(*ends)) for ends in lines]
        >>> right, left = (ff.TimedPath(path, ff.Timing(20.0)) for path in paths)
        >>> stack = ff.paths.PathStack.of(right, {"left": left})
        >>> stack.twist(10.0).shape
        (12,)
    """

    first: TimedPath = field(kw_only=True, repr=False)
    further: Mapping[str, TimedPath] = field(kw_only=True, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        require_type("path.further", self.further, Mapping, "a map from arms to TimedPaths")
        for name, path in self.further.items():
            key = path_key(name)
            require_type(key, path, TimedPath, "a TimedPath")
            if (path.timing, path.stated[1]) != (self.timing, self.first.stated[1]):
                accepted = "the time law of the first, both in frames that tumble or neither"
                raise InputError(
                    key, "its time law or kind of frame is not that of the first path", accepted
                )
            if (path.drift != self.drift).any():
                problem = f"{path.drift.tolist()} was given"
                raise InputError(f"{key}.drift", problem, f"{self.drift.tolist()}, as the first")

    @classmethod
    def of(cls, first: TimedPath, further: Mapping[str, TimedPath]) -> PathStack:
        """The paths of arms, with that of the arm that the scenario names ``end_effector``."""
        return cls(first.path, first.timing, first.drift, first=first, further=dict(further))

    @property
    def by_arm(self) -> dict[str, TimedPath]:
        """See :class:`~freefloat.paths.timed_path.TimedPath`."""
        return {"": self.first, **self.further}

    def stretched(self, factor: float) -> PathStack:
        """See :class:`~freefloat.paths.timed_path.TimedPath`."""
        slower = {name: path.stretched(factor) for name, path in self.further.items()}
        return PathStack.of(self.first.stretched(factor), slower)

    def with_drift(self, drift: Array) -> PathStack:
        """See :class:`~freefloat.paths.timed_path.TimedPath`."""
        further = {name: path.with_drift(drift) for name, path in self.further.items()}
        return PathStack.of(self.first.with_drift(drift), further)

    @property
    def frame(self) -> str | None:
        """See :class:`~freefloat.paths.timed_path.TimedPath`."""
        return self.first.frame

    @property
    def stated(self) -> tuple[EndEffectorPath, Timing]:
        """See :class:`~freefloat.paths.timed_path.TimedPath`."""
        return self.first.stated

    @property
    def depends_on_time(self) -> bool:
        """See :class:`~freefloat.paths.timed_path.TimedPath`."""
        return any(path.depends_on_time for path in self.by_arm.values())

    @cached_property
    def breaks(self) -> Array:
        """See :class:`~freefloat.paths.timed_path.TimedPath`."""
        times = np.unique(np.concatenate([path.breaks for path in self.by_arm.values()]))
        return frozen(times[np.diff(times, prepend=0.0) > _APART * self.duration])

    def prescribed_between(self, start: float, end: float) -> Prescription:
        """See :class:`~freefloat.paths.timed_path.TimedPath`."""
        every = [path.prescribed_between(start, end) for path in self.by_arm.values()]

        def twists_and_speed(t: float) -> tuple[Array, float]:
            twists, speeds = zip(*(prescribed(t) for prescribed in every), strict=True)
            return np.concatenate(twists), speeds[0]

        return twists_and_speed

    def twist_and_speed(
        self, t: float | Array, segment: int | IntArray | None = None
    ) -> tuple[Array, Any]:
        """See :class:`~freefloat.paths.timed_path.TimedPath`."""
        every = (path.twist_and_speed(t, segment) for path in self.by_arm.values())
        twists, speeds = zip(*every, strict=True)
        return np.concatenate(twists, axis=-1), speeds[0]

    def twist_rate(self, t: float | Array, segment: int | IntArray | None = None) -> Array:
        """See :class:`~freefloat.paths.timed_path.TimedPath`."""
        rates = [path.twist_rate(t, segment) for path in self.by_arm.values()]
        return np.concatenate(rates, axis=-1)
