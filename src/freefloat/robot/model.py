"""A URDF as a free-floating robot: free-flyer root, joints by name, plain angles."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from freefloat.brief import brief
from freefloat.errors import InputError, ModelError, did_you_mean
from freefloat.robot.assembly import Attachment, Payload, Spacecraft, assemble
from freefloat.robot.body import Body
from freefloat.robot.diagnostics import UrdfDiagnostic
from freefloat.robot.names import find_robot
from freefloat.robot.urdf import UNLIMITED, Description, read_urdf, told_of, without_shapes
from freefloat.robot.urdf_text import is_text, refuse_no_urdf, source_of
from freefloat.so3 import Array, Pose, finite_vector, frozen

_MOVING_JOINTS = ("JointModelR", "JointModelP")


@dataclass(frozen=True, eq=False)
class FreeFloatingModel:
    """A spacecraft with an arm, drifting: no external force, its base not actuated.

    The joints between the spacecraft and the end-effector move, but for those that are held by
    name, such as one that is stuck; every other joint of the robot is held. Joint vectors list the
    moving joints from the spacecraft to the end-effector, see
    :attr:`joint_names`.

    Attributes:
        description: The checked URDF.
        end_effector: Name of the link (or other frame) that follows the path.
        held: Joint name to value [rad or m]; joints off the chain that are not named are at zero.
    """

    __repr__ = brief

    description: Description
    end_effector: str
    held: Mapping[str, float]

    @classmethod
    def from_urdf(
        cls,
        urdf: str | Path,
        end_effector: str | None = None,
        *,
        scale_mass: float | Mapping[str, float] = 1.0,
        held: Mapping[str, float] | None = None,
        spacecraft: Spacecraft | None = None,
        payload: Payload | None = None,
        attached: Sequence[Attachment] = (),
    ) -> FreeFloatingModel:
        """Load a robot whose root link is the spacecraft, or an arm to be mounted on one.

        Args:
            urdf: A file, XML text, or a name as the command line takes it: of a bundled robot,
                such as ``"spatial_6dof"``, or ``"example-robot-data:ur10"``.
            end_effector: Frame that follows the path; may be left out where the robot has a
                single last link.
            scale_mass: Factor on every mass and inertia, or a map from link to factor.
            held: Values [rad or m] of joints that do not move: off the way to the end-effector all
                of them, zero when not named; on the way those that are named, stuck ones say.
            spacecraft: Put under the root link, see :func:`~freefloat.robot.assembly.assemble`.
            payload: Held by the end-effector.
            attached: Further URDFs, fixed to links.

        Raises:
            InputError: If a part or a factor is something else.
            ModelError: If there is no such URDF, or it is unfit, or has no such frame, or no joint
                moves it.
        """
        refuse_no_urdf(urdf)
        urdf = _named(urdf)
        if spacecraft is None and payload is None and not attached:
            description = read_urdf(urdf, scale_mass)
        else:
            whole = assemble(urdf, spacecraft, payload, end_effector, attached)
            told = told_of(urdf, carried=spacecraft is not None)  # with lines of the arm's file
            description = read_urdf(whole, scale_mass)
            description = replace(description, source=source_of(urdf), findings=told)
        model = cls(description, end_effector or _only_tip(description), dict(held or {}))
        _ = model.pin_model
        return model

    def __getstate__(self) -> dict[str, Any]:
        return {key: getattr(self, key) for key in ("description", "end_effector", "held")}

    @cached_property
    def pin_model(self) -> Any:
        """The Pinocchio model: free-flyer root, then the moving joints. Not to be modified."""
        return _reduced(_build(self.description), self.end_effector, self.held)

    @cached_property
    def scratch(self) -> Any:
        """Pinocchio's scratch memory, one a process; what is read from it must be copied."""
        return self.pin_model.createData()

    @cached_property
    def frame_id(self) -> int:
        """Pinocchio's index of the end-effector frame."""
        return _frame_id(self.pin_model, self.end_effector)

    @property
    def doubts(self) -> tuple[UrdfDiagnostic, ...]:
        """What the URDF says that is probably not what was meant."""
        return self.description.doubts

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """The moving joints, from the spacecraft to the end-effector."""
        return tuple(self.pin_model.names[2:])

    @property
    def dof(self) -> int:
        """Number of moving joints."""
        return len(self.joint_names)

    @cached_property
    def total_mass(self) -> float:
        """Mass of the whole system [kg]."""
        return float(pin.computeTotalMass(self.pin_model))

    @cached_property
    def bodies(self) -> tuple[Body, ...]:
        """The spacecraft and the bodies moved by each joint, in order."""
        model = self.pin_model
        data = model.createData()
        pin.computeJointJacobians(model, data, pin.neutral(model))
        return tuple(_body(model, data, index) for index in range(1, model.njoints))

    @cached_property
    def tool(self) -> Pose:
        """The end-effector's frame in the frame of the last joint."""
        return _pose(self.pin_model.frames[self.frame_id].placement)

    @cached_property
    def link_places(self) -> Mapping[str, tuple[int, Pose]]:
        """Which body every link is a part of, and where it stands in that body's joint frame.

        Bodies count as in :attr:`bodies`: 0 is the spacecraft. Links behind fixed and held joints
        are there too.
        """
        return {link.name: (link.parentJoint - 1, _pose(link.placement))
                for link in _link_frames(self.pin_model)}  # fmt: skip

    @cached_property
    def body_names(self) -> tuple[str, ...]:
        """A link for every body: the root link, then those that the joints move."""
        first = {link.parentJoint: link.name for link in reversed(_link_frames(self.pin_model))}
        return tuple(first[joint] for joint in range(1, self.pin_model.njoints))

    def configuration(self, attitude: npt.ArrayLike, joints: npt.ArrayLike) -> Array:
        """Pinocchio's configuration with the system's centre of mass at the origin.

        Args:
            attitude: Unit quaternion x, y, z, w, shape (4,).
            joints: Joint values, shape (n,).

        Returns:
            ``[base position, base quaternion, joints]``, shape (7 + n,).
        """
        q = np.concatenate([np.zeros(3), attitude, joints])
        q[:3] = -pin.centerOfMass(self.pin_model, self.scratch, q)
        return q

    def base_position(self, attitude: npt.ArrayLike, joints: npt.ArrayLike) -> Array:
        """Origin of the spacecraft's root link in the inertial frame [m], shape (3,)."""
        return self.configuration(attitude, joints)[:3]

    def end_effector_pose(self, attitude: npt.ArrayLike, joints: npt.ArrayLike) -> Pose:
        """Pose of the end-effector in the inertial frame, whose origin is the centre of mass."""
        q = self.configuration(attitude, joints)
        pin.framesForwardKinematics(self.pin_model, self.scratch, q)
        return _pose(self.scratch.oMf[self.frame_id])

    def body_poses(self, attitude: npt.ArrayLike, joints: npt.ArrayLike) -> tuple[Pose, ...]:
        """Poses of the bodies' joint frames in the inertial frame: the root link's, then n more."""
        q = self.configuration(attitude, joints)
        pin.forwardKinematics(self.pin_model, self.scratch, q)
        return tuple(_pose(placement) for placement in self.scratch.oMi.tolist()[1:])

    def joint_vector(self, joints: Mapping[str, float] | npt.ArrayLike) -> Array:
        """Joint values as a vector, from a map by joint name or a sequence in chain order.

        Raises:
            InputError: If a joint is missing, unknown, or a value is not a finite number.
        """
        if isinstance(joints, Mapping):
            unknown = sorted(set(joints) - set(self.joint_names))
            missing = [name for name in self.joint_names if name not in joints]
            if unknown or missing:
                raise InputError(
                    "joints",
                    f"unknown: {', '.join(unknown) or '-'}, missing: {', '.join(missing) or '-'}",
                    ", ".join(self.joint_names),
                )
            joints = [joints[name] for name in self.joint_names]
        accepted = f"{self.dof} values: {', '.join(self.joint_names)}"
        try:
            values = np.atleast_1d(np.asarray(joints, dtype=float))
        except (TypeError, ValueError):
            raise InputError("joints", f"{joints!r} was given", accepted) from None
        if values.shape != (self.dof,):
            raise InputError("joints", f"{values.size} values were given", accepted)
        return finite_vector("joints", values, self.dof)


