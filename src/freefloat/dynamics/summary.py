"""Summary of a robot: bodies, joints, largest measure, and the end-effector at given joints."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from freefloat.dynamics.joint_space import Extremes, joint_space_extremes, sampled_reach
from freefloat.dynamics.measures import SingularityMeasure, singularity_measure
from freefloat.dynamics.plane import Plane, plane_of, why_in_no_plane
from freefloat.dynamics.tasks import Task, accepted_tasks, prescribed_rows
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import InputError
from freefloat.robot.description import Severity, UrdfDiagnostic
from freefloat.robot.model import FreeFloatingModel
from freefloat.rotations import Rotation
from freefloat.so3 import UPRIGHT, Array, Pose, unit_quaternion


@dataclass(frozen=True, eq=False)
class Configuration:
    """A robot at given joints."""

    joints: Array  # joint values [rad or m], (n,)
    attitude: Array  # attitude of the spacecraft, unit quaternion x, y, z, w
    poses: dict[str, Pose]  # poses of the end-effector, by the frame that they are relative to
    measures: dict[str, float]  # values of singularity measures by name

    def to_dict(self) -> dict[str, Any]:
        """The configuration as a JSON document."""
        poses = {
            frame: {
                "position": pose.position.tolist(),
                "quaternion": pose.quaternion.tolist(),
                "rpy": roll_pitch_yaw(pose.rotation).tolist(),
            }
            for frame, pose in self.poses.items()
        }
        return {
            "joints": self.joints.tolist(),
            "attitude": self.attitude.tolist(),
            "end_effector": poses,
            "measures": self.measures,
        }


def frames_at(
    model: FreeFloatingModel, attitude: Array, joints: Array, first: int = 0
) -> dict[str, Pose]:
    """Poses of the spacecraft, the base and the inertial frame.

    The base is the link that carries an arm, of which ``first`` is the number of the first joint.
    """
    root = model.body_poses(attitude, joints)[0]
    _, carrier = model.link_places[model.moving_joints[first].parent]
    return {"spacecraft": root, "base": root @ carrier, "inertial": Pose(np.zeros(3), np.eye(3))}


def roll_pitch_yaw(rotation: Array) -> Array:
    """Angles about the fixed axes x, y, z, in this order, as in URDF [rad], shape (3,)."""
    with warnings.catch_warnings(action="ignore"):  # at a pitch of 90 degrees yaw is zero
        return np.asarray(Rotation.from_matrix(rotation).as_rpy())


@dataclass(frozen=True, eq=False)
class RobotSummary:
    """Summary of a robot.

    Attributes:
        model: The robot.
        task: The task of the extremes.
        measure: The singularity measure of the extremes.
        diagnostics: Warnings of the URDF.
        joints: Joint values at which the end-effector is described, if any.
        attitude: Attitude of the spacecraft with these joints; the identity when left out.
        contact_unchecked: Why motions are not searched for contact between bodies; None where they
            are.

    Raises:
        InputError: If an attitude is given without joints.
    """

    model: FreeFloatingModel
    task: Task
    measure: SingularityMeasure
    diagnostics: tuple[UrdfDiagnostic, ...] = ()
    joints: Sequence[float] | None = None
    attitude: Sequence[float] | None = None
    contact_unchecked: str | None = None

    def __post_init__(self) -> None:
        if self.joints is None and self.attitude is not None:
            raise InputError("attitude", "it was given without joints", "joints with it")

    @cached_property
    def configuration(self) -> Configuration | None:
        """The robot at the joints; an InputError unless it has these and the attitude is one."""
        if self.joints is None:
            return None
        q = self.model.joint_vector(self.joints)
        x = unit_quaternion("attitude", UPRIGHT if self.attitude is None else self.attitude)
        pose = self.model.end_effector_pose(x, q)
        frames = frames_at(self.model, x, q)
        poses = {name: frame.inverse() @ pose for name, frame in frames.items()}
        measures = singularity_measure(self.model, self.task, "gjm"), self.measure
        return Configuration(q, x, poses, {measure.name: measure(q) for measure in measures})

    @cached_property
    def extremes(self) -> Extremes:
        """Extremes of the measure over the joint space."""
        return joint_space_extremes(self.model, self.measure)

    @property
    def plane(self) -> Plane | None:
        """The plane of a planar task."""
        return plane_of(self.model) if self.task.planar else None

    @cached_property
    def reach(self) -> tuple[float, float]:
        """Smallest and largest distance found from the centre of mass to the end-effector [m]."""
        return sampled_reach(self.model.single_arms[0], self.task)

    @property
    def lengths(self) -> Array:
        """Lengths of the barycentric vectors [m], of planar tasks in the plane, shape (n + 1,)."""
        virtual = VirtualManipulator.of(self.model.single_arms[0])
        return virtual.lengths(None if self.plane is None else self.plane.normal)

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of ``freefloat info``."""
        model, measure, plane = self.model, self.measure, self.plane
        virtual = VirtualManipulator.of(model.single_arms[0])
        return {
            "urdf": model.description.source,
            "arguments": [asdict(argument) for argument in model.description.arguments],
            "end_effector": model.end_effector,
            "base": str(model.base),
            "total_mass": model.total_mass,
            "dof": model.dof,
            "task": str(self.task),
            "plane": plane and {"name": plane.name, "normal": plane.normal.tolist()},
            "spare_joints": model.arm_dof - len(prescribed_rows(model, self.task)),
            "joints": [
                {
                    "name": body.joint,
                    "type": "prismatic" if body.prismatic else "revolute",
                    "lower": body.lower if math.isfinite(body.lower) else None,
                    "upper": body.upper if math.isfinite(body.upper) else None,
                }
                for body in model.bodies[1:]
            ],
            "bodies": [
                {"moved_by": body.joint, "mass": body.mass, "centre_of_mass": body.centre.tolist(),
                 "inertia": body.inertia.tolist()}
                for body in model.bodies
            ],
            "barycentric_lengths": self.lengths.tolist(),
            "reach": list(self.reach),
            "reach_bound": virtual.reach,
            "measure": {
                "name": measure.name, "definition": measure.definition, "unit": measure.unit
            },
            "s_max": self.extremes.largest,
            "s_max_at": self.extremes.largest_at.tolist(),
            "s_min": self.extremes.smallest,
            "configuration": self.configuration and self.configuration.to_dict(),
            "contact_unchecked": self.contact_unchecked,
            "warnings": [
                str(entry) for entry in self.diagnostics if entry.severity == Severity.WARNING
            ],
            "findings": [asdict(entry) for entry in self.diagnostics],
            "not_read": [asdict(entry) for entry in model.not_read],
        }  # fmt: skip


def natural_task(model: FreeFloatingModel) -> Task:
    """The task with the most rows that an arm can do without a chosen axis, planar if it is.

    Raises:
        InputError: If the arm has too few joints for any task.
    """
    planar, others = plane_of(model) is not None, set(Task) - {Task.POINTING}
    joints = min(arm.dof for arm in model.single_arms)
    tasks = [task for task in others if task.planar is planar and len(task.rows) <= joints]
    if not tasks:
        where = "stays in a plane" if planar else f"leaves any plane: {why_in_no_plane(model)}"
        problem = f"the arm has {joints} joint{'s' * (joints != 1)} and {where}"
        raise InputError("end_effector", problem, accepted_tasks(model))
    return max(tasks, key=lambda task: len(task.rows))
