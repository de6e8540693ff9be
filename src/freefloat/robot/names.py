"""Files by name: bundled robots, scenarios and studies, example-robot-data, meshes of a URDF."""

from __future__ import annotations

import difflib
import os
import re
import sysconfig
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from importlib import import_module
from importlib.metadata import PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path
from pkgutil import iter_modules
from urllib.parse import unquote, urlsplit

from freefloat.errors import InputError, did_you_mean, one_line

_EXAMPLES = "example-robot-data"
EXAMPLE = f"{_EXAMPLES}:"
"""Prefix of the names of that package's robots."""
DESCRIPTIONS = "robot_descriptions:"
"""Prefix of the names of robots of the package robot_descriptions."""
_LARGEST = 20_000_000
"""Size limit of a text file [bytes]."""
_NEAREST = 5
"""Number of names that are listed for an unknown one of a package of robots."""
_PACKAGE_NAME = re.compile(r"<name>\s*([^<\s]+)\s*</name>")
"""The name in a ``package.xml`` of ROS."""
PACKAGES = "above the file, on ROS_PACKAGE_PATH or under AMENT_PREFIX_PATH"
"""Where packages of ROS are looked for."""
NAMED_PACKAGE = "--package {0}=FOLDER (robot.packages in a scenario)"
"""What names the folder of a package."""


def models_folder() -> Path:
    """The folder of the bundled robots: in an installed package, or beside ``src``."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "models"
    return installed if installed.is_dir() else package.parents[1] / "models"


def bundled_scenarios() -> tuple[str, ...]:
    """Names of the bundled scenarios, such as ``spatial_6dof/line``."""
    folder = models_folder()
    return tuple(sorted(f"{path.parent.name}/{path.stem}" for path in folder.glob("*/*.yaml")))


def is_scenario(name: str) -> bool:
    """Whether a name is that of a scenario, bundled or a file."""
    return name in bundled_scenarios() or name.endswith((".yaml", ".yml"))


def bundled_studies() -> tuple[str, ...]:
    """Names of the bundled studies, such as ``spatial_6dof/montecarlo``."""
    files = models_folder().glob("*/studies/*.yaml")
    return tuple(sorted(f"{path.parents[1].name}/{path.stem}" for path in files))


def bundled_robots() -> tuple[str, ...]:
    """Names of the bundled robots, such as ``spatial_6dof``."""
    return tuple(sorted(path.stem for path in models_folder().glob("*/*.urdf")))


def bundled_bodies() -> dict[str, Path]:
    """The URDFs of the bundled bodies of scenes, such as ``client``, by name."""
    return {path.stem: path for path in sorted(models_folder().glob("*/bodies/*.urdf"))}


def find_scenario(name: str) -> Path:
    """The scenario file of a path or a bundled name.

    Raises:
        InputError: Listing the bundled names when there is neither.
    """
    return _find("scenario", name, bundled_scenarios(), ".")


def find_study(name: str) -> Path:
    """The study file of a path or a bundled name.

    Raises:
        InputError: Listing the bundled names when there is neither.
    """
    return _find("study", name, bundled_studies(), "studies")


def _find(kind: str, name: str, known: tuple[str, ...], below: str) -> Path:
    if is_file(Path(name)):
        return Path(name)
    if name in known:
        robot, _, stem = name.partition("/")
        return models_folder() / robot / below / f"{stem}.yaml"
    raise unknown(kind, name, known, f"a {kind} file, or one of")


def find_robot(name: str, folder: Path) -> Path:
    """The URDF file of a path, or else of the name of a bundled robot or body of a scene.

    Args:
        name: The path or name; ``example-robot-data:NAME`` and ``robot_descriptions:NAME`` are
            robots of these packages.
        folder: The folder that the path is relative to.

    Raises:
        InputError: Listing the known names when it is none of them.
    """
    if name.startswith(EXAMPLE):
        robots = example_robots()
        short = name.removeprefix(EXAMPLE).removesuffix("_robot")
        if short not in robots:
            raise _unknown_in_package(EXAMPLE, short, sorted(robots))
        return robots[short]
    if name.startswith(DESCRIPTIONS):
        return described_robot(name.removeprefix(DESCRIPTIONS))
    path = folder / name
    stem = name.removesuffix(".urdf")
    if is_file(path):
        return path
    if stem in bundled_robots():
        return models_folder() / stem / f"{stem}.urdf"
    if stem in bundled_bodies():
        return bundled_bodies()[stem]
    names = [*bundled_robots(), *bundled_bodies(), f"{EXAMPLE}NAME"]
    with suppress(InputError):
        short = stem.removesuffix("_robot")
        names += [EXAMPLE + short] if short in example_robots() else []
    raise unknown("urdf", name, names, "a URDF file, or one of")


def described_robot(name: str) -> Path:
    """The URDF or MJCF file of a robot of the package robot_descriptions.

    That package downloads a robot when it is first asked for.

    Args:
        name: With or without ``_description``, such as ``panda``.

    Raises:
        InputError: If the package is not installed, has no such robot or cannot download it.
    """
    short = name.removesuffix("_description")
    known = described_robots()
    if short not in known:
        raise _unknown_in_package(DESCRIPTIONS, short, known)
    module = f"robot_descriptions.{short}_description"
    try:
        robot = import_module(module)
    except Exception as error:  # of any kind: it runs git
        problem = f"robot_descriptions cannot load {name} ({one_line(str(error))})"
        raise InputError("urdf", problem, "a robot that it can download") from None
    for key in ("URDF_PATH", "MJCF_PATH"):
        if hasattr(robot, key):
            return Path(getattr(robot, key))
    raise InputError("urdf", f"{module} names no file", "a robot with a URDF or MJCF file")


def described_robots() -> tuple[str, ...]:
    """Names of the robots of the package robot_descriptions, without ``_description``.

    Raises:
        InputError: If the package is not installed.
    """
    package = find_spec("robot_descriptions")
    if package is None:
        problem = "the package robot_descriptions is not installed"
        raise InputError("urdf", problem, "pip install robot_descriptions, or a file")
    modules = (module.name for module in iter_modules(package.submodule_search_locations))
    suffix = "_description"
    return tuple(sorted(name.removesuffix(suffix) for name in modules if name.endswith(suffix)))


def _unknown_in_package(prefix: str, name: str, known: Sequence[str]) -> InputError:
    """The error for an unknown robot of a package, with the most similar ones."""
    near = difflib.get_close_matches(name[:240], known, _NEAREST, cutoff=0.0)
    problem = f"{prefix.removesuffix(':')} has no robot {name[:240]!r}"
    accepted = f"one of its {len(known)} robots, such as"
    return InputError("urdf", problem, f"{accepted} {', '.join(prefix + robot for robot in near)}")


def example_robots() -> dict[str, Path]:
    """The URDFs of the package example-robot-data by file name without ``_robot``.

    A name that several files have includes the folder, as in ``anymal_c_simple/anymal``.

    Raises:
        InputError: If the package is not installed.
    """
    folder = examples_folder()
    files = sorted(folder.glob("*/**/*.urdf"))
    count = Counter(path.stem for path in files)
    named = {}
    for path in files:
        owner = path.relative_to(folder).parts[0].removesuffix("_description")
        named[path.stem if count[path.stem] == 1 else f"{owner}/{path.stem}"] = path
    for name in [name for name in named if name.endswith("_robot")]:
        named[name.removesuffix("_robot")] = named.pop(name)  # ur3.urdf has no link: the other one
    return named


def examples_folder() -> Path:
    """The folder in which pip, conda or the system installed the robots of example-robot-data.

    Raises:
        InputError: If the package is not installed.
    """
    shared = [Path(sysconfig.get_path("data")) / "share"]
    with suppress(PackageNotFoundError):
        shared.insert(0, Path(str(distribution(_EXAMPLES).locate_file("cmeel.prefix/share"))))
    for folder in shared:
        if (folder / _EXAMPLES / "robots").is_dir():
            return folder / _EXAMPLES / "robots"
    problem = f"the package {_EXAMPLES} is not installed"
    raise InputError("urdf", problem, f"pip install {_EXAMPLES}, or a file")


def is_file(path: Path) -> bool:
    """Whether there is such a file; False for names that no file can have."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def read_text(path: Path) -> str:
    """The text of a UTF-8 file, line ends as they are.

    Raises:
        ValueError: Saying why it cannot be read, or that it is larger than 20 MB.
    """
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):  # devices never end
            raise ValueError("it is not a regular file")
        if path.stat().st_size > _LARGEST:
            raise ValueError(f"it has more than {_LARGEST:,} bytes")
        return path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise ValueError(str(error.strerror)) from None
    except UnicodeDecodeError:
        raise ValueError("it is not UTF-8 text") from None


