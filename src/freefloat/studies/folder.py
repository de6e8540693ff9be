"""The folder of a study: its files, and the lock that keeps a second process out."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path

from freefloat.errors import InputError
from freefloat.io.files import RESULT, file_errors, make_folder, require_replaceable

DATABASE, LOCK, FILES = "study.sqlite", "study.lock", "cases"
"""Names of the database, of the lock while the study runs, and of the folder of result files."""
PARQUET, CSV, REPORT, FIGURE = "cases.parquet", "cases.csv", "report.html", "summary"
"""Names of the tables, of the report, and of its figure without a suffix."""
_OUTPUTS = (f"{DATABASE}*", f"{LOCK}*", PARQUET, CSV, REPORT, f"{FIGURE}.*")
"""Patterns of the names of files in the folder."""
_KINDS = {
    PARQUET: "parquet", CSV: "table of runs", REPORT: "page",
    f"{FIGURE}.png": "png", f"{FIGURE}.pdf": "pdf",
}  # fmt: skip
"""Kinds of the files that a study replaces."""
WRITABLE = "a writable folder with space"
_NO_LINK = "no link, whose file would be overwritten; or another folder"


def prepare_folder(folder: Path) -> None:
    """Make the folder of a study, unless it exists.

    Raises:
        InputError: If it cannot be written to, or a link or anything else is in the place of one of
            its files: what a link leads to would be overwritten.
    """
    make_folder("output", folder)
    cases = folder / FILES
    with file_errors("output", folder, WRITABLE):
        places = [(path, path.is_file()) for name in _OUTPUTS for path in folder.glob(name)]
        for path, usable in [(cases, cases.is_dir()), *places]:
            if path.is_symlink():
                raise InputError("output", f"{path} is a link", _NO_LINK)
            # opening a named pipe would wait for ever; SQLite deletes files of its own meanwhile
            if not usable and os.path.lexists(path):
                raise InputError("output", f"{path} is not a regular file", "another folder")
        if not (folder / DATABASE).exists():  # it is no folder of a study so far
            kinds = {folder / name: kind for name, kind in _KINDS.items()}
            for path, kind in (kinds | dict.fromkeys(cases.glob("*.h5"), RESULT)).items():
                require_replaceable("output", path, kind)
        if cases.is_dir():
            with os.scandir(cases) as files:
                for file in files:
                    if file.is_symlink():
                        raise InputError("output", f"{file.path} is a link", _NO_LINK)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other processes out; the lock, a transaction, ends with the process, however it ends.

    Raises:
        InputError: If another process holds the lock, or its file is damaged.
    """
    path = folder / LOCK
    with ExitStack() as stack:
        try:
            lock = stack.enter_context(closing(sqlite3.connect(path, timeout=0.5)))
            lock.execute("BEGIN EXCLUSIVE")
        except sqlite3.Error as error:
            problem, accepted = f"{path}: {error}", "a writable folder"
            if error.sqlite_errorname.startswith("SQLITE_BUSY"):
                problem = f"{folder}: another process is running this study"
                accepted = "another folder"
            elif error.sqlite_errorname in ("SQLITE_NOTADB", "SQLITE_CORRUPT"):
                accepted = f"no such file, while no other process runs the study: rm {path}"
            raise InputError("output", problem, accepted) from None
        stack.callback(_remove, path)
        yield


def _remove(path: Path) -> None:
    with suppress(OSError):  # an open file cannot be removed everywhere
        path.unlink()
