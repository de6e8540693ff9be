"""Goals: what shall hold at the end of a motion whose way is free."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from freefloat.errors import InputError, require_type
from freefloat.paths.time_laws import positive_duration
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, Pose, frozen, unit_quaternion

FRAMES = ("inertial", "spacecraft", "base", "end_effector")
"""Reference frames of a pose that are no bodies of the scene: inertial, or a link's at the start."""
_FARTHEST = 1e3
"""Largest value of a joint at the end [rad or m]."""


@dataclass(frozen=True, eq=False)
class Goal:
    """What shall hold at the end of a motion; the joints rest there.

    Attributes:
        pose: Of the end-effector; None where it is free.
        attitude: Of the spacecraft, unit quaternion x, y, z, w; None where it is free.
        joints: Joint values [rad or m], by name or shape (n,); None where they are free.
        frame: Of the pose: ``"inertial"``, that of the manoeuvre; where the motion begins,
            ``"spacecraft"``, the root link, ``"base"``, the link that carries the first joint, or
            ``"end_effector"``; or the name of a body of the scene, with which the end-effector
            moves when it arrives.
        duration: [s]; None for the shortest one that limits permit.

    Raises:
        InputError: If nothing is to be reached, or a value is of another kind.

    Example:
        >>> ff.Goal(joints=[0.2, -0.4], duration=30.0).duration
        30.0
    """

    pose: Pose | None = None
    attitude: npt.ArrayLike | None = None
    joints: Mapping[str, float] | npt.ArrayLike | None = field(default=None)
    frame: str = "inertial"
    duration: float | None = None

    def __post_init__(self) -> None:
        require_type("goal.pose", self.pose, Pose | None, "a Pose")
        require_type("goal.frame", self.frame, str, "inertial, spacecraft, base, or a body")
        if self.attitude is not None:
            attitude = frozen(unit_quaternion("goal.attitude", self.attitude))
            object.__setattr__(self, "attitude", attitude)
        if self.duration is not None:
            duration = positive_duration("goal.duration", self.duration)
            object.__setattr__(self, "duration", duration)
        if self.pose is None and self.attitude is None and self.joints is None:
            raise InputError("goal", "nothing is to be reached", "pose, attitude or joints")
        if self.pose is not None and self.joints is not None and self.attitude is not None:
            problem = "pose, attitude and joints were given"
            raise InputError("goal", problem, "two of them: the third one follows")

    def joint_vector(self, model: FreeFloatingModel) -> Array | None:
        """The joints at the end, shape (n,); None where they are free.

        Raises:
            InputError: If they are not those of the robot, or out of their ranges.
        """
        if self.joints is None:
            return None
        values = model.joint_vector(self.joints, "goal.joints")  # type: ignore[arg-type]
        for name, value, low, high in zip(
            model.joint_names, values, *model.joint_ranges, strict=True
        ):
            low, high = max(low, -_FARTHEST), min(high, _FARTHEST)
            if not low <= value <= high:
                accepted = f"{low:g} to {high:g} rad or m"
                raise InputError("goal.joints", f"{name} is {value:g}", accepted)
        return values

    def to_dict(self) -> dict[str, Any]:
        """The keys of a scenario's goal."""
        joints = self.joints
        if joints is not None and not isinstance(joints, Mapping):
            joints = np.asarray(joints).tolist()
        pose = self.pose and {
            "position": self.pose.position.tolist(),
            "orientation": self.pose.quaternion.tolist(),
            "frame": self.frame,
        }
        attitude = None if self.attitude is None else np.asarray(self.attitude).tolist()
        values = {"pose": pose, "attitude": attitude, "joints": joints, "duration": self.duration}
        return {key: value for key, value in values.items() if value is not None}
