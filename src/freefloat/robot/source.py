"""Files of a robot: how URDF, xacro and MuJoCo files are read, and where their meshes are."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from numbers import Real
from pathlib import Path
from urllib.parse import unquote, urlsplit

from freefloat.errors import InputError, ModelError, one_line, require_extra, require_type
from freefloat.kinds import READERS
from freefloat.robot.named_files import examples_folder, find_robot, is_file, read_text
from freefloat.robot.reader_process import UrdfText, run_reader

URDF_TEXT = "URDF text"
"""What text is called in place of a file."""
_URDF = "a file, XML text, or a name such as spatial_6dof"
_MJCF = re.compile(r"\s*+(?>(?:<\?.*?\?>|<!--.*?-->)\s*+)*+<mujoco\b", re.DOTALL)
"""Beginning of a model of MuJoCo; comments are matched once, without backtracking."""
_PACKAGE_NAME = re.compile(r"<name>\s*([^<\s]+)\s*</name>")
"""The name in a ``package.xml`` of ROS."""
PACKAGES = "above the file, on ROS_PACKAGE_PATH or under AMENT_PREFIX_PATH"
"""Where packages of ROS are looked for."""
NAMED_PACKAGE = "--package {0}=FOLDER (robot.packages in a scenario)"
"""What names the folder of a package."""


@dataclass(frozen=True)
class RobotSource:
    """A robot's file, with what its reader has to know.

    Attributes:
        urdf: A URDF, xacro or MJCF file, XML text of a URDF, or a name: of a bundled robot, as
            ``"spatial_6dof"``, ``"example-robot-data:ur10"``, ``"robot_descriptions:panda"``.
        root: Body of a model of MuJoCo that is the spacecraft; default: the only body in the
            world, else the only one with a free joint and bodies that move on it. ``"world"`` is a
            root without mass for arms that stand in the world.
        packages: Folders of packages of ROS, by name; others are looked for above the file.
        arguments: Values of arguments of a xacro file, by name; others have their defaults.
        srdf: An SRDF file, also as xacro, of whose content pairs of links that are not compared for
            contact are read, ``<disable_collisions>``.

    Raises:
        InputError: If a value has another type, or a folder or the SRDF file does not exist.

    Example:
        >>> robot = ff.RobotSource("planar_2dof", packages={"my_arm_description": "/tmp"})
        >>> ff.FreeFloatingModel.from_urdf(robot).dof
        2
    """

    urdf: str | Path
    root: str | None = None
    packages: Mapping[str, str | Path] = field(default_factory=dict, hash=False)
    arguments: Mapping[str, str | float | bool] = field(default_factory=dict, hash=False)
    srdf: str | Path | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.urdf, os.PathLike):
            require_type("urdf", self.urdf, str, _URDF)
        require_type("root", self.root, str | None, "the name of a body")
        require_type("packages", self.packages, Mapping, "a map from package to folder")
        for name, folder in self.packages.items():
            require_type(f"packages.{name}", folder, str | os.PathLike, "a folder")
            if not Path(folder).is_dir():
                raise InputError(f"packages.{name}", f"{folder} is no folder", "an existing folder")
        require_type("arguments", self.arguments, Mapping, "a map from argument to value")
        for name, value in self.arguments.items():
            require_type(f"arguments.{name}", value, str | Real, "text, a number, true or false")
        require_type("srdf", self.srdf, str | Path | None, "an SRDF file")
        if self.srdf is not None and not is_file(Path(self.srdf)):
            raise InputError("srdf", f"{self.srdf}: no such file", "an SRDF file")

    @classmethod
    def of(cls, urdf: str | Path | RobotSource) -> RobotSource:
        """The source of a file, text or name; a source is returned as it is."""
        return urdf if isinstance(urdf, RobotSource) else cls(urdf)

    @property
    def is_text(self) -> bool:
        """Whether the source is XML text and not the name of a file."""
        return isinstance(self.urdf, str) and self.urdf.lstrip("\ufeff \t\r\n").startswith("<")

    def found(self) -> RobotSource:
        """The source, with the file of a robot in place of its name; a ModelError without one."""
        if self.is_text or is_file(Path(self.urdf)):
            return self
        try:
            return replace(self, urdf=find_robot(str(self.urdf), Path()))
        except InputError as error:
            raise ModelError(error.key, error.problem, error.accepted) from None

    @property
    def name(self) -> str:
        """The file, or ``"URDF text"``."""
        return URDF_TEXT if self.is_text else str(Path(self.urdf))

    @property
    def altered(self) -> bool:
        """Whether the robot is not the one that the file alone describes."""
        return bool(self.root or self.arguments or self.srdf)

    @property
    def semantics(self) -> RobotSource | None:
        """The SRDF file, which is read as the robot's own."""
        return None if self.srdf is None else RobotSource(self.srdf, packages=self.packages)

    def read(self) -> UrdfText:
        """Text of the URDF, also of what a xacro or MJCF file describes.

        Raises:
            ValueError: If the file cannot be read.
            ModelError: If the reader of a xacro or MJCF file refuses it.
            MissingExtraError: If this reader is not installed.
        """
        file = Path(URDF_TEXT if self.is_text else self.urdf)
        text = str(self.urdf) if self.is_text else read_text(file)
        xacro = file.suffix == ".xacro"
        mjcf = not (self.is_text or xacro) and _MJCF.match(text)
        if self.root is not None and not mjcf:
            problem = f"{self.root} was given, but this is no model of MuJoCo"
            accepted = "nothing: its root is the link without parent"
            raise ModelError("root", problem, accepted, self.name)
        if self.arguments and not xacro:
            problem = f"{', '.join(self.arguments)} was given, but this is no xacro file"
            accepted = "nothing, or a file whose name ends in .xacro"
            raise ModelError("arguments", problem, accepted, self.name)
        if xacro:
            require_extra("xacro", "xacro")
            folders = {name: os.path.abspath(folder) for name, folder in self.packages.items()}
            arguments = {name: _text(value) for name, value in self.arguments.items()}
            return run_reader(READERS["xacro"], file, packages=folders, arguments=arguments)
        if mjcf:
            require_extra("mujoco", "mujoco")
            return run_reader(READERS["mjcf"], file, root=self.root)
        return UrdfText(text)

    def mesh_name(self, name: str) -> str:
        """The name of a mesh file, absolute where it is in one of the named packages."""
        for package, folder in self.packages.items():
            prefix = f"package://{package}/"
            if name.startswith(prefix):
                return f"file://{Path(folder).absolute()}/{name.removeprefix(prefix)}"
        return name


