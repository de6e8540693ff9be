"""Keys of the ``robot`` section of scenario files."""

from __future__ import annotations

from pydantic import Field

from freefloat.io.field_types import (
    Factor,
    Inertia,
    Name,
    Number,
    Positive,
    RollPitchYaw,
    Section,
    Size,
    Vector,
)


class MountSection(Section):
    """Pose of a root link in the frame of the link that carries it."""

    xyz: Vector = (0.0, 0.0, 0.0)
    """Origin [m]."""
    rpy: RollPitchYaw = (0.0, 0.0, 0.0)
    """Roll, pitch, yaw about the carrier's x, y, z axes, in this order [rad]."""


class SpacecraftSection(Section):
    """A spacecraft that carries a bare arm."""

    mass: Positive
    """Without the arm [kg]."""
    inertia: Inertia
    """About its centre of mass, axes of its frame [kg m²]: three principal moments, the six moments
    xx, xy, xz, yy, yz, zz, or the rows of a matrix."""
    com: Vector = (0.0, 0.0, 0.0)
    """Centre of mass in its frame [m]."""
    mount: MountSection = MountSection()
    """Pose of the arm's root link in its frame."""
    size: Size | None = None
    """Edges of its box, centred on the origin of its frame [m]."""
    mesh: Name | None = None
    """Mesh file instead of a box, relative to the scenario file."""


class PayloadSection(Section):
    """A rigid body held by the end-effector."""

    mass: Positive
    """[kg]"""
    inertia: Inertia
    """About its centre of mass, axes of the end-effector [kg m²]: three principal moments, the six
    moments xx, xy, xz, yy, yz, zz, or the rows of a matrix."""
    com: Vector = (0.0, 0.0, 0.0)
    """Centre of mass in the end-effector's frame [m]."""
    size: Size | None = None
    """Edges of its box, centred on its centre of mass [m]."""
    mesh: Name | None = None
    """Mesh file instead of a box, relative to the scenario file."""


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


class RobotSection(Section):
    """The robot."""

    urdf: Name
    """A URDF file, relative to the scenario file, the name of a bundled robot, or
    ``example-robot-data:NAME``."""
    end_effector: Name
    """The link that follows the path."""
    scale_mass: Factor | dict[str, Factor] = 1.0
    """Factor on mass and inertia of every link, or a map from link to factor."""
    spacecraft: SpacecraftSection | None = None
    """Carries the arm, if the URDF describes a bare arm."""
    payload: PayloadSection | None = None
    """Held by the end-effector."""
    attached: list[AttachedSection] = Field(default=[], max_length=100)
    """Further URDFs, fixed to links one after the other."""
    held: dict[Name, Number] = Field(default={})
    """Values [rad, m] of fixed joints; joints off the chain to the end-effector never move."""


class RobotFile(Section):
    """A file with nothing but a robot."""

    robot: RobotSection
