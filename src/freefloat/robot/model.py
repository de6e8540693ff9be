"""A free-floating robot from files or from Pinocchio, which of its arms move, its joint ranges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import tau
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from freefloat.errors import InputError, finite_number, member, require_type
from freefloat.robot.assembly import assemble, end_effector_link, scaled
from freefloat.robot.base import Base
from freefloat.robot.description import Severity, UrdfDiagnostic
from freefloat.robot.parts import Attachment, Payload, Spacecraft
from freefloat.robot.pinocchio_model import described
from freefloat.robot.rigid_bodies import (
    held_value,
    is_out_of_range,
    moving_joints,
    require_within_ranges,
)
from freefloat.robot.rigid_body_model import RigidBodyModel
from freefloat.robot.source import RobotSource
from freefloat.so3 import Array


@dataclass(frozen=True, eq=False)
class FreeFloatingModel(RigidBodyModel):
    """A spacecraft with an arm: no external force, no actuation of the base.

    The joints between the spacecraft and the end-effector move, except joints that are fixed by
    name, and so do the joints of further arms that are named; all other joints of the robot are
    fixed, mimicking joints where the joints that they mimic have them. Joint vectors list the
    moving joints from the spacecraft to the end-effector, then the joints of the further arms, arms
    that follow paths first. Methods refuse other attitudes than unit quaternions and other joint
    values than ``dof`` finite numbers. The attributes are as in :class:`.RigidBodyModel`.

    Example:
        >>> model = ff.FreeFloatingModel.from_urdf("planar_3dof", "end_effector")
        >>> model.joint_names
        ('q1', 'q2', 'q3')
        >>> model.total_mass
        471.0
    """

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
        source = RobotSource.of(urdf).found()
        require_type("end_effector", end_effector, str | None, "the name of a link")
        require_type("fixed_joints", fixed_joints, Mapping | None, "a map from joint to value")
        require_type("arms", arms, Mapping | None, "a map from the name of an arm to a link")
        description = assemble(source, spacecraft, payload, end_effector, attached)
        if np.any(scale_mass != 1.0):
            description = scaled(description, scale_mass)
        if end_effector is None:
            end_effector = end_effector_link(description, None)
        fixed, further = dict(fixed_joints or {}), dict(arms or {})
        for name in fixed.keys() & {joint.name for joint in description.joints}:
            key = f"fixed_joints.{name}"
            fixed[name] = finite_number(key, fixed[name], "a finite number [rad, m]")
        for name, link in further.items():
            require_type(f"arms.{name}", link, str, "the name of a link")
        require_within_ranges(description, fixed)
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
        """The robot with a factor on every mass and inertia, or factors on named links alone."""
        return replace(self, description=scaled(self.description, scale_mass))

    def with_paths(self, *names: str) -> FreeFloatingModel:
        """The robot whose further arms with the given names follow paths of their own.

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
        arms = {name: link for name, link in self.arms.items() if name not in paths}
        return replace(self, arms=arms, path_arms={**self.path_arms, **paths})

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
    def warnings(self) -> tuple[UrdfDiagnostic, ...]:
        """Warnings of the URDF, and about joints that no name fixes and that are out of range."""
        robot, outside = self.description, list[UrdfDiagnostic]()
        named = {*self.joint_names, *self.fixed_joints}
        for joint in (joint for joint in robot.joints if joint.moving and joint.name not in named):
            value = held_value(robot, joint.name, self.fixed_joints)
            if is_out_of_range(joint, value):
                ends = f"{joint.lower:g} to {joint.upper:g}"
                unit = "m" if joint.type == "prismatic" else "rad"
                problem = f"it is fixed at {value:g} {unit}, out of its range {ends} {unit}"
                remedy = f"a value of {joint.name} in robot.held (fixed_joints)"
                name, line = f"joint {joint.name}", joint.lines.get("limit")
                outside.append(
                    UrdfDiagnostic(Severity.WARNING, robot.source, line, name, problem, remedy)
                )
        return (*robot.warnings, *outside)

    @property
    def further_arms(self) -> dict[str, str]:
        """End-effector links of the further arms that move, by name, in the order of joints."""
        return {**self.path_arms, **self.arms}

    @property
    def has_one_arm(self) -> bool:
        """Whether no further arm moves."""
        return not (self.arms or self.path_arms)

    @property
    def further_motions(self) -> dict[str, str]:
        """What each further arm does, by its name: "moves along a joint curve", or the like."""
        along_curves = dict.fromkeys(self.arms, "moves along a joint curve")
        return along_curves | dict.fromkeys(self.path_arms, "follows a path of its own")

    def require_supported(self, what: str) -> None:
        """Raise an InputError if further arms move, naming what considers one arm only."""
        if motions := self.further_motions:
            moves = next(iter(motions.values()))
            arms = ", ".join(name for name, motion in motions.items() if motion == moves)
            problem = f"{arms} {moves}; {what} need one moving arm"
            raise InputError("robot.arms", problem, "the law held for the other arms")

    @cached_property
    def single_arms(self) -> tuple[FreeFloatingModel, ...]:
        """For each arm that follows a path, the robot with this one moving, all others at zero."""
        if self.has_one_arm:
            return (self,)
        return tuple(
            FreeFloatingModel(self.description, link, self.fixed_joints, base=self.base)
            for link in (self.end_effector, *self.path_arms.values())
        )


