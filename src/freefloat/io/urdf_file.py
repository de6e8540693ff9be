"""URDF files of assembled robots, with their meshes."""

from __future__ import annotations

import io
import os
import shutil
from copy import deepcopy
from dataclasses import dataclass, field, replace
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np
import yourdfpy
from lxml import etree

from freefloat.dynamics.momentum import inertia_matrices
from freefloat.errors import InputError, ModelError
from freefloat.io.files import written_beside
from freefloat.robot.assembly import set_origin
from freefloat.robot.base import Base
from freefloat.robot.description import Joint
from freefloat.robot.free_base import add_table
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.parts import Mount
from freefloat.robot.rigid_bodies import displacement, held_value, leader_of
from freefloat.robot.source import MeshFileError, find_mesh
from freefloat.robot.urdf import rename_meshes
from freefloat.robot.urdf_xml import Element
from freefloat.so3 import UPRIGHT, Array


@dataclass(frozen=True, eq=False)
class UrdfFile:
    """A robot that was written to a URDF file."""

    file: Path  # the URDF file
    model: FreeFloatingModel = field(repr=False)  # the robot
    meshes: tuple[str, ...] = ()  # mesh files of the robot as the URDF names them
    missing: tuple[str, ...] = ()  # a sentence for each mesh file that does not exist

    @property
    def centre_of_mass(self) -> Array:
        """Centre of mass in the root's frame, moving joints at zero [m], shape (3,)."""
        # on a table the height is not the base's
        free = replace(self.model, base=Base.FREE, gravity=0.0)
        return -free.base_position(UPRIGHT, np.zeros(free.dof))

    @property
    def inertia(self) -> Array:
        """Inertia about the centre of mass, root's axes, moving joints at zero [kg m²], (3, 3)."""
        return inertia_matrices(self.model, np.zeros(self.model.dof))[0]

    @property
    def joints(self) -> tuple[tuple[Joint, float | None], ...]:
        """Joints of types that move, with their fixed values [rad or m]; None where they move."""
        model = self.model
        return tuple(
            (joint, None if joint.name in model.joint_names
             else held_value(model.description, joint.name, model.fixed_joints))
            for joint in model.description.joints if joint.moving
        )  # fmt: skip

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the URDF, and sentences on what is left out and on missing mesh files."""
        left_out = self.model.description.left_out
        return (*map(str, self.model.warnings), *left_out, *self.missing)

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of ``freefloat assemble``."""
        return {
            "file": str(self.file),
            "robot": self.model.description.name or None,
            "root": self.model.body_names[0],
            "base": str(self.model.base),
            "end_effector": self.model.end_effector,
            "total_mass": self.model.total_mass,
            "centre_of_mass": self.centre_of_mass.tolist(),
            "inertia": self.inertia.tolist(),
            "joints": [
                {"name": joint.name, "type": joint.type, "moves": value is None, "held": value}
                for joint, value in self.joints
            ],
            "warnings": list(self.warnings),
            "meshes": list(self.meshes),
        }


def write_urdf(model: FreeFloatingModel, file: Path, copy_meshes: bool = False) -> UrdfFile:
    """Write the URDF of a robot; joints that are fixed by name become fixed joints.

    Args:
        model: The robot.
        file: The URDF file.
        copy_meshes: Copy mesh files into a folder beside the URDF and name them relative to it;
            else they are named by their absolute paths.

    Raises:
        InputError: If the file cannot be written.
        ModelError: If another reader of URDFs refuses the robot.
    """
    robot = etree.fromstring(model.description.text)
    source = model.description.file
    _fix_joints(robot, model)
    _require_readable(robot)
    found: dict[str, Path] = {}
    missing: dict[str, str] = {}
    for name in {str(mesh.get("filename")) for mesh in robot.iter("mesh")}:
        try:
            found[name] = find_mesh(name, source).resolve()
        except MeshFileError as error:
            missing[name] = f"mesh {name}: {error}"
    names = {name: str(path) for name, path in found.items()}
    if copy_meshes and found:
        folder = file.resolve().parent / f"{file.stem}_meshes"
        copies = _copy(sorted(set(found.values())), folder)
        names = {name: f"{folder.name}/{copies[path]}" for name, path in found.items()}
    if model.on_table:
        add_table(robot, model.body_names[0])
    rename_meshes(robot, lambda name: names.get(name, name))
    etree.indent(robot)
    with written_beside(file) as temporary:
        temporary.write_bytes(etree.tostring(robot, encoding="utf-8", xml_declaration=True))
    meshes = tuple(sorted(set(names.values())))
    return UrdfFile(file, model, meshes, tuple(sorted(missing.values())))


def _fix_joints(robot: Element, model: FreeFloatingModel) -> None:
    """Fix the joints that have a value by name, and joints that follow them, where they are."""
    description, fixed = model.description, model.fixed_joints
    for joint in description.joints:
        if leader_of(description, joint, fixed).name not in fixed:
            continue
        (element,) = robot.xpath("joint[@name=$name]", name=joint.name)
        for part in element.xpath("*[not(self::parent or self::child)]"):
            element.remove(part)
        pose = joint.origin @ displacement(joint, held_value(description, joint.name, fixed))
        element.set("type", "fixed")
        set_origin(etree.SubElement(element, "origin"), Mount.of("held", pose))


def _require_readable(robot: Element) -> None:
    """Raise a ModelError unless yourdfpy loads the robot, too; it does not know capsules."""
    robot = deepcopy(robot)
    for capsule in robot.findall("link/*/geometry/capsule"):
        shape = capsule.getparent().getparent()
        shape.getparent().remove(shape)
    try:
        loaded: Any = yourdfpy.URDF.load(
            io.BytesIO(etree.tostring(robot)), load_meshes=False, build_scene_graph=True
        )
        valid = loaded.validate()
        errors = "; ".join(str(error) for error in loaded.errors)
    except Exception as error:  # of any kind: yourdfpy does not check its input
        valid = False
        errors = str(error).strip() or type(error).__name__
    if not valid:
        raise ModelError("urdf", f"yourdfpy refuses the assembly ({errors})", "valid URDFs")


def _copy(files: list[Path], folder: Path) -> dict[Path, str]:
    """Copy mesh files, each beside the material file of its name, into a folder; their names there.

    Where a name is taken, the two are copied into a numbered folder in it.
    """
    names: dict[Path, str] = {}
    taken: set[str] = set()
    try:
        folder.mkdir(exist_ok=True)
        for file in sorted(files, key=lambda path: len(path.parts)):  # copies stay where they are
            materials = [file.with_suffix(".mtl")] if file.suffix.lower() == ".obj" else []
            originals = [file, *filter(Path.is_file, materials)]
            keys = {original.name.casefold() for original in originals}
            places = chain([""], (f"{number}/" for number in count(2)))
            place = next(p for p in places if taken.isdisjoint(p + key for key in keys))
            taken |= {place + key for key in keys}
            names[file] = place + file.name
            (folder / place).mkdir(exist_ok=True)
            for original in originals:
                target = folder / place / original.name
                if target.is_symlink() or (target.exists() and not target.is_file()):
                    raise InputError("output", f"{target} is no regular file", "another name")
                if not (target.exists() and os.path.samefile(original, target)):
                    shutil.copyfile(original, target)
    except OSError as error:
        accepted = "an existing, writable folder with enough space"
        raise InputError("output", f"{folder}: {error.strerror}", accepted) from None
    return names
