"""Numba's cache files with digests: damaged machine code would crash the process."""

from __future__ import annotations

import logging
import os
import pickle
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

from numba.core.caching import Cache, IndexDataCacheFile
from numba.core.serialize import dumps

from freefloat.lockstep.cache_folder import is_closed

_DIGEST = 32
"""Bytes of the digest at the beginning of a file."""
_logger = logging.getLogger("freefloat")


class CheckedCacheFile(IndexDataCacheFile):
    """Index and data files of a kernel; a damaged one is deleted, and the kernel compiled again."""

    @classmethod
    def of(cls, cache: Cache, folder: Path, module: str) -> CheckedCacheFile:
        """The files of a kernel of a module in the folder of its sources, wherever these lie."""
        return cls(str(folder), f"{module}.{cache._impl.filename_base}.checked", folder.name)

    def save(self, key: Any, data: Any) -> None:
        """Write an entry where the folder permits it."""
        with suppress(OSError):
            super().save(key, data)

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[Any]:
        """Open a file that the user alone can write, whatever the umask."""
        with super()._open_for_write(filepath) as file:
            with suppress(OSError):  # file systems without modes
                os.chmod(file.name, 0o644)
            yield file

    def _dump(self, obj: Any) -> bytes:
        data: bytes = dumps(obj)
        return sha256(data).digest() + data

    def _save_index(self, overloads: dict[Any, str]) -> None:
        # what another version of Numba has pickled may not be readable: it stays a string of bytes
        content = self._dump((self._version, self._source_stamp, dumps(overloads)))
        with self._open_for_write(self._index_path) as file:
            file.write(content)

    def _load_index(self) -> dict[Any, str]:
        try:
            version, stamp, overloads = _checked(self._index_path)
        except OSError:
            return {}
        fresh = (version, stamp) == (self._version, self._source_stamp)
        return pickle.loads(overloads) if fresh else {}

    def _load_data(self, name: str) -> Any:
        return _checked(self._data_path(name))


def _checked(path: str) -> Any:
    """The content of a file; a damaged one is deleted and as if it were missing."""
    content = _content(path)
    data = content[_DIGEST:]
    if sha256(data).digest() != content[:_DIGEST]:
        _logger.warning("%s is damaged: the kernel is compiled again", path)
        with suppress(OSError):
            Path(path).unlink()
        raise FileNotFoundError(path)
    return pickle.loads(data)


def _content(path: str) -> bytes:
    """The content of a file; one that others own, or may write to, is as if it were missing."""
    descriptor = os.open(
        path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
    )
    with open(descriptor, "rb") as file:
        if sys.platform != "win32" and not is_closed(os.fstat(descriptor)):
            _logger.warning("others may write to %s: the kernel is compiled again", path)
            raise FileNotFoundError(path)
        return file.read()