def _text(value: str | float | bool) -> str:
    """The value of an argument as it is written in a file."""
    return str(value).lower() if isinstance(value, bool) else str(value)


class MeshFileError(Exception):
    """A mesh file that does not exist or cannot be read; the message is one line.

    Attributes:
        reason: What is wrong with it.
        remedy: What to do, where that is known.
    """

    def __init__(self, reason: str, remedy: str = "") -> None:
        super().__init__(one_line(f"{reason}; {remedy}" if remedy else reason))
        self.reason, self.remedy = one_line(reason), one_line(remedy)


def find_mesh(name: str, urdf: str) -> Path:
    """The mesh file that a name in a URDF refers to.

    Args:
        name: ``package://NAME/...``, ``model://NAME/...``, ``file://...``, an absolute path, or one
            relative to the URDF's folder. Codes such as ``%20`` in addresses are decoded if no
            file has the name as it is written.
        urdf: The URDF's file; for XML text names are relative to the current folder.

    Raises:
        MeshFileError: If there is no such file.
    """
    try:
        split = urlsplit(name.replace("\\", "/"), allow_fragments=False)
    except ValueError as error:
        raise MeshFileError(f"its name is no address ({error})") from None
    written = f"{split.path}?{split.query}" if split.query else split.path
    paths = written, unquote(written)
    if split.scheme in ("package", "model"):
        folder, package = Path(urdf), split.netloc
        places = [
            place for path in paths for place in _in_package(package, path.lstrip("/"), folder)
        ]
    elif split.scheme == "file":
        places = [Path(path) for path in paths]
    elif len(split.scheme) > 1:  # one letter is a drive
        raise MeshFileError(f"{split.scheme}:// files are not fetched")
    else:
        places = [Path(name) if Path(name).is_absolute() else Path(urdf).absolute().parent / name]
    for place in places:
        if is_file(place):
            return place
    remedy = ""
    if split.scheme in ("package", "model"):
        named = NAMED_PACKAGE.format(split.netloc)
        remedy = f"{named}; or a folder {split.netloc} {PACKAGES}"
    raise MeshFileError("no such file", remedy)


def _in_package(package: str, rest: str, urdf: Path) -> Iterator[Path]:
    """Paths that a file of a package may have, in order of precedence."""
    yield from (folder / rest for folder in _package_folders(package, urdf))
    with suppress(InputError):
        examples = examples_folder()
        if package == examples.parent.name:
            yield examples.parent / rest
        yield examples / package / rest


def find_package(package: str, file: Path) -> Path | None:
    """The folder of a package of ROS, above a file or where ROS has it; None without."""
    return next(filter(Path.is_dir, _package_folders(package, file)), None)


def _package_folders(package: str, file: Path) -> Iterator[Path]:
    """Folders that a package of ROS may have, in order of precedence."""
    ros, ament = (
        [Path(word) for word in os.environ.get(variable, "").split(os.pathsep) if word]
        for variable in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")
    )
    for folder in [*file.absolute().parents, *ros]:
        if folder.name == package or _declared_package(folder) == package:
            yield folder
        yield folder / package
    yield from (folder / "share" / package for folder in ament)


def _declared_package(folder: Path) -> str | None:
    """The name that the ``package.xml`` of a folder declares."""
    declaration = folder / "package.xml"
    if not is_file(declaration):
        return None
    with suppress(ValueError):
        name = _PACKAGE_NAME.search(read_text(declaration))
        return name and name[1]
    return None
