"""A robot put together: checked, written as one URDF, told in numbers."""

from __future__ import annotations

import io
import os
import shutil
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yourdfpy

from freefloat.errors import InputError, ModelError
from freefloat.io.files import written_beside
from freefloat.io.robot_parts import RobotParts
from freefloat.robot.assembly import rename_meshes
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.names import MeshFileError, find_mesh
from freefloat.so3 import Array


@dataclass(frozen=True, eq=False)
class Assembled:
    """A robot, put together and checked.

    Attributes:
        robot: The ``<robot>``.
        source: The arm's file; meshes are named as seen from it.
        model: The same, to reckon with.
    """

    robot: ET.Element
    source: str
    model: FreeFloatingModel

    @classmethod
    def of(cls, parts: RobotParts) -> Assembled:
        """Put a robot together.

        Raises:
            InputError: If the parts do not fit together.
        """
        model = parts.model()
        robot = ET.fromstring(model.description.text)
        _check(robot)
        return cls(robot, str(parts.urdf), model)

    def write(self, file: Path, copy_meshes: bool) -> tuple[list[str], list[str]]:
        """Write the URDF.

        Args:
            file: The URDF.
            copy_meshes: Copy mesh files into a folder beside it and name them relative to it;
                else they are named by their absolute paths.

        Returns:
            The mesh files, and sentences about those that are not there.

        Raises:
            InputError: If it cannot be written.
        """
        folder = file.resolve().parent / f"{file.stem}_meshes"
        found: dict[str, Path] = {}
        missing: dict[str, str] = {}
        for name in {str(mesh.get("filename")) for mesh in self.robot.iter("mesh")}:
            try:
                found[name] = find_mesh(name, self.source).resolve()
            except MeshFileError as error:
                missing[name] = f"mesh {name}: {error}"
        places = {name: str(path) for name, path in found.items()}
        if copy_meshes and found:
            copies = _copied(sorted(set(found.values())), folder)
            places = {name: f"{folder.name}/{copies[path]}" for name, path in found.items()}
        rename_meshes(self.robot, lambda name: places.get(name, name))
        ET.indent(self.robot)
        with written_beside(file) as temporary:
            ET.ElementTree(self.robot).write(temporary, encoding="utf-8", xml_declaration=True)
        return sorted(set(places.values())), sorted(missing.values())

    def document(self) -> dict[str, Any]:
        """What the robot is: mass, centre of mass, inertia, joints."""
        mass, centre, inertia = mass_properties(self.model)
        return {
            "robot": self.robot.get("name"),
            "root": self.model.body_names[0],
            "end_effector": self.model.end_effector,
            "total_mass": mass,
            "centre_of_mass": centre.tolist(),
            "inertia": inertia.tolist(),
            "joints": [_joint(joint, self.model) for joint in self.robot.findall("joint")
                       if joint.get("type") != "fixed"],
            "warnings": [str(warning) for warning in self.model.warnings],
        }  # fmt: skip


def mass_properties(model: FreeFloatingModel) -> tuple[float, Array, Array]:
    """Mass of the whole robot, its centre of mass, and its inertia about that.

    The moving joints are at zero, held ones where they are held.

    Returns:
        The mass [kg]; the centre in the root link's frame [m], shape (3,); the inertia in its axes
        [kg m²], shape (3, 3).
    """
    poses = model.body_poses([0.0, 0.0, 0.0, 1.0], np.zeros(model.dof))
    inertia = np.zeros((3, 3))
    for body, pose in zip(model.bodies, poses, strict=True):
        r = pose.position + pose.rotation @ body.centre  # from the centre of mass of all
        inertia += pose.rotation @ body.inertia @ pose.rotation.T
        inertia += body.mass * (r @ r * np.eye(3) - np.outer(r, r))
    return model.total_mass, -poses[0].position, inertia


def _check(robot: ET.Element) -> None:
    """Have another reader of URDFs load it, too."""
    try:
        loaded: Any = yourdfpy.URDF.load(
            io.BytesIO(ET.tostring(robot)), load_meshes=False, build_scene_graph=True
        )
        valid, told = loaded.validate(), "; ".join(str(error) for error in loaded.errors)
    except Exception as error:  # the parser takes what it expects for granted
        valid, told = False, str(error).strip() or type(error).__name__
    if not valid:
        raise ModelError("urdf", f"yourdfpy refuses what was put together ({told})", "valid URDFs")


def _copied(files: list[Path], folder: Path) -> dict[Path, str]:
    """Copy mesh files, and what lies beside them under the same name, into a folder."""
    names: dict[Path, str] = {}
    try:
        folder.mkdir(exist_ok=True)
        for file in files:
            taken = {name.casefold() for name in names.values()}
            name, number = file.name, 2
            while name.casefold() in taken:
                name, number = f"{file.stem}_{number}{file.suffix}", number + 1
            names[file] = name
            for one in (file, *file.parent.glob(f"{file.stem}.mtl")):
                target = folder / (name if one == file else one.name)
                if not (target.exists() and os.path.samefile(one, target)):
                    shutil.copyfile(one, target)
    except OSError as error:
        accepted = "a folder that exists, may be written to and has room"
        raise InputError("output", f"{folder}: {error.strerror}", accepted) from None
    return names


def _joint(joint: ET.Element, model: FreeFloatingModel) -> dict[str, Any]:
    name = str(joint.get("name"))
    moves = name in model.joint_names
    return {
        "name": name,
        "type": joint.get("type"),
        "moves": moves,
        "held": None if moves else float(model.held.get(name, 0.0)),
    }
