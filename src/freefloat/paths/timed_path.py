"""Paths travelled by a time law relative to a centre of mass; several at the same time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import scipy

from freefloat.errors import InputError, finite_vector, require_type
from freefloat.paths.curves import PolynomialCurve
from freefloat.paths.path import EndEffectorPath
from freefloat.paths.timing import Timing
from freefloat.so3 import Array, IntArray, Pose, frozen, zeros

_APART = 1e-6
"""Smallest distance of breaks, as a fraction of the duration."""

Prescription = Callable[[float], tuple[Array, float]]
"""Twist and path speed by time along a part of a timed path without jumps of its derivatives."""


@dataclass(frozen=True, eq=False)
class TimedPath:
    """A path, the time law by which it is travelled, and the velocity of the centre of mass.

    The path is given in a frame that does not move. Its origin is the place of the system's centre
    of mass at time zero. Poses and twists are relative to the centre of mass, which has the
    position ``drift * t`` in that frame.

    Attributes:
        path: The path by s.
        timing: s by time.
        drift: Velocity of the centre of mass [m/s], shape (3,).

    Example:
        >>> line = ff.paths.PolynomialCurve.line([1.6, 0.4, 0.0], [1.2, 0.9, 0.0])
        >>> path = ff.TimedPath(ff.EndEffectorPath(line), ff.Timing(20.0))
        >>> path.pose(20.0).position
        array([1.2, 0.9, 0. ])
    """

    path: EndEffectorPath
    timing: Timing
    drift: Array = field(default_factory=zeros)

    def __post_init__(self) -> None:
        require_type("path", self.path, EndEffectorPath, "EndEffectorPath(curve, orientation)")
        require_type("timing", self.timing, Timing, "Timing(duration), in seconds")
        object.__setattr__(self, "drift", frozen(finite_vector("drift", self.drift, 3)))

    @property
    def duration(self) -> float:
        """Duration of the path [s]."""
        return self.timing.duration

    @property
    def by_arm(self) -> dict[str, TimedPath]:
        """The paths of all end-effectors by the name of the arm, the first without a name."""
        return {"": self}

    @property
    def moves(self) -> bool:
        """Whether an end-effector moves relative to the centre of mass, or rotates."""
        return self.drifts or any(path.path.moves for path in self.by_arm.values())

    def stretched(self, factor: float) -> TimedPath:
        """The same path at another speed, its duration multiplied by a factor."""
        return replace(self, timing=self.timing.stretched(factor))

    def with_drift(self, drift: Array) -> TimedPath:
        """The same path, relative to a centre of mass with another velocity (3,) [m/s]."""
        return replace(self, drift=drift)

    def displaced(self, start: Array, end: Array | None = None) -> TimedPath:
        """The path at another place, moved by an offset (3,) [m]; of a line, ends may differ."""
        curve = self.path.curve.moved(Pose(start, np.eye(3)))
        if end is not None:
            curve = PolynomialCurve.line(curve(0.0), curve(1.0) + end - start)
        return replace(self, path=EndEffectorPath(curve, self.path.orientation))

    @property
    def frame(self) -> str | None:
        """Name of the body of the scene in whose frame the path is stated; None for none."""
        return None

    @property
    def stated(self) -> tuple[EndEffectorPath, Timing]:
        """The path and its time law in the frame in which they are stated."""
        return self.path, self.timing

    @property
    def depends_on_time(self) -> bool:
        """Whether poses depend on the time in addition to s."""
        return self.drifts

    @cached_property
    def drifts(self) -> bool:
        """Whether the centre of mass moves."""
        return bool(self.drift.any())

    @cached_property
    def drift_twist(self) -> Array:
        """Twist of the centre of mass in the path's frame, shape (6,)."""
        return frozen([*self.drift, 0.0, 0.0, 0.0])

    def origin(self, t: float | Array) -> Array:
        """The origin of the path's frame at times t [s] from the centre of mass [m], (..., 3)."""
        return np.multiply.outer(t, -self.drift)

    def pose(self, t: float | Array) -> Pose:
        """End-effector pose at time t [s] relative to the centre of mass; K poses at times (K,)."""
        pose = self.path.pose(self.timing.s(t))
        return Pose(pose.position + self.origin(t), pose.rotation)

    def poses(self, t: float | Array) -> tuple[Pose, ...]:
        """Poses of all end-effectors that follow a path, see :meth:`pose`."""
        return tuple(path.pose(t) for path in self.by_arm.values())

    def pose_at(self, s: float | Array) -> Pose:
        """The pose at a value of s; :meth:`pose` is more accurate near rests."""
        pose = self.path.pose(s)
        if not self.drifts:
            return pose
        return Pose(pose.position + self.origin(self.timing.time_at(s)), pose.rotation)

    def poses_at(self, s: float | Array) -> dict[str, Pose]:
        """The poses of all end-effectors at a value of s, as in :attr:`by_arm`."""
        return {arm: path.pose_at(s) for arm, path in self.by_arm.items()}

    @cached_property
    def breaks(self) -> Array:
        """Times [s], rising, at which high derivatives of the path or of the law jump."""
        times = [0.0]
        law = self.timing
        apart = _APART * self.duration
        for k, (low, high) in enumerate(pairwise((0.0, *law.ends))):
            first, last = law.s(low, 0, k), law.s(high, 0, k)
            for s in self.path.breaks[(self.path.breaks > first) & (self.path.breaks < last)]:
                t = scipy.optimize.brentq(
                    lambda t, s, k: law.s(t, 0, k) - s, low, high, (s, k),
                    xtol=1e-300,  # rtol alone decides
                )  # fmt: skip
                if t - times[-1] > apart and high - t > apart:
                    times.append(t)
            times.append(high)
        return frozen(times[1:-1])

    def prescribed_between(self, start: float, end: float) -> Prescription:
        """The twist and path speed between two times [s] without a break between them.

        They are also valid a little beyond.
        """
        drift, timing = self.drift_twist, self.timing
        segment = timing.segments[timing.segment_at((start + end) / 2.0)]
        low, high = sorted(segment(t, 0) for t in (start, end))
        tangent = self.path.tangent_within(low, high)

        def twist_and_speed(t: float) -> tuple[Array, float]:
            speed = segment(t, 1)
            return tangent(segment(t, 0)) * speed - drift, speed

        return twist_and_speed

    def twist(self, t: float | Array, segment: int | IntArray | None = None) -> Array:
        """End-effector twist relative to the centre of mass, inertial axes.

        ``[linear; angular]`` [m/s; rad/s], shape (6,) or (K, 6). Time [s] and segment are as for
        :meth:`Timing.s`.
        """
        return self.twist_and_speed(t, segment)[0]

    def twist_and_speed(
        self, t: float | Array, segment: int | IntArray | None = None
    ) -> tuple[Array, Any]:
        """The twist as in :meth:`twist`, and the speed ds/dt along the path [1/s]."""
        s, speed = self.timing.s(t, 0, segment), self.timing.s(t, 1, segment)
        return self.path.tangent(s) * speed[..., None] - self.drift_twist, speed

    def twist_rate(self, t: float | Array, segment: int | IntArray | None = None) -> Array:
        """Derivative of the twist by time, axes fixed [m/s²; rad/s²], shape (6,) or (K, 6).

        Where two segments of the law meet it may jump.
        """
        s, rate, change = (self.timing.s(t, order, segment) for order in range(3))
        bend, tangent = self.path.second_derivative(s), self.path.tangent(s)
        return np.asarray(bend * (rate**2)[..., None] + tangent * change[..., None])


