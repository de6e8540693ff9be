"""A journal: a line of JSON for every finished piece of work, on disk before the next begins."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Collection
from pathlib import Path
from typing import Any

from freefloat.errors import InputError
from freefloat.io.files import written_beside

_ACCEPTED = "a folder that may be written to and has room"


class Journal:
    """An append-only file of rows, each with a number of its own.

    A line that was being written when a process ended is not counted and taken off at once.
    """

    def __init__(self, path: Path, key: str) -> None:
        """Open a journal, empty where there is none.

        Args:
            path: The file.
            key: The key of a row that holds its number.

        Raises:
            InputError: If it cannot be read or written, or a line in its midst is broken.
        """
        self._path, self._key = path, key
        self.rows: dict[int, dict[str, Any]] = {}
        """What was written, by number."""
        try:
            self._stream = path.open("ab+")
        except OSError as error:
            raise InputError("output", f"{path}: {error.strerror}", _ACCEPTED) from None
        try:
            self._read()
        except BaseException:
            self._stream.close()
            raise

    def _read(self) -> None:
        self._stream.seek(0)
        whole = self._stream.read()
        self.rows, end = _rows(whole, self._path, self._key)
        if end < len(whole):
            self._stream.truncate(end)

    def add(self, row: dict[str, Any]) -> None:
        """Append a row; it is on disk when this returns.

        Raises:
            InputError: If it cannot be written; what was written before stays.
        """
        line = json.dumps(row, allow_nan=False, separators=(",", ":")) + "\n"
        try:
            self._stream.write(line.encode())
            self._stream.flush()
            os.fsync(self._stream.fileno())
        except OSError as error:
            raise InputError("output", f"{self._path}: {error.strerror}", _ACCEPTED) from None
        self.rows[int(row[self._key])] = row

    def drop(self, numbers: Collection[int]) -> None:
        """Take rows out, the whole file replaced at once.

        Raises:
            InputError: If it cannot be written.
        """
        if not numbers:
            return
        kept = {number: row for number, row in self.rows.items() if number not in numbers}
        with written_beside(self._path) as beside, beside.open("w", encoding="utf-8") as stream:
            for row in kept.values():
                stream.write(json.dumps(row, allow_nan=False, separators=(",", ":")) + "\n")
            stream.flush()
            os.fsync(stream.fileno())
        self._stream.close()
        self._stream, self.rows = self._path.open("ab+"), kept

    def close(self) -> None:
        """Close the file."""
        try:
            self._stream.close()
        except OSError:  # what is left in its buffer could not be written: it was told already
            return


def read_rows(path: Path, key: str) -> dict[int, dict[str, Any]]:
    """The whole rows of a journal that somebody else may be writing, by number.

    Raises:
        InputError: As for :class:`Journal`.
    """
    try:
        return _rows(path.read_bytes(), path, key)[0]
    except OSError as error:
        raise InputError("output", f"{path}: {error.strerror}", _ACCEPTED) from None


def _refuse(word: str) -> None:
    raise ValueError(f"{word} is no JSON")


def _finite(word: str) -> float:
    number = float(word)
    if math.isinf(number):
        raise ValueError(f"{word} is too large")
    return number


def _rows(whole: bytes, path: Path, key: str) -> tuple[dict[int, dict[str, Any]], int]:
    """The rows of a journal by number, and how many bytes they take."""
    end, rows = whole.rfind(b"\n") + 1, {}
    for number, line in enumerate(whole[:end].splitlines(), start=1):
        try:
            row = json.loads(line, parse_constant=_refuse, parse_float=_finite)
            if type(row[key]) is not int:
                raise ValueError(key)
            rows[row[key]] = row
        except (ValueError, TypeError, KeyError, RecursionError):
            problem, accepted = "it is no row of a journal", "the file as it was written, or none"
            raise InputError("output", problem, accepted, str(path), number) from None
    return rows, end
