"""Files that are written whole, or not at all."""

from __future__ import annotations

import glob
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from uuid import uuid4

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
        raise InputError("output", f"{path} exists and is not a regular file", accepted)
    temporary = path.with_name(f".{path.name}.{uuid4().hex[:8]}{_SUFFIX}")
    try:
        _remove_abandoned(path)
        temporary.touch(exist_ok=False)
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        problem = os.strerror(error.errno) if error.errno else str(error).splitlines()[0]
        raise InputError("output", f"{path}: {problem}", accepted) from None
    finally:
        with suppress(OSError):  # it is gone, or was never there
            temporary.unlink()


def _remove_abandoned(path: Path) -> None:
    """Remove the temporary files of killed processes that wrote the same file."""
    for file in path.parent.glob(f".{glob.escape(path.name)}.*{_SUFFIX}"):
        if time.time() - file.stat().st_mtime > _ABANDONED:
            file.unlink(missing_ok=True)