def path_key(arm: str) -> str:
    """The key of an arm's path in scenario files; the first arm has no name."""
    return f"robot.arms.{arm}.law.path" if arm else "path"


@dataclass(frozen=True, eq=False)
class PathStack(TimedPath):
    """The path of the first end-effector, with the paths of the end-effectors of further arms.

    Twists are stacked, the twist of the first end-effector first; everything else that concerns one
    end-effector concerns the first.

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
        """The paths of arms, with the path of the arm that the scenario names ``end_effector``."""
        require_type("path.first", first, TimedPath, "a TimedPath")
        return cls(first.path, first.timing, first.drift, first=first, further=dict(further))

    @property
    def by_arm(self) -> dict[str, TimedPath]:
        """See :class:`TimedPath`."""
        return {"": self.first, **self.further}

    def stretched(self, factor: float) -> PathStack:
        """See :class:`TimedPath`."""
        slower = {name: path.stretched(factor) for name, path in self.further.items()}
        return PathStack.of(self.first.stretched(factor), slower)

    def with_drift(self, drift: Array) -> PathStack:
        """See :class:`TimedPath`."""
        further = {name: path.with_drift(drift) for name, path in self.further.items()}
        return PathStack.of(self.first.with_drift(drift), further)

    @property
    def frame(self) -> str | None:
        """See :class:`TimedPath`."""
        return self.first.frame

    @property
    def stated(self) -> tuple[EndEffectorPath, Timing]:
        """See :class:`TimedPath`."""
        return self.first.stated

    @property
    def depends_on_time(self) -> bool:
        """See :class:`TimedPath`."""
        return any(path.depends_on_time for path in self.by_arm.values())

    @cached_property
    def breaks(self) -> Array:
        """See :class:`TimedPath`."""
        times = np.unique(np.concatenate([path.breaks for path in self.by_arm.values()]))
        return frozen(times[np.diff(times, prepend=0.0) > _APART * self.duration])

    def prescribed_between(self, start: float, end: float) -> Prescription:
        """See :class:`TimedPath`."""
        prescriptions = [path.prescribed_between(start, end) for path in self.by_arm.values()]

        def twists_and_speed(t: float) -> tuple[Array, float]:
            twists, speeds = zip(*(prescribed(t) for prescribed in prescriptions), strict=True)
            return np.concatenate(twists), speeds[0]

        return twists_and_speed

    def twist_and_speed(
        self, t: float | Array, segment: int | IntArray | None = None
    ) -> tuple[Array, Any]:
        """See :class:`TimedPath`."""
        pairs = (path.twist_and_speed(t, segment) for path in self.by_arm.values())
        twists, speeds = zip(*pairs, strict=True)
        return np.concatenate(twists, axis=-1), speeds[0]

    def twist_rate(self, t: float | Array, segment: int | IntArray | None = None) -> Array:
        """See :class:`TimedPath`."""
        rates = [path.twist_rate(t, segment) for path in self.by_arm.values()]
        return np.concatenate(rates, axis=-1)
