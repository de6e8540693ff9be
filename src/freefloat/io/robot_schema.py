"""The keys that say which robot: what they mean, what they accept."""

from __future__ import annotations

from pydantic import Field

from freefloat.io.schema_types import (
    Factor,
    Inertia,
    Name,
    Number,
    Positive,
    Section,
    Size,
    Turns,
    Vector,
)


class MountSection(Section):
    """Where a root link stands on what carries it."""

    xyz: Vector = (0.0, 0.0, 0.0)
    """Its origin in the carrier's frame [m]."""
    rpy: Turns = (0.0, 0.0, 0.0)
    """Roll, pitch, yaw about the carrier's x, y, z axes in this order [rad]."""


class SpacecraftSection(Section):
    """A spacecraft to put under a bare arm."""

    mass: Positive
    """Without the arm [kg]."""
    inertia: Inertia
    """About its centre of mass, axes of its frame [kg m²]: three principal moments, the six moments
    xx, xy, xz, yy, yz, zz, or the rows of a matrix."""
    com: Vector = (0.0, 0.0, 0.0)
    """Its centre of mass in its frame [m]."""
    mount: MountSection = MountSection()
    """Where the arm's root link stands in its frame."""
    size: Size | None = None
    """Edges of the box that stands for it, centred on its frame's origin [m]."""
    mesh: Name | None = None
    """A mesh file that stands for it instead, relative to the scenario file."""


class PayloadSection(Section):
    """Something that the end-effector holds rigidly."""

    mass: Positive
    """[kg]"""
    inertia: Inertia
    """About its centre of mass, axes of the end-effector [kg m²]; written as the spacecraft's."""
    com: Vector = (0.0, 0.0, 0.0)
    """Its centre of mass in the end-effector's frame [m]."""
    size: Size | None = None
    """Edges of the box that stands for it, centred on its centre of mass [m]."""
    mesh: Name | None = None
    """A mesh file that stands for it instead, relative to the scenario file."""


class AttachedSection(Section):
    """Another URDF, fixed to a link: a tool, a second arm, an antenna."""

    urdf: Name
    """Written as the robot's."""
    link: Name | None = None
    """The link that carries it; the spacecraft when left out."""
    mount: MountSection = MountSection()
    """Where its root link stands on that link."""
    prefix: str = ""
    """Put before the names of its links and joints, where they are taken."""


class RobotSection(Section):
    """Which robot."""

    urdf: Name
    """A URDF file, relative to the scenario file, the name of a bundled robot, or
    ``example-robot-data:NAME`` for one of that package's."""
    end_effector: Name
    """The link that follows the path."""
    scale_mass: Factor | dict[str, Factor] = 1.0
    """Factor on mass and inertia of every link, or a map from link to factor."""
    spacecraft: SpacecraftSection | None = None
    """Carries the arm, where the URDF is a bare arm's."""
    payload: PayloadSection | None = None
    """Held by the end-effector."""
    attached: list[AttachedSection] = Field(default=[], max_length=100)
    """Further URDFs, fixed to links, one after the other."""
    held: dict[Name, Number] = Field(default={})
    """Values [rad, m] of joints that do not move; those off the way to the tool never do."""


class RobotFile(Section):
    """A robot without a task."""

    robot: RobotSection
