"""Goals in scenario files: of a scenario without path, and of phases."""

from __future__ import annotations

import numpy as np
from pydantic import model_validator

from freefloat.beyond.missions.goals.goal import Goal
from freefloat.io.scenario.field_types import (
    Name,
    Number,
    Orientation,
    Positive,
    Quaternion,
    Section,
    Vector,
    rotation_of,
)
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Pose


class PoseSection(Section):
    """A pose of the end-effector."""

    position: Vector
    """Position [m]."""
    orientation: Orientation | None = None
    """Default: along the axes of the frame."""
    frame: Name = "inertial"
    """Frame of both: ``inertial``, whose origin is the centre of mass at time zero; ``spacecraft``,
    ``base`` or ``end_effector``, where the motion begins; or a body of the scene at the end, whose
    twist the end-effector has then."""

    def to_pose(self, key: str) -> Pose:
        """The pose; raises an InputError that names keys below a key if the orientation is none."""
        rotation = np.eye(3)
        if self.orientation is not None:
            rotation = rotation_of(self.orientation, f"{key}.orientation")
        return Pose(np.array(self.position), rotation)


class GoalSection(Section):
    """What shall hold at the end of a motion of the joints: pose or joints, attitude, or both."""

    pose: PoseSection | None = None
    """Of the end-effector."""
    attitude: Quaternion | None = None
    """Of the spacecraft: x, y, z, w."""
    joints: list[Number] | dict[str, Number] | None = None
    """Joints [rad, m]: in the order of the chain, or by name."""
    duration: Positive | None = None
    """Duration [s]; default: the shortest one found that limits of rates and torques permit."""

    @model_validator(mode="after")
    def _asks_for_something(self) -> GoalSection:
        if (self.pose, self.attitude, self.joints) == (None, None, None):
            raise ValueError("pose, attitude or joints")
        return self

    def to_goal(self, model: FreeFloatingModel) -> Goal:
        """The goal; raises an InputError if a value is invalid, naming keys below ``goal``."""
        pose, frame = None, "inertial"
        if self.pose is not None:
            pose, frame = self.pose.to_pose("goal.pose"), self.pose.frame
        joints = None if self.joints is None else model.joint_vector(self.joints, "goal.joints")
        attitude = None if self.attitude is None else np.array(self.attitude)
        return Goal(pose, attitude, joints, frame, self.duration)
