"""Rigid bodies and the Pinocchio model, built from the description of a robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from threading import local
from typing import Any

import numpy as np
import pinocchio as pin

from freefloat.errors import InputError, ModelError, did_you_mean
from freefloat.robot.description import IDENTITY, Joint, RobotDescription
from freefloat.robot.urdf import UNLIMITED
from freefloat.so3 import Array, Pose, frozen

_MOST_JOINTS = 128
"""Pinocchio's data grow with the cube of the number of joints: 80 MB, for 400 joints 2 GB."""
_ROUNDED = 1e-9
"""Distance from the range of a joint that is rounding error [rad, m]."""
_ALIGNED = {
    False: (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ),
    True: (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ),
}
"""Joints along coordinate axes, by whether they are prismatic."""


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body: links that fixed joints connect.

    Attributes:
        joint: Name of the joint that moves it; ``"root_joint"`` for the spacecraft.
        parent: Number of the body that carries the joint, 0 is the spacecraft; -1 for that. In an
            arm it is the previous body.
        placement: The joint's frame in the parent's frame, the joint at zero.
        axis: Unit vector of the joint in its own frame, shape (3,); zeros for the spacecraft.
        prismatic: Whether the joint is prismatic and not revolute.
        lower: Lower end of the joint's range [rad or m]; minus infinity where there is none, or one
            whose ends are not in order, of which the URDF's diagnostics warn.
        upper: Upper end of the joint's range [rad or m]; infinity where there is none.
        rated_speed: Rated speed in the URDF [rad/s or m/s]; infinite where there is none.
        rated_effort: Rated torque or force in the URDF [N m or N]; infinite where there is none.
        rated_acceleration: Rated acceleration in the URDF [rad/s² or m/s²], likewise.
        rated_jerk: Rated jerk in the URDF [rad/s³ or m/s³], likewise.
        armature: Inertia of the joint's rotor, see :class:`.Joint` [kg m² or kg].
        mass: Mass [kg].
        centre: Centre of mass in the joint's frame [m], shape (3,).
        inertia: Inertia about the centre of mass, axes of the joint's frame [kg m²], shape (3, 3).
    """

    joint: str
    parent: int
    placement: Pose
    axis: Array
    prismatic: bool
    lower: float
    upper: float
    rated_speed: float
    rated_effort: float
    rated_acceleration: float
    rated_jerk: float
    armature: float
    mass: float
    centre: Array
    inertia: Array = field(repr=False)


class ThreadData(local):
    """Pinocchio's data of a model, made anew in each thread."""

    def __init__(self, pin_model: Any) -> None:
        self.data = pin_model.createData()


def moving_joints(
    robot: RobotDescription, link: str, fixed_joints: Mapping[str, float], key: str = "end_effector"
) -> tuple[Joint, ...]:
    """The joints that move a link, from the root link outwards.

    Without those fixed by name, and those that follow others: :func:`require_uncoupled`.

    Args:
        robot: Robot.
        link: Name of the link.
        fixed_joints: Values of joints that do not move, by name.
        key: Named in errors of the link.

    Raises:
        ModelError: If no joint or too many joints move the link, or there is no moving joint of a
            name.
    """
    names = [joint.name for joint in robot.joints if joint.moving]
    for name in fixed_joints:
        if name not in names:
            problem = f"the robot has no such joint{did_you_mean(name, names)}"
            raise ModelError(f"fixed_joints.{name}", problem, ", ".join(names))
    chain: list[Joint] = []
    below = link
    while below in robot.parent_joints:
        chain.insert(0, robot.parent_joints[below])
        below = chain[0].parent
    if not any(joint.moving for joint in chain):
        fixed = {name for root in robot.roots for name in robot.rigid_groups[root].links}
        moved = [name for name in robot.links_by_name if name not in fixed]
        problem = f"{link!r} is fixed to the spacecraft, no joint moves it"
        accepted = f"one of {', '.join(moved)}" if moved else "a robot with joints that move"
        raise ModelError(key, problem, accepted)
    held = {joint.name for joint in chain if joint.mimic} | set(fixed_joints)
    moving = tuple(joint for joint in chain if joint.moving and joint.name not in held)
    if not moving:
        followers = ", or follow others" * any(joint.mimic for joint in chain)
        problem = f"all joints that move {link!r} are fixed{followers}"
        raise ModelError("fixed_joints", problem, "at least one joint that moves")
    if len(moving) > _MOST_JOINTS:
        problem = f"{len(moving)} joints move {link!r}"
        accepted = f"at most {_MOST_JOINTS} that are not fixed by name (robot.held in a scenario)"
        raise ModelError("robot", problem, accepted, robot.source)
    return moving


