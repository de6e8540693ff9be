"""Paths in the frame of a body of the scene, which may tumble."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np

from freefloat.errors import InputError, require_type
from freefloat.paths.curves import Curve
from freefloat.paths.orientation import FreeOrientation, OrientationLaw
from freefloat.paths.path import EndEffectorPath
from freefloat.paths.timed_path import TimedPath
from freefloat.paths.timing import TimeLaw, Timing
from freefloat.scene.scene_body import SceneBody
from freefloat.scene.tumbling import Tumbling
from freefloat.so3 import Array, cross, frozen, turned


@dataclass(frozen=True, eq=False)
class RelativePath:
    """A path and its time law relative to a body of the scene.

    An end-effector that rests relative to the body moves with it: its velocity is matched wherever
    the time law rests.

    Attributes:
        body: The body, which is fixed or tumbles.
        path: Path in the frame of the body.
        timing: Time law of the path in this frame.

    Raises:
        InputError: If the body moves with the target of the path.

    Example:
        >>> tumbling = ff.Tumbling(inertia=[9.0, 7.0, 4.0], rate=[0.0, 0.0, 0.1])
        >>> client = ff.SceneBody("client", ff.Box([1.0, 1.0, 2.0]), [3.0, 0, 0], motion=tumbling)
        >>> line = ff.paths.PolynomialCurve.line([-1.2, 0.0, 0.0], [-0.6, 0.0, 0.0])
        >>> relative = ff.paths.RelativePath(client, ff.EndEffectorPath(line), ff.Timing(20.0))
        >>> relative.timed().twist(20.0).round(4)  # twist of the point of the client
        array([ 0.0546,  0.025 , ...])
    """

    body: SceneBody
    path: EndEffectorPath = field(repr=False)
    timing: Timing

    def __post_init__(self) -> None:
        require_type("path.body", self.body, SceneBody, "a SceneBody")
        require_type("path", self.path, EndEffectorPath, "EndEffectorPath(curve, orientation)")
        require_type("timing", self.timing, Timing, "Timing(duration), in seconds")
        if self.body.motion == "target":
            accepted = "a body of the scene that is fixed or tumbles"
            raise InputError("path.frame", f"{self.body.name} moves with the path", accepted)
        if self.timing.is_sought:
            problem = f"optimal, with a path that moves with {self.body.name}"
            raise InputError("timing.law", problem, "another law, or a path that does not move")

    def timed(self, drift: Array | None = None) -> BodyPath:
        """The path in the frame of the scene, by time.

        Args:
            drift: As for :class:`~freefloat.paths.timed_path.TimedPath`.
        """
        orientation: OrientationLaw = FreeOrientation()
        if not isinstance(self.path.orientation, FreeOrientation):
            orientation = RelativeOrientation(self, self.path.orientation)
        path = EndEffectorPath(RelativeCurve(self, self.path.curve), orientation)
        timing = Timing(self.timing.duration, TimeLaw.UNIFORM)
        return BodyPath(path, timing, np.zeros(3) if drift is None else drift, relative=self)

    @cached_property
    def breaks(self) -> Array:
        """Fractions of the duration, rising, inside (0, 1), at which high derivatives jump."""
        if not self.path.moves:
            return frozen([])
        return frozen(TimedPath(self.path, self.timing).breaks / self.timing.duration)

    def segment(self, low: float, high: float) -> tuple[int, float, float]:
        """Segment of the time law between two fractions of the duration, and s at these."""
        first, last = low * self.timing.duration, high * self.timing.duration
        number = self.timing.segment_at((first + last) / 2.0)
        ends = sorted(self.timing.s(t, 0, number) for t in (first, last))
        return number, ends[0], ends[1]


@dataclass(frozen=True, eq=False)
class BodyPath(TimedPath):
    """A relative path in the frame of the scene, by time."""

    relative: RelativePath = field(kw_only=True, repr=False)  # the path in the frame of the body

    def stretched(self, factor: float) -> BodyPath:
        """See :class:`~freefloat.paths.timed_path.TimedPath`; the body moves as before."""
        slower = self.relative.timing.stretched(factor)
        return replace(self.relative, timing=slower).timed(self.drift)

    @property
    def frame(self) -> str:
        """See :class:`~freefloat.paths.timed_path.TimedPath`."""
        return self.relative.body.name

    @property
    def stated(self) -> tuple[EndEffectorPath, Timing]:
        """See :class:`~freefloat.paths.timed_path.TimedPath`."""
        return self.relative.path, self.relative.timing

    @property
    def depends_on_time(self) -> bool:
        """See :class:`~freefloat.paths.timed_path.TimedPath`."""
        return True


class RelativeCurve(Curve):
    """The curve of a relative path in the frame of the scene, by the fraction of its duration.

    Attributes:
        relative: The path.
    """

    def __init__(self, relative: RelativePath, curve: Curve, segment: int | None = None) -> None:
        """Prepare a curve in the body's frame, in a segment of the time law."""
        self.relative, self._curve, self._segment = relative, curve, segment

    @cached_property
    def breaks(self) -> Array:
        """See :class:`~freefloat.paths.curves.Segmented`."""
        return self.relative.breaks

    def within(self, low: float, high: float) -> Self:
        """See :class:`~freefloat.paths.curves.Segmented`."""
        segment, *ends = self.relative.segment(low, high)
        return type(self)(self.relative, self._curve.within(*ends), segment)

    def __call__(self, s: float | Array, order: int = 0) -> Array:
        """See :class:`~freefloat.paths.curves.Curve`."""
        body, timing = self.relative.body, self.relative.timing
        t, tumbling = s * timing.duration, body.motion
        com = tumbling.com if isinstance(tumbling, Tumbling) else np.zeros(3)
        place, speed, change = (timing.s(t, k, self._segment)[..., None] for k in range(3))
        place = place[..., 0]
        r = self._curve(place) - com
        v, a = np.zeros_like(r), np.zeros_like(r)
        if order > 0:
            v = self._curve(place, 1) * speed
        if order > 1:
            a = self._curve(place, 2) * speed**2 + self._curve(place, 1) * change
        R = body.orientation
        if isinstance(tumbling, Tumbling):
            omega = tumbling.angular_velocity(t)
            R = R @ tumbling.rotation(t)
            a = a + cross(tumbling.acceleration(omega), r) + cross(omega, 2.0 * v + cross(omega, r))
            v = v + cross(omega, r)
        if order == 0:
            return np.asarray(body.position + body.orientation @ com + turned(R, r))
        return turned(R, v if order == 1 else a) * timing.duration**order


