"""The folder of a study: what was asked, every finished case, and nobody else writing there."""

from __future__ import annotations

import fcntl
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import IO, Any

from freefloat.errors import InputError
from freefloat.io.files import written_beside
from freefloat.studies.files import StudyFiles
from freefloat.studies.journal import Journal, read_rows
from freefloat.studies.result import CaseResult, Row
from freefloat.studies.study import Study

JOURNAL, ASKED, CASES, _LOCK = "journal.jsonl", "study.json", "cases", ".lock"
"""Names in the folder."""
FORMAT_VERSION = 1
_ACCEPTED = "a folder, there or to be made, that may be written to and has room"
_SOFTWARE = ("freefloat", "pin", "numpy", "scipy", "numba")


def asked(study: Study, files: StudyFiles) -> dict[str, Any]:
    """All that the results of a study depend on, as plain data."""
    content = study.content.model_dump(mode="json", by_alias=True, exclude_none=True)
    del content["base"]
    document = {"study": content, "base": study.base, "files": files.digests()}
    return dict(json.loads(json.dumps(document), parse_constant=str))  # NaN equals itself then


class StudyFolder:
    """An output folder that is ours while it is open.

    Attributes:
        path: The folder.
        study: What it is the folder of.
    """

    def __init__(self, path: Path, study: Study, journal: Journal) -> None:
        self.path, self.study, self._journal = path, study, journal

    @property
    def rows(self) -> Mapping[int, Row]:
        """The finished cases by number."""
        return self._journal.rows

    @property
    def missing(self) -> list[int]:
        """The numbers of the cases that are not finished, in order."""
        return [number for number in range(self.study.count) if number not in self.rows]

    def record(self, result: CaseResult) -> None:
        """Put a finished case on disk: first its file, then its row, which makes it count.

        Raises:
            InputError: If there is no room.
        """
        row = result.row
        if result.file is not None:
            name = f"{CASES}/{row['case']:05d}.h5"
            with written_beside(self.path / name) as beside:
                beside.write_bytes(result.file)
            row = row | {"file": name, "bytes": len(result.file)}
        self._journal.add(row)

    def _drop_without_file(self) -> None:
        """Forget cases whose files are gone or were cut short, so that they run again."""
        self._journal.drop({number for number, row in self.rows.items() if not self._has_file(row)})

    def _has_file(self, row: Row) -> bool:
        if row.get("file") is None:
            return True
        try:
            size = (self.path / CASES / f"{row['case']:05d}.h5").stat().st_size
        except OSError:
            return False
        return bool(size == row.get("bytes"))


@contextmanager
def study_folder(path: Path, study: Study, files: StudyFiles) -> Iterator[StudyFolder]:
    """The output folder of a study, new or continued.

    Args:
        path: Made if it is not there.
        study: The study.
        files: Its files.

    Raises:
        InputError: If it cannot be written to, is in use, or holds another study; then with the
            first keys that differ.
    """
    for name in (CASES, JOURNAL, ASKED, _LOCK):
        if (path / name).is_symlink():
            raise InputError("output", f"{path / name} leads out of the folder", _ACCEPTED)
    try:
        (path / CASES).mkdir(parents=True, exist_ok=True)
        lock = (path / _LOCK).open("a")
    except FileExistsError:
        raise InputError("output", f"{path} is there and is no folder", _ACCEPTED) from None
    except OSError as error:
        raise InputError("output", f"{path}: {error.strerror}", _ACCEPTED) from None
    with lock:
        _hold(lock, path)
        _refuse_another(path / ASKED, asked(study, files))
        journal = Journal(path / JOURNAL, "case")
        try:
            folder = StudyFolder(path, study, journal)
            folder._drop_without_file()
            yield folder
        finally:
            journal.close()


def finished_rows(path: Path, study: Study, files: StudyFiles) -> dict[int, Row]:
    """The finished cases of a folder that may not be there; nothing is written.

    Raises:
        InputError: If it holds another study.
    """
    if not (path / ASKED).is_file():
        return {}
    _refuse_another(path / ASKED, asked(study, files))
    return read_rows(path / JOURNAL, "case") if (path / JOURNAL).is_file() else {}


def _hold(lock: IO[str], path: Path) -> None:
    """Keep others out until the file is closed, be it by the end of this process."""
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        problem = f"{path}: another freefloat batch is at work there"
        raise InputError("output", problem, "another folder, or to wait for its end") from None
    except OSError:  # some network file systems know no locks
        return


def _refuse_another(file: Path, now: dict[str, Any]) -> None:
    """Write what is asked into a new folder; in one with results refuse anything else."""
    if not file.exists():
        software = {package: version(package) for package in _SOFTWARE}
        document = {"version": FORMAT_VERSION, **now, "software": software}
        with written_beside(file) as beside:
            beside.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
        return
    try:
        document = json.loads(file.read_text(encoding="utf-8"))
        before = {key: document[key] for key in now}
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        told = f"it cannot be read ({error})"
        raise InputError("output", told, "the folder as it was written", str(file)) from None
    differing = list(_differences(before, now))
    if differing:
        more = f", and {len(differing) - 3} more" if len(differing) > 3 else ""
        problem = f"it holds another study: {'; '.join(differing[:3])}{more}"
        raise InputError("output", problem, "the study as it was, or another folder", str(file))


def _differences(before: Any, now: Any, key: str = "") -> Iterator[str]:
    """Key by key, what was asked and what is asked now."""
    if isinstance(before, dict) and isinstance(now, dict):
        for name in [*before, *(name for name in now if name not in before)]:
            inner = f"{key}.{name}" if key else name
            yield from _differences(before.get(name), now.get(name), inner)
    elif before != now:
        yield f"{key} was {_short(before)}, now {_short(now)}"


def _short(value: Any) -> str:
    text = "not given" if value is None else json.dumps(value)
    return text if len(text) <= 60 else text[:57] + "..."
