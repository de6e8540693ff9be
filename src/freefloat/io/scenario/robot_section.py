"""The ``robot`` section of scenario files: its keys, and the model that they describe."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from freefloat.errors import InputError
from freefloat.io.scenario.arms_section import ArmSection, OwnPathLaw
from freefloat.io.scenario.field_types import (
    ArgumentValue,
    Factor,
    Inertia,
    Name,
    NotNegative,
    Number,
    Positive,
    RollPitchYaw,
    Section,
    Size,
    Vector,
)
from freefloat.io.scenario.path_schema import PathSection
from freefloat.io.scenario.yaml import error_context, file_keys
from freefloat.robot.base import Base
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.named_files import find_robot
from freefloat.robot.parts import Attachment, Mount, Payload, Spacecraft
from freefloat.robot.rigid_bodies import joints_of_arms, require_within_ranges
from freefloat.robot.source import RobotSource


class MountSection(Section):
    """Pose of a root link in the frame of the link that carries it."""

    xyz: Vector = (0.0, 0.0, 0.0)
    """Origin [m]."""
    rpy: RollPitchYaw = (0.0, 0.0, 0.0)
    """Roll, pitch, yaw about the carrier's x, y, z axes, in this order [rad]."""

    def to_mount(self) -> Mount:
        """The mount."""
        return Mount(np.array(self.xyz), np.array(self.rpy))


class BodySection(Section):
    """A rigid body."""

    mass: Positive
    """Mass [kg]."""
    inertia: Inertia
    """Inertia about the centre of mass, axes of the body's frame [kg m²]: three principal moments,
    the six moments xx, xy, xz, yy, yz, zz, or the rows of a matrix."""
    com: Vector = (0.0, 0.0, 0.0)
    """Centre of mass in its frame, of a payload in the end-effector's frame [m]."""
    size: Size | None = None
    """Edges of its box [m], centred on the origin of its frame, of a payload on its centre of
    mass."""
    mesh: Name | None = None
    """Mesh file instead of a box, relative to the scenario file."""

    def values(self, folder: Path) -> dict[str, Any]:
        """Arguments of the body; its mesh file is relative to a folder."""
        return self.model_dump() | {"mesh": None if self.mesh is None else folder / self.mesh}


class SpacecraftSection(BodySection):
    """A spacecraft that carries a bare arm."""

    mount: MountSection = MountSection()
    """Pose of the arm's root link in the spacecraft's frame."""

    def values(self, folder: Path) -> dict[str, Any]:
        """Arguments of the spacecraft: the arguments of a body, and the mount."""
        return super().values(folder) | {"mount": self.mount.to_mount()}


class AttachedSection(Section):
    """Another URDF, fixed to a link: a tool, a second arm, an antenna."""

    urdf: Name
    """Written as the robot's."""
    link: Name | None = None
    """Link that carries it; default: the spacecraft."""
    mount: MountSection = MountSection()
    """Pose of its root link in the frame of that link."""
    prefix: str = ""
    """Prefix of the names of its links and joints."""
    arguments: dict[Name, ArgumentValue] = Field(default={}, max_length=100)
    """Values of arguments of its xacro file, by name."""

    def to_attachment(
        self, scenario: Path, key: str, packages: Mapping[str, str | Path]
    ) -> Attachment:
        """The attachment; errors name the scenario file and begin with a key."""
        with error_context(scenario, key):
            file = find_robot(self.urdf, scenario.parent)
            source = RobotSource(file, packages=packages, arguments=self.arguments)
        return Attachment(source, self.link, self.mount.to_mount(), self.prefix)