class RelativeOrientation(OrientationLaw):
    """The orientation of a relative path in the frame of the scene; as :class:`RelativeCurve`."""

    def __init__(
        self, relative: RelativePath, law: OrientationLaw, segment: int | None = None
    ) -> None:
        """Prepare a law in the body's frame, in a segment of the time law."""
        self.relative, self._law, self._segment = relative, law, segment

    @cached_property
    def breaks(self) -> Array:
        """See :class:`~freefloat.paths.curves.Segmented`."""
        return self.relative.breaks

    def within(self, low: float, high: float) -> Self:
        """See :class:`~freefloat.paths.curves.Segmented`."""
        segment, *ends = self.relative.segment(low, high)
        return type(self)(self.relative, self._law.within(*ends), segment)

    def rotation(self, s: float | Array) -> Array:
        """See :class:`~freefloat.paths.orientation.OrientationLaw`."""
        t = s * self.relative.timing.duration
        place = self.relative.timing.s(t, 0, self._segment)
        return np.asarray(self._axes(t) @ self._law.rotation(place))

    def rate(self, s: float | Array) -> Array:
        """See :class:`~freefloat.paths.orientation.OrientationLaw`."""
        timing, tumbling = self.relative.timing, self.relative.body.motion
        t = s * timing.duration
        place, speed = (timing.s(t, k, self._segment) for k in range(2))
        rate = self._law.rate(place) * speed[..., None]
        if isinstance(tumbling, Tumbling):
            rate = rate + tumbling.angular_velocity(t)
        return turned(self._axes(t), rate) * timing.duration

    def _axes(self, t: float | Array) -> Array:
        """Axes of the body at times [s], shape (3, 3) or (K, 3, 3)."""
        body = self.relative.body
        if isinstance(body.motion, Tumbling):
            return np.asarray(body.orientation @ body.motion.rotation(t))
        return body.orientation
