"""Files by name: bundled robots, scenarios and studies, and robots of other packages."""

from __future__ import annotations

import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from freefloat.errors import InputError, did_you_mean
from freefloat.robot.robot_packages import (
    DESCRIPTIONS,
    EXAMPLE,
    described_robot,
    example_robot,
    example_robots,
)

_LARGEST = 20_000_000
"""Size limit of a text file [bytes]."""
_ONE_BYTE = re.compile(
    rb"""\s*<\?xml\s[^>]{,80}\bencoding\s*=\s*["'](iso-8859-\d+|windows-\d+)["']""", re.IGNORECASE
)
"""A declaration of XML that names an encoding of one byte a character."""


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
