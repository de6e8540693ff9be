"""Files that are written whole, or not at all."""

from __future__ import annotations

import glob
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from freefloat.errors import InputError

_SUFFIX = ".partial"
_ABANDONED = 3600.0
"""Age of a temporary file whose process was killed [s]; writing takes seconds."""


@contextmanager
def written_beside(path: Path) -> Iterator[Path]:
    """A temporary file beside ``path`` that replaces it when the block ends well.

    Raises:
        InputError: If the folder cannot be written to.
    """
    accepted = "a file in an existing, writable folder with enough space"
    path = path.resolve()
    if path.exists() and not path.is_file():
        raise InputError("output", f"{path} exists and is no plain file", accepted)
    try:
        _remove_abandoned(path)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=_SUFFIX)
        os.close(handle)
    except OSError as error:
        raise InputError("output", f"{path}: {error.strerror}", accepted) from None
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o666 & ~_umask())
        os.replace(temporary, path)
    except OSError as error:
        problem = os.strerror(error.errno) if error.errno else str(error).splitlines()[0]
        raise InputError("output", f"{path}: {problem}", accepted) from None
    finally:
        temporary.unlink(missing_ok=True)


def _remove_abandoned(path: Path) -> None:
    """Remove the temporary files of killed processes that wrote the same file."""
    for file in path.parent.glob(f".{glob.escape(path.name)}.*{_SUFFIX}"):
        if time.time() - file.stat().st_mtime > _ABANDONED:
            file.unlink(missing_ok=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