def require_uncoupled(
    robot: RobotDescription, moving: Sequence[Joint], fixed_joints: Mapping[str, float]
) -> None:
    """Raise a ModelError if a joint that is not fixed by name follows one that moves."""
    for joint in robot.joints:
        leader = leader_of(robot, joint, fixed_joints)
        if leader is not joint and leader in moving:
            problem = f"it mimics {leader.name}, which moves; coupled joints are not computed"
            accepted = (
                f"a value of {joint.name} or of {leader.name} in robot.held (fixed_joints), or an "
                f"end_effector that {leader.name} does not move"
            )
            line = joint.lines.get("mimic") or None
            raise ModelError(f"joint {joint.name}", problem, accepted, robot.source, line)


def leader_of(robot: RobotDescription, joint: Joint, fixed_joints: Mapping[str, float]) -> Joint:
    """The joint that a joint follows in the end, also through others; itself where none."""
    while joint.mimic is not None and joint.name not in fixed_joints:
        joint = robot.joints_by_name[joint.mimic.joint]
    return joint


def held_value(robot: RobotDescription, name: str, fixed_joints: Mapping[str, float]) -> float:
    """Value of a joint that does not move [rad or m]: by name, of what it follows, or zero."""
    mimic = robot.joints_by_name[name].mimic
    if name in fixed_joints or mimic is None:
        return float(fixed_joints.get(name, 0.0))
    return mimic.multiplier * held_value(robot, mimic.joint, fixed_joints) + mimic.offset


def is_out_of_range(joint: Joint, value: float) -> bool:
    """Whether a value is not in the range of a joint; no value where its ends are not in order."""
    inside = joint.lower - _ROUNDED <= value <= joint.upper + _ROUNDED
    return joint.lower < joint.upper and not inside


def require_within_ranges(robot: RobotDescription, fixed_joints: Mapping[str, float]) -> None:
    """Raise an InputError if a joint is held where it cannot be."""
    for joint in robot.joints:
        value = fixed_joints.get(joint.name)
        if value is not None and is_out_of_range(joint, value):
            accepted = f"{joint.lower:g} to {joint.upper:g}, the range of the joint"
            raise InputError(f"fixed_joints.{joint.name}", f"{value:g} was given", accepted)


def joints_of_arms(
    robot: RobotDescription,
    arms: Mapping[str, str],
    moving: tuple[Joint, ...],
    fixed_joints: Mapping[str, float],
) -> tuple[Joint, ...]:
    """The joints of arms beside those that move already, arm after arm.

    Args:
        robot: Robot.
        arms: End-effector links of the arms by name.
        moving: The joints of the arm that follows the path.
        fixed_joints: Values of joints that do not move, by name.

    Raises:
        ModelError: If no joint moves an arm, or two arms have a joint in common.
    """
    joints = moving
    for name, link in arms.items():
        key = f"arms.{name}.end_effector"
        if link not in robot.links_by_name:
            problem = f"the robot has no link {link!r}{did_you_mean(link, robot.links_by_name)}"
            raise ModelError(key, problem, "one of its links")
        own = moving_joints(robot, link, fixed_joints, key)
        common = [joint.name for joint in own if joint in joints]
        if common:
            problem = f"joint {common[0]!r} moves another arm, too"
            raise ModelError(key, problem, "arms that branch off the spacecraft")
        joints += own
    return joints[len(moving) :]


