"""The rigid bodies of a robot on Pinocchio: its joints, poses and configurations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from freefloat.attitude_grids import low_discrepancy
from freefloat.errors import InputError, ModelError, axes_of, finite_vector, member, number_array
from freefloat.robot.assembly import end_effector_link
from freefloat.robot.base import Base, require_gravity
from freefloat.robot.description import Joint, RobotDescription
from freefloat.robot.joint_values import configuration_vector
from freefloat.robot.not_read import NotRead
from freefloat.robot.rigid_bodies import (
    Body,
    ThreadData,
    body_of,
    build_model,
    joints_of_arms,
    moving_joints,
    require_uncoupled,
)
from freefloat.so3 import UPRIGHT, Array, Pose, frozen, wrapped

_CONFIGURATIONS = 8
"""Configurations in one of which the inertia must be regular."""
_REGULAR = 1e-12
"""Smallest ratio of the moments of a regular inertia."""


@dataclass(frozen=True, eq=False)
class RigidBodyModel:
    """What a :class:`~freefloat.FreeFloatingModel` is made of, and where its bodies are.

    Attributes:
        description: The valid URDF.
        end_effector: Name of the link, or of the joint that moves it, that follows the path.
        fixed_joints: Values of joints that are fixed, by name [rad or m]; for joints off the chain
            that are not named zero, or what they mimic.
        arms: End-effector links of further arms that move along joint curves, by the arm's name.
        path_arms: End-effector links of further arms that follow paths of their own, likewise.
        base: What the spacecraft is free to do, or its value, such as ``"planar"``.
        gravity: Gravity along -z on a table [m/s²], which joint torques have to bear.
        moving_joints: The joints that move, in the order of joint vectors.
        arm_dof: Number of joints of all arms that follow paths, the first in joint vectors.

    Raises:
        ModelError: If the robot has no such end-effector, no joint moves it, or it resists no
            rotation about some axis in any configuration.
    """

    description: RobotDescription
    end_effector: str
    fixed_joints: Mapping[str, float]
    arms: Mapping[str, str] = field(default_factory=dict)
    path_arms: Mapping[str, str] = field(default_factory=dict)
    base: Base = Base.FREE
    gravity: float = 0.0
    moving_joints: tuple[Joint, ...] = field(init=False, repr=False)
    arm_dof: int = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "base", member("base", Base, self.base))
        object.__setattr__(self, "gravity", require_gravity(self.gravity, self.base))
        joints = moving_joints(self.description, self.end_effector_link, self.fixed_joints)
        joints += joints_of_arms(self.description, self.path_arms, joints, self.fixed_joints)
        object.__setattr__(self, "arm_dof", len(joints))
        joints += joints_of_arms(self.description, self.arms, joints, self.fixed_joints)
        object.__setattr__(self, "moving_joints", joints)
        require_uncoupled(self.description, joints, self.fixed_joints)
        self._require_inertia()

    def _require_inertia(self) -> None:
        for joints in 2.0 * low_discrepancy(_CONFIGURATIONS, self.dof) - 1.0:
            q = self.configuration(UPRIGHT, joints)
            inertia = pin.computeCentroidalMap(self.pin_model, self.scratch, q)[3:, 3:6]
            free = inertia[2:, 2:] if self.on_table else inertia
            moments = np.abs(np.linalg.eigvalsh(free))
            if moments.min() > _REGULAR * moments.max():
                return
        shown = ", ".join(f"{moment:.3g}" for moment in moments)
        problem = f"the whole robot has the principal moments of inertia {shown} kg m²"
        accepted = "positive moments in the <inertia> of the spacecraft or the arm"
        raise ModelError("robot", problem, accepted, self.description.source)

    @cached_property
    def on_table(self) -> bool:
        """Whether the spacecraft moves along x and y and turns about z only."""
        return self.base is Base.PLANAR

    def __getstate__(self) -> dict[str, Any]:
        return {entry.name: getattr(self, entry.name) for entry in fields(self)}

    @cached_property
    def end_effector_link(self) -> str:
        """The link that follows the path, also where :attr:`end_effector` names a joint."""
        return end_effector_link(self.description, self.end_effector)

    @cached_property
    def _built(self) -> tuple[Any, Mapping[str, tuple[int, Pose]], ThreadData]:
        model, places = build_model(self.description, self.moving_joints, self.fixed_joints)
        model.gravity.linear = np.array([0.0, 0.0, -self.gravity])
        return model, places, ThreadData(model)

    @property
    def pin_model(self) -> Any:
        """The Pinocchio model: free-flyer root, moving joints, a frame for each link.

        It is not to be changed; a copy may be.
        """
        return self._built[0]

    @property
    def link_places(self) -> Mapping[str, tuple[int, Pose]]:
        """The body that each link is part of, and the link's frame in that body's joint frame.

        Bodies are numbered as in :attr:`bodies`: 0 is the spacecraft.
        """
        return self._built[1]

    @property
    def scratch(self) -> Any:
        """This thread's Pinocchio data of the model; values read from it must be copied."""
        return self._built[2].data

    @cached_property
    def end_effector_links(self) -> tuple[str, ...]:
        """Links that follow paths: :attr:`end_effector_link`, then the links of further arms."""
        return (self.end_effector_link, *self.path_arms.values())

    @cached_property
    def frame_ids(self) -> tuple[int, ...]:
        """Pinocchio's indices of the frames of :attr:`end_effector_links`."""
        return tuple(
            int(self.pin_model.getFrameId(link, pin.BODY)) for link in self.end_effector_links
        )

    @cached_property
    def frame_id(self) -> int:
        """Pinocchio's index of the end-effector frame."""
        return self.frame_ids[0]

    @property
    def not_read(self) -> tuple[NotRead, ...]:
        """What the files of the robot say and freefloat does not use."""
        return self.description.not_read

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the moving joints, from the spacecraft to the end-effector."""
        return tuple(joint.name for joint in self.moving_joints)

    @property
    def dof(self) -> int:
        """Number of moving joints, of which ``arm_dof`` belong to arms that follow paths."""
        return len(self.moving_joints)

    @cached_property
    def total_mass(self) -> float:
        """Mass of the whole system [kg]."""
        return float(pin.computeTotalMass(self.pin_model))

    @cached_property
    def bodies(self) -> tuple[Body, ...]:
        """The spacecraft and the bodies moved by each joint, in order."""
        joints = (None, *self.moving_joints)
        return tuple(body_of(self.pin_model, k + 1, joint) for k, joint in enumerate(joints))

    @cached_property
    def moved_by(self) -> npt.NDArray[np.bool_]:
        """Which joints move each body relative to the spacecraft, shape (1 + n, n)."""
        moved = np.zeros((1 + self.dof, self.dof), dtype=bool)
        for number, body in enumerate(self.bodies[1:], start=1):
            moved[number] = moved[body.parent]
            moved[number, number - 1] = True
        moved.setflags(write=False)
        return moved

    @cached_property
    def joint_ranges(self) -> tuple[Array, Array]:
        """Lower and upper ends of the joints' ranges [rad or m], infinite where there are none."""
        lower, upper = np.array([(body.lower, body.upper) for body in self.bodies[1:]]).T
        return frozen(lower), frozen(upper)

    @cached_property
    def prismatic(self) -> npt.NDArray[np.bool_]:
        """Which joints are prismatic, shape (n,)."""
        prismatic = np.array([joint.type == "prismatic" for joint in self.moving_joints])
        prismatic.setflags(write=False)
        return prismatic

    @cached_property
    def tool(self) -> Pose:
        """The end-effector's frame in the frame of the last joint."""
        return self.link_places[self.end_effector_link][1]

    @cached_property
    def body_names(self) -> tuple[str, ...]:
        """A link for each body: the root link, then the children of the moving joints."""
        return (self.description.roots[0], *(joint.child for joint in self.moving_joints))

    def configuration(self, attitude: npt.ArrayLike, joints: npt.ArrayLike) -> Array:
        """Pinocchio's configuration vector with the system's centre of mass at the origin.

        On a table the origin is below or above it, at the height of the spacecraft's root link.

        Args:
            attitude: Unit quaternion x, y, z, w, shape (4,) or (K, 4).
            joints: Joint values, shape (n,) or (K, n).

        Returns:
            ``[base position, base quaternion, joints]``, shape (7 + n,) or (K, 7 + n).

        Raises:
            InputError: If the attitude is no unit quaternion, the joints are not as many finite
                numbers as move, or there are not as many of both.
        """
        if 2 in (axes_of(attitude), axes_of(joints)):
            attitudes = np.atleast_2d(number_array("attitude", attitude, "quaternions x, y, z, w"))
            rows = np.atleast_2d(number_array("joints", joints, "numbers, shape (K, n)"))
            count = max(len(attitudes), len(rows))
            if {len(attitudes), len(rows)} - {1, count}:
                accepted = f"shape ({len(attitudes)}, {self.dof}), joints for each attitude"
                raise InputError("joints", f"shape {rows.shape} was given", accepted)
            states = ((attitudes[k % len(attitudes)], rows[k % len(rows)]) for k in range(count))
            return np.array([self.configuration(*state) for state in states])
        q = configuration_vector(attitude, joints, self.dof)
        q[:3] = -pin.centerOfMass(self.pin_model, self.scratch, q)
        if self.on_table:
            q[2] = 0.0
        return q

    def base_position(self, attitude: npt.ArrayLike, joints: npt.ArrayLike) -> Array:
        """Origin of the spacecraft's root link in the inertial frame [m], shape (..., 3)."""
        return self.configuration(attitude, joints)[..., :3]

    def end_effector_pose(self, attitude: npt.ArrayLike, joints: npt.ArrayLike) -> Pose:
        """Pose of the end-effector in the inertial frame, see :meth:`configuration`."""
        return self.end_effector_poses(attitude, joints)[0]

    def end_effector_poses(
        self, attitude: npt.ArrayLike, joints: npt.ArrayLike
    ) -> tuple[Pose, ...]:
        """Poses of :attr:`end_effector_links` in the inertial frame, K of each for K states."""
        return self._poses(attitude, joints, lambda data: [data.oMf[k] for k in self.frame_ids])

    def body_poses(self, attitude: npt.ArrayLike, joints: npt.ArrayLike) -> tuple[Pose, ...]:
        """Poses of the bodies' joint frames in the inertial frame, the root link's first."""
        return self._poses(attitude, joints, lambda data: data.oMi.tolist()[1:])

    def _poses(
        self, attitude: npt.ArrayLike, joints: npt.ArrayLike, places: Callable[[Any], list[Any]]
    ) -> tuple[Pose, ...]:
        q, matrices = self.configuration(attitude, joints), []
        for row in np.atleast_2d(q):
            pin.framesForwardKinematics(self.pin_model, self.scratch, row)
            matrices.append([place.homogeneous for place in places(self.scratch)])
        poses = np.swapaxes(matrices, 0, 1) if q.ndim == 2 else np.array(matrices[0])
        return tuple(Pose(pose[..., :3, 3], pose[..., :3, :3]) for pose in poses)

    def joint_vector(
        self, joints: Mapping[str, float] | npt.ArrayLike, key: str = "joints"
    ) -> Array:
        """Values of all joints or of the arm's on the path, from a map by name or in chain order.

        Raises:
            InputError: Naming ``key``, if a joint is missing or unknown, or a value is not finite.
        """
        values: Any = joints
        if not isinstance(joints, Mapping):
            values = np.atleast_1d(number_array(key, joints, ", ".join(self.joint_names)))
        names = self.joint_names[: self.arm_dof if len(values) == self.arm_dof else None]
        if isinstance(joints, Mapping):
            if set(joints) != set(names):
                problem = f"values of {', '.join(map(str, joints)) or 'no joint'} were given"
                raise InputError(key, problem, f"values of {', '.join(names)}")
            values = [joints[name] for name in names]
        return finite_vector(key, values, len(names))

    def joint_distance(self, first: npt.ArrayLike, second: npt.ArrayLike) -> Array:
        """Largest differences (...) of joint values (..., n), modulo 2 pi for revolute joints.

        Only the joints of arms that follow paths count.
        """
        arm = slice(self.arm_dof)
        difference = np.asarray(first)[..., arm] - np.asarray(second)[..., arm]
        modulo = np.where(self.prismatic[arm], difference, wrapped(difference))
        return np.asarray(np.abs(modulo).max(axis=-1))
