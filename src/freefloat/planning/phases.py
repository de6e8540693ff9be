"""Phases of a manoeuvre after its first path."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.redundancy import Redundancy
from freefloat.errors import InputError, finite_number, finite_vector, require_type
from freefloat.paths.relative_path import RelativePath
from freefloat.paths.timing import TimedPath
from freefloat.robot.parts import inertia_matrix
from freefloat.so3 import Array, Pose, frozen

FRAMES = ("inertial", "spacecraft", "base", "end_effector")
"""Frames of poses that are reached: that of the manoeuvre, or those of links at the beginning."""


@dataclass(frozen=True, eq=False)
class PoseGoal:
    """A pose that the end-effector moves to from where it is, and at which it rests.

    Attributes:
        pose: The pose.
        duration: [s].
        frame: ``"inertial"``, that of the manoeuvre; or, where the phase begins, ``"spacecraft"``,
            the root link, ``"base"``, the link that carries the first joint, or
            ``"end_effector"``.

    Example:
        >>> back = ff.so3.Pose([0.0, 0.0, -0.02], np.eye(3))
        >>> ff.PoseGoal(back, duration=15.0, frame="end_effector").frame
        'end_effector'
    """

    pose: Pose
    duration: float
    frame: str = "inertial"

    def __post_init__(self) -> None:
        require_type("goal.pose", self.pose, Pose, "a Pose")
        accepted = "a positive duration [s]"
        duration = finite_number("duration", self.duration, accepted, np.finfo(float).tiny)
        object.__setattr__(self, "duration", duration)
        if self.frame not in FRAMES:
            raise InputError("frame", f"{self.frame!r} was given", ", ".join(FRAMES))


@dataclass(frozen=True, eq=False)
class PathPhase:
    """A further path of the end-effector, from the state at which the phase before ends.

    Attributes:
        path: In the frame of the manoeuvre, in that of a body of the scene, or to a pose. It begins
            with the pose and the twist of the end-effector at the end of the phase before.
        name: Its name.
        margin: Required magnitude of the first path's measure.
        redundancy: Null-space motion of redundant arms.

    Example:
        >>> goal = ff.PoseGoal(ff.so3.Pose([0.0, 0.0, -0.02], np.eye(3)), 15.0, "end_effector")
        >>> ff.PathPhase(goal, "stop").name
        'stop'
    """

    path: TimedPath | RelativePath | PoseGoal = field(repr=False)
    name: str = "path"
    margin: float = 0.0
    redundancy: Redundancy | None = None

    def __post_init__(self) -> None:
        accepted = "a TimedPath, a RelativePath or a PoseGoal"
        require_type("path", self.path, TimedPath | RelativePath | PoseGoal, accepted)
        finite_number("margin", self.margin, "a magnitude of at least zero", 0.0)


@dataclass(frozen=True, eq=False)
class JointPhase:
    """A motion of the joints from where they are to given values, at which they rest.

    Attributes:
        joints: Values at the end, by name or shape (n,) [rad or m].
        duration: [s].
        name: Its name.

    Example:
        >>> ff.JointPhase({"q1": 0.2, "q2": -0.4}, duration=30.0, name="berth").duration
        30.0
    """

    joints: npt.ArrayLike | dict[str, float]
    duration: float
    name: str = "joints"

    def __post_init__(self) -> None:
        accepted = "a positive duration [s]"
        duration = finite_number("duration", self.duration, accepted, np.finfo(float).tiny)
        object.__setattr__(self, "duration", duration)


@dataclass(frozen=True, eq=False)
class CapturePhase:
    """A body of the scene is fixed to the end-effector, and becomes a payload of the robot.

    Attributes:
        body: Name of the body.
        mass: [kg].
        inertia: About its centre of mass, axes of its frame [kg m²], in the forms of
            :class:`~freefloat.robot.parts.Spacecraft`; by default that of its tumbling.
        com: Centre of mass in its frame [m], shape (3,); by default that of its tumbling, or zero.
        name: Name of the phase.

    Example:
        >>> ff.CapturePhase("client", mass=150.0, inertia=[28.0, 25.0, 30.0]).name
        'capture'
    """

    body: str
    mass: float
    inertia: Array | None = field(default=None, repr=False)
    com: Array | None = None
    name: str = "capture"

    def __post_init__(self) -> None:
        finite_number("mass", self.mass, "a mass above zero [kg]", np.finfo(float).tiny)
        if self.inertia is not None:
            object.__setattr__(self, "inertia", inertia_matrix("inertia", self.inertia))
        if self.com is not None:
            object.__setattr__(self, "com", frozen(finite_vector("com", self.com, 3)))


Phase = PathPhase | JointPhase | CapturePhase