def require_model(value: object) -> None:
    """Raise an InputError unless the value is a robot."""
    accepted = "FreeFloatingModel.from_urdf(...), or from_pinocchio(...) of a pin.Model"
    require_type("model", value, FreeFloatingModel, accepted)


def revolutions(ranges: tuple[Array, Array], low: Array, high: Array) -> tuple[Array, Array]:
    """The fewest and the most revolutions that put values from low to high into ranges, (..., n).

    None do where the fewest are more than the most.
    """
    lower, upper = ranges
    with np.errstate(invalid="ignore"):  # of values that are not finite
        return np.ceil((lower - low) / tau), np.floor((upper - high) / tau)


def shifts_into_ranges(model: FreeFloatingModel, low: Array, high: Array) -> Array:
    """Multiples of 2 pi that put joint values from low to high into their ranges, shape (..., n).

    As few revolutions as do; where none do, the revolutions that leave the smallest excess.
    """
    lower, upper = model.joint_ranges
    first, last = revolutions(model.joint_ranges, low, high)
    inside = np.minimum(np.maximum(0.0, first), last)
    with np.errstate(invalid="ignore"):  # of joints without range
        middle = ((lower + upper) - (low + high)) / (2.0 * tau)
        choices = np.stack([np.floor(middle), np.ceil(middle), np.zeros_like(low)])
        excesses = np.maximum(lower - low - tau * choices, high + tau * choices - upper)
    outside = np.take_along_axis(choices, excesses.argmin(axis=0)[None], axis=0)[0]
    shifts = np.where(first <= last, inside, np.nan_to_num(outside))
    return np.asarray(tau * np.where(model.prismatic | ~np.isfinite(low), 0.0, shifts))


def range_ratios(ranges: tuple[Array, Array], low: Array, high: Array) -> tuple[Array, Array]:
    """Ratios of joint ranges at their lower and upper ends: 1 at the end, 0 in the middle.

    Where a range has one end or none, half its width counts as one.

    Args:
        ranges: Lower and upper ends, shape (n,) each; infinite without end.
        low: Smallest joint values, shape (..., n).
        high: Largest joint values, shape (..., n).
    """
    lower, upper = ranges
    bounded = np.isfinite(lower) & np.isfinite(upper)
    half = np.where(bounded, (upper - lower) / 2.0, 1.0)
    return (lower - low) / half + 1.0, (high - upper) / half + 1.0


def largest_range_ratio(model: FreeFloatingModel, low: Array, high: Array) -> Array:
    """The largest range ratio of all joints, put into their ranges by revolutions, (...)."""
    shifts = shifts_into_ranges(model, low, high)
    ratios = range_ratios(model.joint_ranges, low + shifts, high + shifts)
    return np.asarray(np.maximum(*ratios).max(axis=-1))
