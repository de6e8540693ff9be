"""Files that are written whole, or not at all."""

from __future__ import annotations

import errno
import glob
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from uuid import uuid4

from freefloat.errors import InputError

_SUFFIX = ".partial"
_KEPT = 40
"""Characters of a name in the name of its temporary file; names have at most 255 bytes."""
_ABANDONED = 3600.0
"""Age of a temporary file whose process was killed [s]; writing takes seconds."""
_FILE = "a file in an existing, writable folder with enough space"
_RESULTS = (".h5", ".hdf5")
"""Suffixes of result files."""
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")
"""Beginnings of cells that spreadsheets evaluate."""
RESULT = "result file"
_MARKS = {
    RESULT: b"freefloat sha-256 ", "page": b"<!doctype html", "urdf": b"<robot",
    "csv": b"time [s]", "json": b'{"robot"', "mat": b"matlab", "ros2": b"header:",
    "ros2-goal": b"trajectory:", "aem": b"ccsds_aem", "mcap": b"mcap", "mjcf": b"<mujoco",
    "png": b"png", "pdf": b"%pdf", "svg": b"<?xml", "gif": b"gif8", "mp4": b"ftyp",
    "table of runs": b"case,", "parquet": b"par1",
}  # fmt: skip
"""Bytes near the beginning of files of each kind, in lower case."""
_COMMENTED = ("urdf", "mjcf")
"""Kinds of files that may begin with a comment."""
_BEGINNING, _NEAR = 1024, 4
"""Bytes at the beginning of a file, and how far from it a mark may be."""
_FOLDER = "a writable folder, or the name of one in an existing, writable folder"


def require_result_name(path: Path) -> None:
    """Raise an InputError unless a name is the name of an HDF5 file, not of another format."""
    if path.suffix.lower() not in _RESULTS:
        accepted = f"a name with {' or '.join(_RESULTS)}"
        raise InputError("output", f"{str(path)!r} was given", accepted)


def path_text(path: str | Path) -> str:
    """The name of a file as Unicode, which files can hold; names of other encodings are altered."""
    return os.fsencode(path).decode("utf-8", "replace")


def cell_text(text: str) -> str:
    """A text as the cell of a CSV file; an apostrophe keeps spreadsheets from evaluating it."""
    return f"'{text}" if text.startswith(_FORMULA) else text


@contextmanager
def written_beside(path: Path) -> Iterator[Path]:
    """A temporary file beside ``path`` that replaces it when the block ends well.

    Raises:
        InputError: If the folder cannot be written to.
    """
    require_writable("output", path)
    path = path.resolve()
    temporary = _temporary(path)
    try:
        _remove_abandoned(path)
        temporary.touch(exist_ok=False)
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        raise _input_error("output", path, error, _FILE) from None
    finally:
        with suppress(OSError):  # it is gone, or was never there
            temporary.unlink()


def require_writable(key: str, path: Path) -> None:
    """Raise an InputError unless a file with this name can be written, before it is there.

    Its folder must exist. A link to a file that is missing is refused: following it would make a
    file elsewhere.
    """
    with file_errors(key, path, _FILE):
        if path.is_symlink() and not path.exists():
            raise InputError(key, f"{path} is a link to a missing file", _FILE)
        if path.exists() and not path.is_file():
            raise InputError(key, f"{path} is not a regular file", "the name of a file")
        path = path.resolve()
        _require_folder(path.parent)
        with suppress(FileNotFoundError):  # a name that is too long is another error
            os.lstat(_temporary(path))


def require_replaceable(key: str, file: Path, kind: str) -> None:
    """Raise an InputError if a file would replace one of another kind, such as a scenario."""
    if not file.is_file():
        return
    with file.open("rb") as content:
        begin = content.read(_BEGINNING).lower()
    place = begin.find(_MARKS[kind]) if kind in _MARKS else -1
    if begin and not 0 <= place <= (_BEGINNING if kind in _COMMENTED else _NEAR):
        problem = f"{file} exists and is no {kind} of freefloat: it is not replaced"
        raise InputError(key, problem, "another name")


def make_folder(key: str, folder: Path) -> None:
    """Make a folder in an existing one, unless it exists.

    Raises:
        InputError: If it cannot be made or written to.
    """
    with file_errors(key, folder, _FOLDER):
        folder.mkdir(exist_ok=True)
        _require_folder(folder)


def require_folder(key: str, folder: Path) -> None:
    """Raise an InputError unless files can be written into a folder, which may still be missing."""
    with file_errors(key, folder, _FOLDER):
        _require_folder(folder if folder.exists() else folder.parent)


def _require_folder(folder: Path) -> None:
    if not folder.is_dir():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))


@contextmanager
def file_errors(key: str, path: Path, accepted: str) -> Iterator[None]:
    """Raise errors of the file system as errors of an argument."""
    try:
        yield
    except (OSError, RuntimeError, ValueError) as error:  # a loop of links, a null character
        raise _input_error(key, path, error, accepted) from None


def _input_error(key: str, path: Path, error: Exception, accepted: str) -> InputError:
    number = getattr(error, "errno", None)
    problem = os.strerror(number) if number else str(error).splitlines()[0]
    return InputError(key, f"{path}: {problem}", accepted)


def _temporary(path: Path) -> Path:
    return path.with_name(f".{path.name[:_KEPT]}.{uuid4().hex[:8]}{_SUFFIX}")


def _remove_abandoned(path: Path) -> None:
    """Remove the temporary files of killed processes that wrote the same file."""
    for file in path.parent.glob(f".{glob.escape(path.name[:_KEPT])}.*{_SUFFIX}"):
        with suppress(OSError):  # its process has finished, or another one removed it
            if time.time() - file.stat().st_mtime > _ABANDONED:
                file.unlink()
