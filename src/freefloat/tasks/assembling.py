"""The work of ``assemble``: what its options ask for, as the parts of a robot."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from freefloat.errors import InputError
from freefloat.io.field_types import RADIANS
from freefloat.io.robot_parts import RobotParts
from freefloat.io.scenario import load_robot
from freefloat.robot.assembly import end_effector_link
from freefloat.robot.names import bundled_scenarios, find_robot
from freefloat.robot.parts import Attachment, Mount, Payload, Spacecraft
from freefloat.robot.validation import read_urdf
from freefloat.so3 import Array

Place = tuple[float, float, float, float, float, float]
"""x, y, z [m], then roll, pitch, yaw [rad]."""
Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Lump:
    """A rigid body as options tell it; all None where there is none.

    Attributes:
        name: What it is, and what its options begin with.
        mass: [kg].
        inertia: Three, six or nine numbers with commas between [kg m²].
        com: Centre of mass [m].
        size: Edges of a box [m].
        mesh: A mesh file.
        mount: Where the arm stands on it.
    """

    name: str
    mass: float | None
    inertia: str | None
    com: Triple | None
    size: Triple | None
    mesh: Path | None
    mount: Place | None = None

    @property
    def wanted(self) -> bool:
        """Whether there is such a body.

        Raises:
            InputError: If there is something to say of it, but not its mass and inertia.
        """
        told = (self.mass, self.inertia, self.com, self.size, self.mesh, self.mount)
        if all(one is None for one in told):
            return False
        for key, given in (("mass", self.mass), ("inertia", self.inertia)):
            if given is None:
                raise InputError(
                    f"{self.name}.{key}", "it is missing", "a mass and an inertia for every body"
                )
        return True

    def body(self) -> dict[str, Any]:
        """What a spacecraft and a payload have in common."""
        key = f"{self.name}.inertia"
        return {
            "mass": self.mass,
            "inertia": _numbers(key, self.inertia or ""),
            "com": np.array(self.com or (0.0, 0.0, 0.0)),
            "size": None if self.size is None else np.array(self.size),
            "mesh": self.mesh,
        }


@dataclass(frozen=True)
class Wishes:
    """What the options ask for.

    Attributes:
        end_effector: The link that follows the path.
        spacecraft: Under the arm.
        payload: Held by the end-effector.
        tool: URDF fixed to the end-effector, and where.
        second_arm: URDF fixed to the spacecraft, and where.
    """

    end_effector: str | None
    spacecraft: Lump
    payload: Lump
    tool: tuple[str | None, Place | None]
    second_arm: tuple[str | None, Place | None]

    @property
    def any(self) -> bool:
        """Whether a scenario's robot would have to be another one."""
        extra = (self.end_effector, *self.tool, *self.second_arm)
        lumps = self.spacecraft.wanted or self.payload.wanted
        return lumps or any(one is not None for one in extra)


def robot_parts(name: str, wishes: Wishes) -> RobotParts:
    """The robot of a scenario, or a URDF's with what the options say.

    Args:
        name: A URDF, a scenario, or a bundled name of either; ``example-robot-data:NAME``.
        wishes: For a URDF.

    Raises:
        InputError: If there is no such robot, or the options make no sense.
    """
    if name in bundled_scenarios() or name.endswith((".yaml", ".yml")):
        if wishes.any:
            raise InputError(
                "options", "the scenario says all of its robot", "-o, --copy-meshes and --json"
            )
        return load_robot(name)
    return _parts(find_robot(name, Path()), wishes)


def _parts(urdf: Path, wishes: Wishes) -> RobotParts:
    attached = []
    for key, (name, place) in (("tool", wishes.tool), ("second_arm", wishes.second_arm)):
        if name is None and place is not None:
            raise InputError(key, "it is missing, only where it stands was given", "a URDF")
    second, where = wishes.second_arm
    if second is not None:
        attached.append(_attachment("second_arm", second, None, where, "second_"))
    tool, where = wishes.tool
    if tool is not None:
        carrier = end_effector_link(read_urdf(urdf), wishes.end_effector)
        attached.append(_attachment("tool", tool, carrier, where, "tool_"))
    body, held = wishes.spacecraft, wishes.payload
    return RobotParts(
        urdf,
        wishes.end_effector,
        spacecraft=Spacecraft(**body.body(), mount=_mount("mount", body.mount))
        if body.wanted
        else None,
        payload=Payload(**held.body()) if held.wanted else None,
        attached=tuple(attached),
    )


def _attachment(
    key: str, name: str, link: str | None, where: Place | None, prefix: str
) -> Attachment:
    mount = _mount(f"{key.removesuffix('_arm')}_mount", where)
    try:
        return Attachment(find_robot(name, Path()), link, mount, prefix)
    except InputError as error:
        raise InputError(key, error.problem, error.accepted) from None


def _mount(key: str, where: Place | None) -> Mount:
    if where is None:
        return Mount()
    if np.abs(where[3:]).max() > 2.0 * np.pi:
        angles = " ".join(f"{angle:g}" for angle in where[3:])
        raise InputError(key, f"the angles {angles} were given", f"x y z [m], then {RADIANS}")
    return Mount(np.array(where[:3]), np.array(where[3:]))


def _numbers(key: str, text: str) -> Array:
    try:
        return np.array([float(word) for word in text.replace(",", " ").split()])
    except ValueError:
        accepted = "three, six or nine numbers with commas between"
        raise InputError(key, f"{text!r} was given", accepted) from None