def unknown(key: str, name: str, names: Sequence[str], what: str) -> InputError:
    """The error for an unknown name, with the most similar known one."""
    problem = f"no such file or name: {name[:240]}{did_you_mean(name, names)}"
    return InputError(key, problem, f"{what} {', '.join(names)}")


class MeshFileError(Exception):
    """A mesh file that does not exist or cannot be read; the message is one line."""

    def __init__(self, reason: str) -> None:
        super().__init__(one_line(reason))


def find_mesh(name: str, urdf: str) -> Path:
    """The mesh file that a name in a URDF refers to.

    Args:
        name: ``package://NAME/...``, ``model://NAME/...``, ``file://...``, an absolute path, or one
            relative to the URDF's folder.
        urdf: The URDF's file; for XML text names are relative to the current folder.

    Raises:
        MeshFileError: If there is no such file.
    """
    try:
        split = urlsplit(name.replace("\\", "/"))
    except ValueError as error:
        raise MeshFileError(f"its name is no address ({error})") from None
    if split.scheme in ("package", "model"):
        places = list(_in_package(split.netloc, unquote(split.path).lstrip("/"), Path(urdf)))
    elif split.scheme == "file":
        places = [Path(unquote(split.path))]
    elif len(split.scheme) > 1:  # one letter is a drive
        raise MeshFileError(f"{split.scheme}:// files are not fetched")
    else:
        places = [Path(name) if Path(name).is_absolute() else Path(urdf).absolute().parent / name]
    for place in places:
        if is_file(place):
            return place
    hint = ""
    if split.scheme in ("package", "model"):
        named = NAMED_PACKAGE.format(split.netloc)
        hint = f" in a folder {split.netloc} {PACKAGES}; {named} names one"
    raise MeshFileError(f"no such file{hint}")


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