def build_model(
    robot: RobotDescription, moving: Sequence[Joint], fixed_joints: Mapping[str, float]
) -> tuple[Any, Mapping[str, tuple[int, Pose]]]:
    """The weightless Pinocchio model with the moving joints; body and pose of every link.

    Its joints are in the order of the moving joints, arm after arm. See :class:`Body`.
    """
    model = pin.Model()
    model.gravity = pin.Motion.Zero()
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root_joint")
    places = {robot.roots[0]: (0, IDENTITY)}
    links = list(places)
    waiting: dict[int, tuple[Joint, int, Pose]] = {}
    while links or waiting:
        if not links:
            joint, body, at = waiting.pop(min(waiting))
            rated = (np.inf if value is None else value for value in (joint.effort, joint.velocity))
            bounds = map(np.atleast_1d, (*rated, *_range_of(joint)))
            index = model.addJoint(body + 1, _joint_model(joint), se3_of(at), joint.name, *bounds)
            model.armature[model.joints[index].idx_v] = joint.armature
            places[joint.child] = (index - 1, IDENTITY)
            links.append(joint.child)
        name = links.pop(0)
        body, pose = places[name]
        inertial = robot.links_by_name[name].inertial
        if inertial is not None:
            inertia = pin.Inertia.Zero()  # whose constructor refuses what validation warns of
            inertia.mass, inertia.inertia = inertial.mass, inertial.inertia
            model.appendBodyToJoint(body + 1, inertia, se3_of(pose @ inertial.origin))
        for joint in robot.children.get(name, ()):
            at = pose @ joint.origin
            if joint in moving:
                waiting[moving.index(joint)] = joint, body, at
                continue
            value = held_value(robot, joint.name, fixed_joints)
            places[joint.child] = (body, at @ displacement(joint, value))
            links.append(joint.child)
    for name, (body, pose) in places.items():
        model.addFrame(pin.Frame(name, body + 1, 0, se3_of(pose), pin.BODY), False)
    return model, places


def _range_of(joint: Joint) -> tuple[float, float]:
    """The range of a joint; infinite where its ends are not in order."""
    return (joint.lower, joint.upper) if joint.lower < joint.upper else (-np.inf, np.inf)


def _joint_model(joint: Joint) -> Any:
    axis = joint.axis / np.linalg.norm(joint.axis)
    prismatic = joint.type == "prismatic"
    for aligned, direction in zip(_ALIGNED[prismatic], np.eye(3), strict=True):
        if (axis == direction).all():
            return aligned()
    unaligned = pin.JointModelPrismaticUnaligned if prismatic else pin.JointModelRevoluteUnaligned
    return unaligned(axis)


def displacement(joint: Joint, value: float) -> Pose:
    """Pose of the child link's frame in the joint's frame at a joint value [rad or m]."""
    if value == 0.0:
        return IDENTITY
    step = joint.axis * (value / np.linalg.norm(joint.axis))
    prismatic = joint.type == "prismatic"
    return Pose(step, np.eye(3)) if prismatic else Pose(np.zeros(3), pin.exp3(step))


def body_of(model: Any, index: int, joint: Joint | None) -> Body:
    """The body of a joint of the Pinocchio model; the spacecraft's joint is None."""
    inertia = model.inertias[index]
    lower, upper = (-np.inf, np.inf) if joint is None else _range_of(joint)
    rated: tuple[float | None, ...] = (None,) * 4
    if joint is not None:
        rated = joint.velocity, joint.effort, joint.acceleration, joint.jerk
    speed, effort, acceleration, jerk = (
        value if value and 0.0 < value < UNLIMITED else np.inf for value in rated
    )
    return Body(
        joint=model.names[index],
        parent=int(model.parents[index]) - 1,
        placement=Pose.of("placement", model.jointPlacements[index]),
        axis=frozen(np.zeros(3) if joint is None else joint.axis / np.linalg.norm(joint.axis)),
        prismatic=joint is not None and joint.type == "prismatic",
        lower=lower,
        upper=upper,
        rated_speed=speed,
        rated_effort=effort,
        rated_acceleration=acceleration,
        rated_jerk=jerk,
        armature=0.0 if joint is None else joint.armature,
        mass=float(inertia.mass),
        centre=frozen(inertia.lever),
        inertia=frozen(inertia.inertia),
    )


def se3_of(pose: Pose) -> Any:
    """A pose as Pinocchio's."""
    return pin.SE3(pose.rotation, pose.position)
