"""The surroundings of a robot: bodies beside it, and a corridor for the end-effector."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from freefloat.errors import InputError, finite_number, finite_vector, require_type
from freefloat.robot.model import FreeFloatingModel
from freefloat.scene.scene_body import EndEffectorPoses, SceneBody, SceneFrame
from freefloat.scene.tumbling import MOST_REVOLUTIONS, Tumbling
from freefloat.so3 import Array, Pose, frozen, unit_vector

FRAMES = ("inertial", "spacecraft", "base", "end_effector")
"""Names of frames of paths and goals, which no body of a scene has."""
_APEX = 1e-3
"""Points nearer to the apex of a cone than this are inside [m]."""


@dataclass(frozen=True, eq=False)
class Corridor:
    """A cone or a cylinder that the end-effector's origin must stay in.

    Attributes:
        point: Apex of the cone, or a point on the axis of the cylinder [m], shape (3,); in
            the path's frame, or in the frame of ``body``.
        axis: Direction from the apex into the cone, or of the cylinder's axis, same axes, shape
            (3,).
        half_angle: Largest angle between the axis and the line from the apex [rad]; what is less
            than 1 mm from the apex is inside.
        radius: Radius of the cylinder, which has no ends [m]; given instead of ``half_angle``.
        body: Name of the body of the scene that the corridor moves with.

    Raises:
        InputError: If not exactly one of ``half_angle`` and ``radius`` is given, or a value is out
            of range.

    Example:
        >>> corridor = ff.Corridor([2.0, 0.0, 0.0], [-1.0, 0.0, 0.0], half_angle=0.2)
        >>> round(float(corridor.deviation(np.array([1.0, 0.1, 0.0]))), 4)
        0.0997
    """

    point: Array
    axis: Array
    half_angle: float | None = None
    radius: float | None = None
    body: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", frozen(finite_vector("corridor.point", self.point, 3)))
        object.__setattr__(self, "axis", frozen(unit_vector("corridor.axis", self.axis)))
        if (self.half_angle is None) == (self.radius is None):
            accepted = "half_angle of a cone, or radius of a cylinder"
            raise InputError("corridor", "both or neither were given", accepted)
        key = "radius" if self.half_angle is None else "half_angle"
        largest, accepted = np.inf, "a length above zero [m]"
        if key == "half_angle":
            largest, accepted = math.pi / 2.0, "an angle above zero, at most pi / 2 [rad]"
        value = finite_number(f"corridor.{key}", getattr(self, key), accepted, 0.0, largest)
        if value == 0.0:
            raise InputError(f"corridor.{key}", "0 was given", accepted)
        object.__setattr__(self, key, value)
        require_type("corridor.body", self.body, str | None, "the name of a body of the scene")

    @property
    def allowed(self) -> float:
        """Largest deviation: the half angle [rad], or the radius [m]."""
        return float(self.radius if self.half_angle is None else self.half_angle)  # type: ignore[arg-type]

    def deviation(self, position: Array) -> Any:
        """Deviation of points (..., 3), in the corridor's frame, from the axis.

        Returns:
            For a cone the angle [rad], for a cylinder the distance [m], shape (...).
        """
        offset = position - self.point
        along = offset @ self.axis
        across = np.linalg.norm(offset - along[..., None] * self.axis, axis=-1)
        if self.half_angle is None:
            return across
        return np.where(np.hypot(along, across) < _APEX, 0.0, np.arctan2(across, along))[()]


@dataclass(frozen=True, eq=False)
class Scene:
    """The surroundings of a robot.

    Attributes:
        bodies: Bodies beside the robot.
        corridor: Where the end-effector's origin must stay.

    Raises:
        InputError: If two bodies have one name, or the corridor's body is unknown.

    Example:
        >>> tumbling = ff.Tumbling(inertia=[9.0, 7.0, 4.0], rate=[0.0, 0.02, 0.1])
        >>> client = ff.SceneBody("client", ff.Box([1.0, 1.0, 2.0]), [3.0, 0, 0], motion=tumbling)
        >>> corridor = ff.Corridor([0.0, 0.0, 1.0], [0.0, 0.0, 1.0], radius=0.3, body="client")
        >>> scene = ff.Scene([client], corridor)
        >>> problem = ff.load_scenario("spatial_6dof/line").problem().replace(scene=scene)
    """

    bodies: tuple[SceneBody, ...] = ()
    corridor: Corridor | None = None

    def __post_init__(self) -> None:
        accepted = "bodies, such as [SceneBody(name, shape)]"
        require_type("scene.bodies", self.bodies, Iterable, accepted)
        object.__setattr__(self, "bodies", tuple(self.bodies))
        for body in self.bodies:
            require_type("scene.bodies", body, SceneBody, "SceneBody(name, shape, position)")
        for frame in FRAMES:
            if frame in self.names:
                raise InputError("scene.bodies", f"{frame!r} is a frame", "another name")
        twice = [name for name, count in Counter(self.names).items() if count > 1]
        if twice:
            raise InputError("scene.bodies", f"two are named {twice[0]}", "distinct names")
        if self.corridor is not None:
            accepted = "Corridor(point, axis, half_angle) or Corridor(point, axis, radius=radius)"
            require_type("scene.corridor", self.corridor, Corridor, accepted)
            name = self.corridor.body
            if name is not None and name not in self.names:
                accepted = ", ".join(self.names) or "none, the scene has no bodies"
                raise InputError("scene.corridor.body", f"there is no {name!r}", accepted)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the bodies."""
        return tuple(body.name for body in self.bodies)

    def require_applicable(self, model: FreeFloatingModel, duration: float) -> None:
        """Raise an InputError if the scene does not suit a robot or a duration [s].

        It does not where a body has the name of a link, may touch an unknown link, or tumbles too
        often in that time.
        """
        links = model.description.links_by_name
        for body in self.bodies:
            if body.name in links:
                problem = f"{body.name!r} is a link of the robot"
                raise InputError("scene.bodies", problem, "names that no link has")
            for link in body.touch_links:
                if link not in links:
                    problem = f"{body.name}: there is no link {link!r}"
                    raise InputError("scene.bodies.touch_links", problem, ", ".join(links))
            if isinstance(body.motion, Tumbling):
                turns = body.motion.revolutions(duration)
                if turns > MOST_REVOLUTIONS:
                    problem = f"{body.name}: {turns:.4g} revolutions in {duration:g} s"
                    accepted = f"at most {MOST_REVOLUTIONS:g} revolutions"
                    raise InputError("scene.bodies.tumbling.rate", problem, accepted)

    @property
    def tumbles(self) -> bool:
        """Whether a body tumbles: the clearance then depends on time, not on the path alone."""
        return any(isinstance(body.motion, Tumbling) for body in self.bodies)

    def later(self, t: float, offset: Array) -> Scene:
        """The scene with time t [s] as time zero, moved by an offset [m], shape (3,)."""
        bodies = tuple(body.later(t, offset) for body in self.bodies)
        corridor = self.corridor
        if corridor is not None and corridor.body is None:
            corridor = replace(corridor, point=corridor.point + offset)
        return Scene(bodies, corridor)

    @cached_property
    def follows(self) -> bool:
        """Whether a body moves with the end-effector, or with what is prescribed for it."""
        return any(body.motion == "target" for body in self.bodies)

    @property
    def holds(self) -> bool:
        """Whether the robot holds a body."""
        return any(body.payload is not None for body in self.bodies)

    def poses(
        self, t: float | Array, frame: SceneFrame, end_effector: EndEffectorPoses | None = None
    ) -> tuple[Pose, ...]:
        """The frames of all bodies, see :meth:`freefloat.scene.scene_body.SceneBody.pose_at`."""
        return tuple(body.pose_at(t, frame, end_effector) for body in self.bodies)

    def corridor_pose(
        self, t: float | Array, frame: SceneFrame, end_effector: EndEffectorPoses | None = None
    ) -> Pose:
        """The frame of the corridor; arguments are as in :meth:`poses`."""
        if self.corridor is None or self.corridor.body is None:
            return Pose(frame.origin(t), np.broadcast_to(np.eye(3), (*np.shape(t), 3, 3)))
        body = self.bodies[self.names.index(self.corridor.body)]
        return body.pose_at(t, frame, end_effector)