def _named(urdf: str | Path) -> str | Path:
    """The file of a robot's name; what is a file, or XML text, as it is."""
    if is_text(urdf) or (os.path.exists(urdf) and not os.path.isdir(urdf)):
        return urdf
    try:
        return find_robot(str(urdf), Path())
    except InputError as error:
        raise ModelError(error.key, error.problem, error.accepted) from None


def _build(description: Description) -> Any:
    try:
        return pin.buildModelFromXML(without_shapes(description.text), pin.JointModelFreeFlyer())
    except Exception as error:  # Pinocchio passes on whatever C++ throws
        raise ModelError(
            "urdf",
            f"the URDF parser refuses it ({str(error).strip() or 'no reason given'})",
            "one root link, every other link the child of exactly one joint, unique names",
            description.source,
        ) from None


def _pose(placement: Any) -> Pose:
    return Pose(placement.translation, placement.rotation)


def _link_frames(model: Any) -> list[Any]:
    """Every link's frame, parents before their children."""
    return [frame for frame in model.frames if frame.type == pin.FrameType.BODY]


def _links(model: Any) -> list[str]:
    return [frame.name for frame in _link_frames(model)]


def _frame_id(model: Any, name: str) -> int:
    """Index of a link, or of another frame where no link has the name."""
    if model.existFrame(name, pin.FrameType.BODY):
        return int(model.getFrameId(name, pin.FrameType.BODY))
    return next(i for i, frame in enumerate(model.frames) if frame.name == name)


