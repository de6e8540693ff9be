"""The rigid-body model of a free-floating robot."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from freefloat.attitude_grids import low_discrepancy
from freefloat.errors import InputError, ModelError, finite_vector, member, require_type
from freefloat.robot.assembly import assemble, end_effector_link, scaled
from freefloat.robot.base import Base, require_gravity
from freefloat.robot.bundled import find_robot
from freefloat.robot.description import Joint, RobotDescription, UrdfDiagnostic
from freefloat.robot.joint_values import configuration_vector
from freefloat.robot.not_read import NotRead
from freefloat.robot.parts import Attachment, Payload, Spacecraft
from freefloat.robot.pinocchio_model import described
from freefloat.robot.rigid_bodies import (
    Body,
    ThreadData,
    body_of,
    build_model,
    joints_of_arms,
    moving_joints,
    require_uncoupled,
    require_within_ranges,
)
from freefloat.robot.source import RobotSource
from freefloat.so3 import UPRIGHT, Array, Pose, frozen, wrapped

_CONFIGURATIONS = 8
"""Configurations in one of which the inertia must be regular."""
_REGULAR = 1e-12
"""Smallest ratio of the moments of a regular inertia."""


@dataclass(frozen=True, eq=False)
class FreeFloatingModel:
    """A spacecraft with an arm: no external force, no actuation of the base.

    The joints between the spacecraft and the end-effector move, except those that are fixed by
    name, and those of further arms that are named; all other joints of the robot are fixed, those
    that mimic others where these have them. Joint
    vectors list the moving joints from the spacecraft to the end-effector, then those of the
    further arms, arms that follow paths first, see :attr:`joint_names`. Methods refuse other
    attitudes than unit quaternions and other joint values than ``dof`` finite numbers.

    Attributes:
        description: The valid URDF.
        end_effector: Name of the link, or of the joint that moves it, that follows the path.
        fixed_joints: Values of joints that are fixed, by name [rad or m]; for joints off the chain
            that are not named zero, or what they mimic.
        arms: End-effector links of further arms that move along joint curves, by the arm's name.
        path_arms: Those of further arms that follow paths of their own, see :meth:`with_paths`.
        base: What the spacecraft is free to do, or its value, such as ``"planar"``.
        gravity: Gravity along -z on a table [m/s²], which joint torques have to bear.
        moving_joints: The joints that move, from the spacecraft to the end-effector, then those of
            the further arms.
        arm_dof: Number of joints of all arms that follow paths, the first in joint vectors.

    Raises:
        ModelError: If the robot has no such end-effector, no joint moves it, or it resists no
            rotation about some axis in any configuration.

    Example:
        >>> model = ff.FreeFloatingModel.from_urdf("planar_3dof", "end_effector")
        >>> model.joint_names
        ('q1', 'q2', 'q3')
        >>> model.total_mass
        471.0
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
        gravity = require_gravity(self.gravity, self.base)
        object.__setattr__(self, "gravity", gravity)
        joints = moving_joints(self.description, self.end_effector_link, self.fixed_joints)
        joints += joints_of_arms(self.description, self.path_arms, joints, self.fixed_joints)
        object.__setattr__(self, "arm_dof", len(joints))
        joints += joints_of_arms(self.description, self.arms, joints, self.fixed_joints)
        object.__setattr__(self, "moving_joints", joints)
        require_uncoupled(self.description, joints, self.fixed_joints)
        self._require_inertia()

    @classmethod
    def from_urdf(
        cls,
        urdf: str | Path | RobotSource,
        end_effector: str | None = None,
        *,
        scale_mass: float | Mapping[str, float] = 1.0,
        fixed_joints: Mapping[str, float] | None = None,
        arms: Mapping[str, str] | None = None,
        spacecraft: Spacecraft | None = None,
        payload: Payload | None = None,
        attached: Sequence[Attachment] = (),
        base: Base | str | None = None,
        gravity: float = 0.0,
    ) -> FreeFloatingModel:
        """Load a robot whose root link is the spacecraft, or an arm with its spacecraft.

        Args:
            urdf: A URDF, xacro or MJCF file, XML text of a URDF, or a name: of a bundled robot, as
                ``"spatial_6dof"``, ``"example-robot-data:ur10"``, ``"robot_descriptions:panda"``;
                or a source, with what the reader of a xacro or MJCF file has to know.
            end_effector: Link that follows the path; optional where the robot has a single last
                link.
            scale_mass: Factor on every mass and inertia, or a map from link to factor.
            fixed_joints: Values of joints that do not move, by name [rad or m]; zero for joints off
                the chain that are not named.
            arms: End-effector links of further arms that move, by the arm's name.
            spacecraft: Carries the arm, see :func:`~freefloat.robot.assembly.assemble`.
            payload: Fixed to the end-effector.
            attached: Further URDFs, fixed to links.
            base: What the spacecraft is free to do, ``"free"`` or ``"planar"``; default: what the
                file says, otherwise free.
            gravity: Along -z on a table [m/s²], for joint torques.

        Raises:
            InputError: If a part or a factor has another type, or a fixed joint is out of range.
            ModelError: If there is no such URDF, it has errors, it has no such end-effector, or no
                joint moves that.
        """
        source = RobotSource.of(urdf)
        require_type("end_effector", end_effector, str | None, "the name of a link")
        accepted = "a map from joint to value"
        require_type("fixed_joints", fixed_joints, Mapping | None, accepted)
        require_type("arms", arms, Mapping | None, "a map from the name of an arm to a link")
        if not source.exists:
            try:
                source = replace(source, urdf=find_robot(str(source.urdf), Path()))
            except InputError as error:
                raise ModelError(error.key, error.problem, error.accepted) from None
        description = assemble(source, spacecraft, payload, end_effector, attached)
        if np.any(scale_mass != 1.0):
            description = scaled(description, scale_mass)
        if end_effector is None:
            end_effector = end_effector_link(description, None)
        require_within_ranges(description, fixed_joints or {})
        fixed, further = dict(fixed_joints or {}), dict(arms or {})
        base = description.base if base is None else member("base", Base, base)
        return cls(description, end_effector, fixed, further, base=base, gravity=gravity)

    @classmethod
    def from_pinocchio(
        cls, model: pin.Model, end_effector: str, *, geometry: Any = None, gravity: float = 0.0
    ) -> FreeFloatingModel:
        """Take over a robot from Pinocchio; its model is read, and not kept.

        What a free-flyer or planar root joint moves is the spacecraft, on a table if the joint is
        planar; without such a joint it is what is fixed to the universe. Only what the root carries
        is taken over. Revolute and prismatic joints to the end-effector move, in Pinocchio's order;
        all others are fixed at neutral. Bodies and frames become links; the mass of all bodies that
        one joint moves is in the first of them.

        Args:
            model: Pinocchio's model, also one with joints that were fixed by ``buildReducedModel``.
            end_effector: Frame that follows the path; of several with the name, the body.
            geometry: A ``pin.GeometryModel`` for collision and pictures, or a pair of them: for
                collision, for pictures. Collision pairs of theirs are not used.
            gravity: As for :meth:`from_urdf`; the model's own, which is 9.81 m/s² unless it is set,
                is not used.

        Raises:
            InputError: If an argument has another type.
            ModelError: If there is no such frame or no spacecraft, a joint on the way to the frame
                is neither revolute nor prismatic, or a shape is neither a mesh with a file nor a
                box, sphere, cylinder or capsule.

        Example:
            >>> import pinocchio as pin
            >>> robot = ff.FreeFloatingModel.from_urdf("ets_vii")
            >>> ff.FreeFloatingModel.from_pinocchio(robot.pin_model, robot.end_effector).dof
            6
        """
        description = described(model, end_effector, geometry)
        return cls(description, end_effector, {}, base=description.base, gravity=gravity)

    def scaled(self, scale_mass: float | Mapping[str, float]) -> FreeFloatingModel:
        """The robot with a factor on every mass and inertia, or on those of named links."""
        return replace(self, description=scaled(self.description, scale_mass))

    def with_paths(self, *names: str) -> FreeFloatingModel:
        """The robot of whose further arms those with some names follow paths of their own.

        Raises:
            InputError: If there is no such arm.

        Example:
            >>> robot = ff.load_scenario("servicing/two_arms").model()
            >>> arms = {"left": "left_tool0"}
            >>> moving = ff.FreeFloatingModel(robot.description, "tool0", {}, arms)
            >>> moving.with_paths("left").end_effector_links
            ('tool0', 'left_tool0')
        """
        if not names:
            return self
        for name in names:
            if name not in self.arms:
                accepted = ", ".join(self.arms) or "a robot with further arms that move"
                raise InputError("arms", f"there is no arm {name!r}", accepted)
        paths = {name: self.arms[name] for name in names}
        others = {name: link for name, link in self.arms.items() if name not in paths}
        return replace(self, arms=others, path_arms={**self.path_arms, **paths})

    def with_arms_at(self, joints: Array) -> FreeFloatingModel:
        """The robot whose arms on joint curves are fixed at values, shape (dof - arm_dof,)."""
        if not self.arms:
            return self
        names = self.joint_names[self.arm_dof :]
        fixed = {**self.fixed_joints, **dict(zip(names, joints.tolist(), strict=True))}
        return replace(self, fixed_joints=fixed, arms={})

    def joints_of_arm(self, name: str) -> tuple[str, ...]:
        """Names of the joints that move one of the further arms."""
        joints = moving_joints(self.description, self.further_arms[name], self.fixed_joints)
        return tuple(joint.name for joint in joints)

    @property
    def further_arms(self) -> dict[str, str]:
        """End-effector links of the further arms that move, by name, in the order of joints."""
        return {**self.path_arms, **self.arms}

    @property
    def has_one_arm(self) -> bool:
        """Whether no further arm moves."""
        return not (self.arms or self.path_arms)

    def require_one_arm(self, what: str) -> None:
        """Raise an InputError if further arms move, naming what considers one arm only."""
        if not self.has_one_arm:
            moves = "moves along a joint curve" if self.arms else "follows a path of its own"
            problem = (
                f"{', '.join(self.arms or self.path_arms)} {moves}; {what} need one moving arm"
            )
            raise InputError("robot.arms", problem, "the law held for the other arms")

    @cached_property
    def with_arms_at_zero(self) -> FreeFloatingModel:
        """The robot whose further arms are fixed at zero."""
        return self.single_arms[0]

    @cached_property
    def single_arms(self) -> tuple[FreeFloatingModel, ...]:
        """For each arm that follows a path, the robot with this one moving, all others at zero."""
        if self.has_one_arm:
            return (self,)
        return tuple(
            FreeFloatingModel(self.description, link, self.fixed_joints, base=self.base)
            for link in (self.end_effector, *self.path_arms.values())
        )

    def _require_inertia(self) -> None:
        for joints in 2.0 * low_discrepancy(_CONFIGURATIONS, self.dof) - 1.0:
            q = self.configuration(UPRIGHT, joints)
            inertia = pin.computeCentroidalMap(self.pin_model, self.scratch, q)[3:, 3:6]
            moments = np.abs(np.linalg.eigvalsh(inertia))
            if self.on_table:
                moments = np.abs(inertia[2:, 2])
            if moments.min() > _REGULAR * moments.max():
                return
        shown = ", ".join(f"{moment:.3g}" for moment in moments)
        problem = f"the whole robot has the principal moments of inertia {shown} kg m²"
        accepted = "positive moments in the <inertia> of the spacecraft or the arm"
        raise ModelError("robot", problem, accepted, self.description.source)

    @property
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
    def _built(self) -> tuple[Any, Mapping[str, tuple[int, Pose]]]:
        built = build_model(self.description, self.moving_joints, self.fixed_joints)
        built[0].gravity.linear = np.array([0.0, 0.0, -self.gravity])
        return built

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
        return self._scratch.data

    @cached_property
    def _scratch(self) -> ThreadData:
        return ThreadData(self.pin_model)

    @cached_property
    def end_effector_links(self) -> tuple[str, ...]:
        """Links that follow paths: :attr:`end_effector_link`, then those of further arms."""
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
    def warnings(self) -> tuple[UrdfDiagnostic, ...]:
        """Diagnostics of severity WARNING."""
        return self.description.warnings

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
        """Number of moving joints; those of the arm that follows the path are ``arm_dof``."""
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
        if 2 in (np.ndim(attitude), np.ndim(joints)):
            attitudes, rows = np.atleast_2d(attitude), np.atleast_2d(joints)
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
        """Poses of places in Pinocchio's data."""
        q, found = self.configuration(attitude, joints), []
        for row in np.atleast_2d(q):
            pin.framesForwardKinematics(self.pin_model, self.scratch, row)
            found.append([place.homogeneous for place in places(self.scratch)])
        poses = np.swapaxes(found, 0, 1) if q.ndim == 2 else np.array(found[0])
        return tuple(Pose(pose[..., :3, 3], pose[..., :3, :3]) for pose in poses)

    def joint_vector(
        self, joints: Mapping[str, float] | npt.ArrayLike, key: str = "joints"
    ) -> Array:
        """Joint values as a vector, from a map by joint name or a sequence in chain order.

        They are those of all moving joints, or of the arm that follows the path.

        Raises:
            InputError: Naming ``key``, if a joint is missing or unknown, or a value is not finite.
        """
        names = self.joint_names
        count = len(joints) if isinstance(joints, Mapping) else np.size(joints)
        if count == self.arm_dof or not self.arms:
            names = names[: self.arm_dof]
        if isinstance(joints, Mapping):
            if set(joints) != set(names):
                problem = f"values of {', '.join(map(str, joints)) or 'no joint'} were given"
                raise InputError(key, problem, f"values of {', '.join(names)}")
            joints = [joints[name] for name in names]
        values: Any = [joints] if np.isscalar(joints) else joints
        return finite_vector(key, values, len(names))

    def joint_distance(self, first: npt.ArrayLike, second: npt.ArrayLike) -> Array:
        """Largest differences (...) of joint values (..., n), modulo 2 pi for revolute joints.

        Those of the arm that follows the path count.
        """
        arm = slice(self.arm_dof)
        difference = np.asarray(first)[..., arm] - np.asarray(second)[..., arm]
        modulo = np.where(self.prismatic[arm], difference, wrapped(difference))
        return np.asarray(np.abs(modulo).max(axis=-1))


def require_model(value: object) -> None:
    """Raise an InputError unless the value is a robot."""
    accepted = "FreeFloatingModel.from_urdf(...), or from_pinocchio(...) of a pin.Model"
    require_type("model", value, FreeFloatingModel, accepted)