class RobotSection(Section):
    """The robot."""

    urdf: Name
    """A URDF, xacro or MJCF file, relative to the scenario file, the name of a bundled robot,
    ``example-robot-data:NAME`` or ``robot_descriptions:NAME``."""
    end_effector: Name
    """The link, or site of a model of MuJoCo, that follows the path, or the name of its arm."""
    base: Base | None = None
    """``free``, or ``planar`` on a table: the spacecraft moves along x and y and turns about z;
    default: what the file says, otherwise free."""
    gravity: NotNegative = 0.0
    """On a table, gravity along -z [m/s²], such as 9.81, which joint torques have to bear."""
    root: Name | None = None
    """Body of a model of MuJoCo that is the spacecraft; default: the only body in the world,
    else the only one with a free joint and bodies that move on it. ``world`` is a root without mass
    for arms that stand in the world."""
    packages: dict[Name, Name] = Field(default={}, max_length=100)
    """Folders of packages of ROS, by name, relative to the scenario file; others are looked for
    above the file that needs them."""
    arguments: dict[Name, ArgumentValue] = Field(default={}, max_length=100)
    """Values of arguments of a xacro file, by name: text, numbers, true or false; others have their
    defaults."""
    srdf: Name | None = None
    """An SRDF file, relative to the scenario file: links of its ``disable_collisions`` may touch,
    and nothing else of it is read."""
    scale_mass: Factor | dict[str, Factor] = 1.0
    """Factor on mass and inertia of every link, or a map from link to factor."""
    spacecraft: SpacecraftSection | None = None
    """Carries the arm, if the URDF describes a bare arm."""
    payload: BodySection | None = None
    """Fixed to the end-effector."""
    attached: list[AttachedSection] = Field(default=[], max_length=100)
    """Further URDFs, fixed to links one after the other."""
    held: dict[Name, Number] = Field(default={})
    """Values [rad, m] of fixed joints; joints off the chain to the end-effector, and off the
    chains of arms with a law that moves them, never move: they are at zero, or where what they
    mimic has them."""
    arms: dict[Name, ArmSection] = Field(default={}, max_length=20)
    """Arms by name, which have no joint in common."""

    @property
    def path_link(self) -> str:
        """The link that follows the path."""
        arm = self.arms.get(self.end_effector)
        return self.end_effector if arm is None else arm.end_effector

    @property
    def moving_arms(self) -> dict[str, str]:
        """End-effector links of further arms that move, by name."""
        arms = self.arms.items()
        return {name: arm.end_effector for name, arm in arms if arm.law not in (None, "held")}

    @property
    def own_paths(self) -> dict[str, PathSection]:
        """The paths of further arms that follow one of their own, by name."""
        return {k: arm.law.path for k, arm in self.arms.items() if isinstance(arm.law, OwnPathLaw)}

    def source(self, scenario: Path) -> RobotSource:
        """The file of the robot, before anything is assembled with it.

        Raises:
            InputError: If there is no such file, or no folder of a package; it names the scenario.
        """
        folder = scenario.parent
        with error_context(scenario, "robot."):
            file = find_robot(self.urdf, folder)
            srdf = None if self.srdf is None else folder / self.srdf
            return RobotSource(file, self.root, self._packages(folder), self.arguments, srdf)

    def parts(self, scenario: Path) -> list[Attachment]:
        """Further URDFs; raises the InputErrors of :meth:`source`."""
        packages = self._packages(scenario.parent)
        numbered = enumerate(self.attached)
        return [p.to_attachment(scenario, f"robot.attached.{k}.", packages) for k, p in numbered]

    def sources(self, scenario: Path) -> tuple[RobotSource, ...]:
        """The file of the robot, then those that are attached to it; raises as :meth:`source`."""
        attached = (RobotSource.of(part.urdf) for part in self.parts(scenario))
        return self.source(scenario), *attached

    def _packages(self, folder: Path) -> dict[str, Path]:
        return {name: folder / place for name, place in self.packages.items()}

    def to_model(self, scenario: Path) -> FreeFloatingModel:
        """Model of the robot, assembled of its parts.

        Args:
            scenario: The scenario file: file names are relative to its folder, and errors name it.

        Raises:
            InputError: If a part is invalid.
            ModelError: If a URDF has errors, or the parts do not fit together.
        """
        folder, craft, payload = scenario.parent, self.spacecraft, self.payload
        with error_context(scenario, "robot."), file_keys(fixed_joints="held"):
            self._require_laws()
            model = FreeFloatingModel.from_urdf(
                self.source(scenario),
                self.path_link,
                scale_mass=self.scale_mass,
                fixed_joints=self.held,
                arms=self.moving_arms,
                spacecraft=None if craft is None else Spacecraft(**craft.values(folder)),
                payload=None if payload is None else Payload(**payload.values(folder)),
                attached=self.parts(scenario),
                base=self.base,
                gravity=self.gravity,
            ).with_paths(*self.own_paths)
            moving = {self.path_link, *self.moving_arms.values()}
            links = {name: arm.end_effector for name, arm in self.arms.items()}
            held = {name: link for name, link in links.items() if link not in moving}
            joints = joints_of_arms(model.description, held, model.moving_joints, {})
            if not joints:
                return model
            fixed = {joint.name: 0.0 for joint in joints} | dict(model.fixed_joints)
            require_within_ranges(model.description, fixed)
            return replace(model, fixed_joints=fixed)

    def _require_laws(self) -> None:
        """Raise an InputError if the arm that follows the path has a law of its own."""
        for name, arm in self.arms.items():
            if arm.end_effector == self.path_link and arm.law is not None:
                law = arm.law if isinstance(arm.law, str) else "a law"
                problem = f"{law} was given, but the arm follows the path"
                accepted = "no such key, or another end_effector"
                raise InputError(f"arms.{name}.law", problem, accepted)


class RobotFile(Section):
    """A file with nothing but a robot."""

    robot: RobotSection