def _only_tip(description: Description) -> str:
    model = _build(description)
    links = _link_frames(model)
    parents = {model.frames[frame.parentFrame].parentFrame for frame in links}
    tips = [link.name for link in links if _frame_id(model, link.name) not in parents]
    if len(tips) != 1:
        carried = {link.parentJoint for link in links if link.name in tips and link.parentJoint > 1}
        hands = [link.name for link in links if link.parentJoint in carried] or tips
        accepted = "--end-effector, or end_effector of a scenario, with a link such as "
        raise ModelError(
            "end_effector", "none was given and the robot has several last links",
            accepted + ", ".join(hands), description.source,
        )  # fmt: skip
    return str(tips[0])


def _reduced(whole: Any, end_effector: str, held: Mapping[str, float]) -> Any:
    """The model with only the joints that move the end-effector left free."""
    if not any(frame.name == end_effector for frame in whole.frames):
        links = _links(whole)
        told = f"the robot has no frame {end_effector!r}{did_you_mean(end_effector, links)}"
        raise ModelError("end_effector", told, ", ".join(links))
    frame = whole.frames[_frame_id(whole, end_effector)]
    chain = [index for index in whole.supports[frame.parentJoint] if index > 1]
    if not chain:
        raise ModelError(
            "end_effector",
            f"{end_effector!r} is fixed to the spacecraft, no joint moves it",
            "a link beyond at least one joint: "
            + ", ".join(f.name for f in whole.frames
                        if f.type == pin.FrameType.BODY and f.parentJoint > 1),
        )  # fmt: skip
    for index in range(2, whole.njoints):
        kind = whole.joints[index].shortname()
        if not kind.startswith(_MOVING_JOINTS) or whole.joints[index].nq != 1:
            raise ModelError(
                f"joint {whole.names[index]}", f"its type {kind} is not supported",
                "revolute, continuous, prismatic or fixed",
            )  # fmt: skip
    names = {whole.names[index]: index for index in range(2, whole.njoints)}
    q = pin.neutral(whole)
    for name, value in held.items():
        if name not in names:
            told = f"the robot has no such joint{did_you_mean(name, names)}"
            raise ModelError(f"held.{name}", told, ", ".join(names))
        if not np.isfinite(value):
            raise ModelError(f"held.{name}", f"{value} was given", "a finite number [rad, m]")
        q[whole.joints[names[name]].idx_q] = value
    if all(whole.names[index] in held for index in chain):
        raise ModelError(
            "held",
            f"all joints that move {end_effector!r} are held",
            "one joint or more that moves",
        )
    others = {name: index for name, index in names.items() if index not in chain or name in held}
    for name in sorted(others.keys() & set(_links(whole))):
        raise ModelError(
            f"joint {name}", "a link has the same name, so it cannot be held",
            "a name of its own for every joint that is held",
        )  # fmt: skip
    return pin.buildReducedModel(whole, list(others.values()), q) if others else whole


def _body(model: Any, data: Any, index: int) -> Body:
    joint, inertia, placement = (
        model.joints[index],
        model.inertias[index],
        model.jointPlacements[index],
    )
    S = np.zeros((6, 1))
    lower, upper, speed, effort = -np.inf, np.inf, np.inf, np.inf
    if index > 1:
        S = pin.getJointJacobian(model, data, index, pin.LOCAL)[:, joint.idx_v : joint.idx_v + 1]
        lower = float(model.lowerPositionLimit[joint.idx_q])
        upper = float(model.upperPositionLimit[joint.idx_q])
        speed = float(model.velocityLimit[joint.idx_v])
        effort = float(model.effortLimit[joint.idx_v])
    prismatic = bool(np.linalg.norm(S[:3]) > 0.5)
    return Body(
        joint=model.names[index],
        placement=_pose(placement),
        axis=frozen(S[:3, 0] if prismatic else S[3:, 0]),
        prismatic=prismatic,
        lower=lower if lower > -UNLIMITED else -np.inf,
        upper=upper if upper < UNLIMITED else np.inf,
        rated_speed=speed if 0.0 < speed < UNLIMITED else np.inf,
        rated_effort=effort if 0.0 < effort < UNLIMITED else np.inf,
        mass=float(inertia.mass),
        centre=frozen(inertia.lever),
        inertia=frozen(inertia.inertia),
    )
