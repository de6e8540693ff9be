"""A robot as it is asked for: an arm's URDF, and all that is put together with it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from freefloat.errors import InputError
from freefloat.io.robot_schema import (
    MountSection,
    PayloadSection,
    RobotSection,
    SpacecraftSection,
)
from freefloat.robot.assembly import assemble
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.names import find_robot
from freefloat.robot.parts import Attachment, Mount, Payload, Spacecraft
from freefloat.robot.urdf import scale_masses


@dataclass(frozen=True, eq=False)
class RobotParts:
    """An arm and what it is put together with.

    Attributes:
        urdf: The arm.
        end_effector: The link that follows the path; may be left out where there is a single last
            one.
        scale_mass: Factor on mass and inertia of every link, or a map from link to factor.
        held: Values [rad or m] of joints that do not move.
        spacecraft: Carries the arm's root link.
        payload: Held by the end-effector.
        attached: Further URDFs, fixed to links.
        scenario: The file that says so, where one does; named in errors.
    """

    urdf: Path
    end_effector: str | None = None
    scale_mass: float | Mapping[str, float] = 1.0
    held: Mapping[str, float] = field(default_factory=dict)
    spacecraft: Spacecraft | None = None
    payload: Payload | None = None
    attached: tuple[Attachment, ...] = ()
    scenario: Path | None = None

    @classmethod
    def of(cls, section: RobotSection, scenario: Path) -> RobotParts:
        """What a scenario says, its files relative to its folder.

        Raises:
            InputError: Naming the scenario and the key.
        """
        folder = scenario.parent
        with _told(scenario):
            return cls(
                urdf=find_robot(section.urdf, folder),
                end_effector=section.end_effector,
                scale_mass=section.scale_mass,
                held=section.held,
                spacecraft=_spacecraft(section.spacecraft, folder) if section.spacecraft else None,
                payload=_payload(section.payload, folder) if section.payload else None,
                attached=tuple(_attachment(section, index, folder)
                               for index in range(len(section.attached))),
                scenario=scenario,
            )  # fmt: skip

    def model(self) -> FreeFloatingModel:
        """The robot.

        Raises:
            ModelError: If a URDF is unfit, or the parts do not fit together.
        """
        with _told(self.scenario):
            return FreeFloatingModel.from_urdf(
                self.urdf, self.end_effector, scale_mass=self.scale_mass, held=self.held,
                spacecraft=self.spacecraft, payload=self.payload, attached=self.attached,
            )  # fmt: skip

    def robot(self) -> ET.Element:
        """The ``<robot>``, put together and its masses scaled, all else as the URDFs say.

        Raises:
            ModelError: If a URDF is unfit, or the parts do not fit together.
        """
        with _told(self.scenario):
            robot = ET.fromstring(
                assemble(self.urdf, self.spacecraft, self.payload, self.end_effector, self.attached)
            )
            scale_masses(robot, self.scale_mass)
            return robot


@contextmanager
def _told(scenario: Path | None) -> Iterator[None]:
    """Tell errors with the scenario and the key in it, unless they name another file."""
    try:
        yield
    except InputError as error:
        if scenario is None or error.source is not None:
            raise
        raise error.found_in(str(scenario), "robot.") from None


def _spacecraft(section: SpacecraftSection, folder: Path) -> Spacecraft:
    return Spacecraft(
        mass=section.mass,
        inertia=np.array(section.inertia),
        mount=_mount(section.mount),
        size=None if section.size is None else np.array(section.size),
        mesh=None if section.mesh is None else folder / section.mesh,
        com=np.array(section.com),
    )


def _payload(section: PayloadSection, folder: Path) -> Payload:
    return Payload(
        mass=section.mass,
        inertia=np.array(section.inertia),
        com=np.array(section.com),
        size=None if section.size is None else np.array(section.size),
        mesh=None if section.mesh is None else folder / section.mesh,
    )


def _attachment(section: RobotSection, index: int, folder: Path) -> Attachment:
    one = section.attached[index]
    try:
        urdf = find_robot(one.urdf, folder)
    except InputError as error:
        key = f"attached.{index}.{error.key}"
        raise type(error)(key, error.problem, error.accepted, error.source) from None
    return Attachment(urdf, one.link, _mount(one.mount), one.prefix)


def _mount(section: MountSection) -> Mount:
    return Mount(np.array(section.xyz), np.array(section.rpy))
