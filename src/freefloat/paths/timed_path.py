"""Paths travelled by a time law, relative to a centre of mass that may move."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import scipy

from freefloat.errors import finite_vector, require_type
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
        """Those of all end-effectors that follow a path."""
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

        ``[linear; angular]`` [m/s; rad/s], shape (6,) or (K, 6). Time [s] and segment are those of
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
