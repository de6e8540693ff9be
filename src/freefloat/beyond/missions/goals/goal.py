"""Goals: what shall hold at the end of a motion whose way is free."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from freefloat.beyond.missions.goals.target import Target
from freefloat.dynamics.summary import frames_at
from freefloat.errors import InputError, finite_vector, number_array, require_type
from freefloat.motion.setting import Setting
from freefloat.paths.timing import positive_duration
from freefloat.records import Joints, Quaternions
from freefloat.robot.model import FreeFloatingModel
from freefloat.rotations import Rotation
from freefloat.scene.scene import FRAMES
from freefloat.scene.scene_body import SceneBody
from freefloat.so3 import UPRIGHT, Array, Pose, frozen, unit_quaternion

_LEVEL, _UPRIGHT = 1e-6, 1.0 - 1e-9
"""Height [m], and cosine of the tilt, of poses in a plane."""
_FARTHEST = 1e3
"""Largest value of a joint at the end [rad or m]."""


@dataclass(frozen=True, eq=False)
class Goal:
    """What shall hold at the end of a motion; the joints rest there, unless their rates are given.

    Attributes:
        pose: Pose of the end-effector, also as a ``pin.SE3``; None where it is free.
        attitude: Attitude of the spacecraft, unit quaternion x, y, z, w; None where it is free.
        joints: Joint values [rad or m], shape (n,); None where they are free.
        frame: Frame of the pose: ``"inertial"``, the frame of the manoeuvre; where the motion
            begins, ``"spacecraft"``, the root link, ``"base"``, the link that carries the first
            joint, or ``"end_effector"``; or the name of a body of the scene: the end-effector
            arrives with the body's twist, and the joints do not rest.
        duration: Duration [s]; None for the shortest one found that limits permit.
        joint_rates: Joint rates with the ``joints`` [rad/s or m/s], shape (n,); None for zero.

    Raises:
        InputError: If nothing is to be reached, or a value is of another kind.

    Example:
        >>> ff.Goal(joints=[0.2, -0.4], duration=30.0).duration
        30.0
    """

    pose: Pose | None = None
    attitude: Quaternions | None = None
    joints: Joints | None = None
    frame: str = "inertial"
    duration: float | None = None
    joint_rates: Joints | None = None

    def __post_init__(self) -> None:
        if self.pose is not None:
            object.__setattr__(self, "pose", Pose.of("goal.pose", self.pose))
        require_type("goal.pose.frame", self.frame, str, ", ".join(FRAMES) + ", or a body")
        if self.attitude is not None:
            attitude = frozen(unit_quaternion("goal.attitude", self.attitude))
            object.__setattr__(self, "attitude", attitude)
        if self.joints is None and self.joint_rates is not None:
            raise InputError("goal.joint_rates", "they were given", "joints, too")
        for name in ("joints", "joint_rates"):
            values, joints = vars(self)[name], vars(self)["joints"]
            if values is not None:
                size = number_array("goal.joints", joints, "finite numbers").size
                values = frozen(finite_vector(f"goal.{name}", values, size))
                object.__setattr__(self, name, values)
        if self.duration is not None:
            duration = positive_duration("goal.duration", self.duration)
            object.__setattr__(self, "duration", duration)
        if self.pose is None and self.attitude is None and self.joints is None:
            raise InputError("goal", "nothing is to be reached", "pose, attitude or joints")
        if self.pose is None and self.frame != "inertial":
            raise InputError("goal.pose.frame", "there is no pose", "a pose in this frame")
        if self.pose is not None and self.joints is not None:
            raise InputError("goal", "pose and joints were given", "one of them")

    def require_applicable(self, setting: Setting) -> None:
        """Raise an InputError where the goal does not suit robot, task and scene."""
        if self.joints is not None:
            require_inside(setting.model, self.joints, "goal.joints")
        if self.attitude is not None and setting.has_headings:
            setting.attitude(self.attitude, key="goal.attitude")
        bodies = [body.name for body in setting.scene.bodies if body.motion != "target"]
        known = [*FRAMES, *bodies]
        if self.frame not in known:
            raise InputError("goal.pose.frame", f"{self.frame!r} was given", ", ".join(known))
        if self.pose is not None and setting.task.planar:
            self._require_level(self.pose, setting)

    def _require_level(self, pose: Pose, setting: Setting) -> None:
        """Raise an InputError unless a pose is in the plane of a planar robot's end-effector."""
        model, body = setting.model, self.body(setting)
        straight = model.end_effector_pose(UPRIGHT, np.zeros(model.dof))
        seen = body.pose @ pose if body else self.pose_in(model, UPRIGHT, np.zeros(model.dof))
        there = cast(Pose, seen)
        plane, normal = setting.plane, setting.plane.normal
        height, level = normal @ there.position, normal @ straight.position
        slack = plane.tolerance * float(np.linalg.norm(there.position))
        if abs(height - level) > max(_LEVEL, slack):
            accepted = f"the plane of the end-effector, {plane.axis} = {level:g} m"
            given = f"it is at {plane.axis} = {height:g} m"
            raise InputError("goal.pose.position", given, accepted)
        if normal @ there.rotation @ straight.rotation.T @ normal < _UPRIGHT:
            given = "the end-effector would leave its plane"
            raise InputError("goal.pose.orientation", given, f"a rotation about {plane.axis}")

    def body(self, setting: Setting) -> SceneBody | None:
        """The body of the scene that the pose is relative to; None without one."""
        bodies = {body.name: body for body in setting.scene.bodies}
        return None if self.pose is None else bodies.get(self.frame)

    def seen_from(self, centre: Array) -> Goal:
        """The goal in a frame that begins at another place of the centre of mass.

        Args:
            centre: The place in the frame of this goal [m], shape (3,).
        """
        if self.pose is None or self.frame != "inertial":
            return self
        return replace(self, pose=Pose(self.pose.position - centre, self.pose.rotation))

    def pose_in(self, model: FreeFloatingModel, attitude: Array, joints: Array) -> Pose | None:
        """The pose of the end-effector from the centre of mass at the start; None without one."""
        if self.pose is None or self.frame == "inertial":
            return self.pose
        frames = frames_at(model, attitude, joints)
        frames["end_effector"] = model.end_effector_pose(attitude, joints)
        return frames[self.frame] @ self.pose

    def target(self, setting: Setting, attitude: Array, joints: Array) -> Target:
        """What the last state of a motion must be.

        Args:
            setting: Robot, momentum, drift and scene, from the centre of mass at the start.
            attitude: Attitude of the spacecraft at the start, unit quaternion x, y, z, w.
            joints: Joint values at the start, shape (n,).
        """
        body = self.body(setting)
        pose = self.pose if body else self.pose_in(setting.model, attitude, joints)
        wanted = None if self.attitude is None else Rotation.from_quat(self.attitude).as_matrix()
        return Target(setting, wanted, pose, body)

    def to_dict(self) -> dict[str, Any]:
        """The keys of a scenario's goal."""
        pose = self.pose and {
            "position": self.pose.position.tolist(),
            "orientation": self.pose.quaternion.tolist(),
            "frame": self.frame,
        }
        arrays = {
            "attitude": self.attitude, "joints": self.joints, "joint_rates": self.joint_rates,
        }  # fmt: skip
        values = {name: None if array is None else array.tolist() for name, array in arrays.items()}
        values |= {"pose": pose, "duration": self.duration}
        return {key: value for key, value in values.items() if value is not None}


def require_inside(model: FreeFloatingModel, joints: Joints, key: str) -> None:
    """Raise an InputError, naming a key, unless joints are a robot's, in their ranges."""
    values = model.joint_vector(joints, key)
    ranges = zip(model.joint_names, values, *model.joint_ranges, strict=True)
    for name, value, low, high in ranges:
        low, high = max(low, -_FARTHEST), min(high, _FARTHEST)
        if not low <= value <= high:
            accepted = f"{low:g} to {high:g} rad or m"
            raise InputError(key, f"{name} is {value:g}", accepted)
