"""Poses that the end-effector moves to from where it is."""

from __future__ import annotations

from dataclasses import dataclass

from freefloat.dynamics.summary import frames_at
from freefloat.errors import InputError, require_type
from freefloat.paths.time_laws import positive_duration
from freefloat.planning.phases.state import SystemState
from freefloat.so3 import Pose

FRAMES = ("inertial", "spacecraft", "base", "end_effector")
"""Reference frames of a pose: inertial, or a link's at the start of the phase."""


@dataclass(frozen=True, eq=False)
class PoseGoal:
    """A pose that the end-effector moves to from where it is, and at which it rests.

    Attributes:
        pose: The pose.
        duration: Duration of the path [s].
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
        object.__setattr__(self, "duration", positive_duration("duration", self.duration))
        if self.frame not in FRAMES:
            raise InputError("frame", f"{self.frame!r} was given", ", ".join(FRAMES))

    def pose_at(self, state: SystemState) -> Pose:
        """The pose from the present centre of mass, inertial axes."""
        if self.frame == "inertial":
            return Pose(self.pose.position - state.centre, self.pose.rotation)
        if self.frame == "end_effector":
            return state.pose @ self.pose
        links = frames_at(state.problem.model, state.attitude, state.joints)
        return links[self.frame] @ self.pose
