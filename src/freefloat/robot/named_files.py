"""Files by name: bundled robots, scenarios and studies, and robots of other packages."""

from __future__ import annotations

import difflib
import re
import sysconfig
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path
from pkgutil import iter_modules

from freefloat.errors import InputError, did_you_mean, one_line

_LARGEST = 20_000_000
"""Size limit of a text file [bytes]."""
_ONE_BYTE = re.compile(
    rb"""\s*<\?xml\s[^>]{,80}\bencoding\s*=\s*["'](iso-8859-\d+|windows-\d+)["']""", re.IGNORECASE
)
"""A declaration of XML that names an encoding of one byte a character."""
_EXAMPLES = "example-robot-data"
EXAMPLE = f"{_EXAMPLES}:"
"""Prefix of the names of that package's robots."""
DESCRIPTIONS = "robot_descriptions:"
"""Prefix of the names of robots of the package robot_descriptions."""
_LISTED = 5
"""Number of names that are listed for an unknown robot of a package."""


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
    """Whether a name stands for a scenario, bundled or a file."""
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
        return example_robot(name.removeprefix(EXAMPLE))
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


def is_file(path: Path) -> bool:
    """Whether there is such a file; False for names that no file can have."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def read_text(path: Path) -> str:
    """The text of a file in UTF-8, or as its XML declaration says; line ends as they are.

    Raises:
        ValueError: Saying why it cannot be read, or that it is larger than 20 MB.
    """
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):  # devices never end
            raise ValueError("it is not a regular file")
        if path.stat().st_size > _LARGEST:
            raise ValueError(f"it has more than {_LARGEST:,} bytes")
        content = path.read_bytes()
    except OSError as error:
        raise ValueError(str(error.strerror)) from None
    encoding = _encoding(content)
    try:
        return content.decode(encoding).removeprefix("\ufeff")
    except (UnicodeDecodeError, LookupError):
        raise ValueError(f"it is not {encoding} text") from None


def _encoding(content: bytes) -> str:
    """UTF-16 with a byte order mark, an encoding of one byte that XML declares, or UTF-8."""
    if content.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        return "UTF-16"
    declared = _ONE_BYTE.match(content)
    return declared[1].decode() if declared else "UTF-8"


def unknown(key: str, name: str, names: Sequence[str], what: str) -> InputError:
    """The error for an unknown name, with the most similar known one."""
    problem = f"no such file or name: {name[:240]}{did_you_mean(name, names)}"
    return InputError(key, problem, f"{what} {', '.join(names)}")


def example_robot(name: str) -> Path:
    """The URDF of a robot of the package example-robot-data, see :func:`example_robots`.

    Raises:
        InputError: If the package is not installed, or has no such robot.
    """
    robots = example_robots()
    short = name.removesuffix("_robot")
    if short not in robots:
        raise _unknown_robot(EXAMPLE, short, sorted(robots))
    return robots[short]


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
        raise _unknown_robot(DESCRIPTIONS, short, known)
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


def _unknown_robot(prefix: str, name: str, known: Sequence[str]) -> InputError:
    """The error for an unknown robot of a package, with the most similar ones."""
    near = difflib.get_close_matches(name[:240], known, _LISTED, cutoff=0.0)
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


@cache
def examples_folder() -> Path:
    """The folder of the robots of the package example-robot-data.

    Its wheel lists it among its files; it has no Python module, which is the package
    example-robot-data-loaders. conda and the system have it in the folder of shared data.

    Raises:
        InputError: If the package is not installed.
    """
    folders: list[Path] = []
    with suppress(PackageNotFoundError):
        package = distribution(_EXAMPLES)
        record = package.read_text("RECORD") or ""
        listed = (line.partition(",")[0] for line in record.splitlines())
        declared = (file for file in listed if file.endswith(f"{_EXAMPLES}/package.xml"))
        folders = [Path(str(package.locate_file(file))).parent for file in declared]
    for folder in (*folders, Path(sysconfig.get_path("data")) / "share" / _EXAMPLES):
        if (folder / "robots").is_dir():
            return folder / "robots"
    problem = f"the package {_EXAMPLES} is not installed"
    raise InputError("urdf", problem, f"pip install {_EXAMPLES}, or a file")
