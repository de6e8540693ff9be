"""The robot of a scenario: an arm's URDF and all that is assembled with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from freefloat.errors import InputError
from freefloat.io.robot_schema import (
    AttachedSection,
    MountSection,
    PayloadSection,
    RobotSection,
    SpacecraftSection,
)
from freefloat.io.validation import error_context
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.names import find_robot
from freefloat.robot.parts import Attachment, Mount, Payload, Spacecraft


@dataclass(frozen=True, eq=False)
class RobotParts:
    """An arm and the parts that it is assembled with.

    Attributes:
        urdf: File of the arm.
        end_effector: Link that follows the path; optional if the robot has a single last link.
        scale_mass: Factor on mass and inertia of every link, or a map from link to factor.
        held: Values [rad or m] of fixed joints.
        spacecraft: Carries the root link of the arm.
        payload: Held by the end-effector.
        attached: Further URDFs, fixed to links.
        scenario: Scenario file of the robot, named in errors.
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
        """Parts of the robot of a scenario; file names are relative to its folder.

        Raises:
            InputError: If a part is invalid; it names the scenario and the key.
        """
        folder, spacecraft, payload = scenario.parent, section.spacecraft, section.payload
        with error_context(scenario, "robot."):
            return cls(
                urdf=find_robot(section.urdf, folder),
                end_effector=section.end_effector,
                scale_mass=section.scale_mass,
                held=section.held,
                spacecraft=None
                if spacecraft is None
                else Spacecraft(mount=_mount(spacecraft.mount), **_body(spacecraft, folder)),
                payload=None if payload is None else Payload(**_body(payload, folder)),
                attached=tuple(
                    _attachment(one, index, folder) for index, one in enumerate(section.attached)
                ),
                scenario=scenario,
            )

    def model(self) -> FreeFloatingModel:
        """Model of the assembled robot.

        Raises:
            ModelError: If a URDF is unfit, or the parts do not fit together.
        """
        with error_context(self.scenario, "robot."):
            return FreeFloatingModel.from_urdf(
                self.urdf, self.end_effector, scale_mass=self.scale_mass, held=self.held,
                spacecraft=self.spacecraft, payload=self.payload, attached=self.attached,
            )  # fmt: skip


def _body(section: SpacecraftSection | PayloadSection, folder: Path) -> dict[str, Any]:
    """Arguments of a spacecraft or payload, but for the mount."""
    return {
        "mass": section.mass,
        "inertia": np.array(section.inertia),
        "com": np.array(section.com),
        "size": None if section.size is None else np.array(section.size),
        "mesh": None if section.mesh is None else folder / section.mesh,
    }


def _attachment(section: AttachedSection, index: int, folder: Path) -> Attachment:
    try:
        urdf = find_robot(section.urdf, folder)
    except InputError as error:
        key = f"attached.{index}.{error.key}"
        raise type(error)(key, error.problem, error.accepted, error.source) from None
    return Attachment(urdf, section.link, _mount(section.mount), section.prefix)


def _mount(section: MountSection) -> Mount:
    return Mount(np.array(section.xyz), np.array(section.rpy))
