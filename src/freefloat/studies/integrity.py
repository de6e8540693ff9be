"""Whether a database of a study is the one that was written: its pages, schema and digests."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from hashlib import sha256
from typing import Any

import numpy as np

from freefloat.concurrency import Progress
from freefloat.studies.columns import NUMBER, TEXT, Columns
from freefloat.studies.rows import quoted

DIGESTS = "CREATE TABLE digests (part TEXT, numbers TEXT, digest TEXT) STRICT"
"""Digests of rows that were stored together: of one part of their columns, by their numbers."""
ADDED = "CREATE TABLE added (name TEXT) STRICT"
"""Names of the columns that were added to the rows, in their order."""
_ALTERED = "its tables are altered, or those of another version of freefloat"
_RESULTS, _FILE = "results", "file"
"""Parts of the columns, which are stored one after the other."""
_NAMED = ("file", "bytes")
"""Columns of the second part."""


def require_whole(connection: sqlite3.Connection) -> None:
    """Raise a DatabaseError if SQLite finds a fault in its pages, or values that tables refuse."""
    (damage,) = connection.execute("PRAGMA quick_check(1)").fetchone()
    if damage != "ok":
        raise sqlite3.DatabaseError(damage.splitlines()[-1])


def rows_of_study(connection: sqlite3.Connection) -> list[tuple[str, ...]]:
    """The rows of the table study; a DatabaseError if it is none of this version."""
    try:
        rows = connection.execute("SELECT digest, content, software, seal FROM study").fetchall()
    except sqlite3.OperationalError:
        rows = []
    if not rows:
        raise sqlite3.DatabaseError(_ALTERED)
    return rows


def require_schema(connection: sqlite3.Connection, schema: Iterable[str]) -> None:
    """Raise a DatabaseError unless tables and all else are what statements make."""
    with closing(sqlite3.connect(":memory:")) as expected:
        for statement in schema:
            expected.execute(statement)
        if _objects(connection) != _objects(expected):
            raise sqlite3.DatabaseError(_ALTERED)


def _objects(connection: sqlite3.Connection) -> set[tuple[str, ...]]:
    query = "SELECT type, name, tbl_name, sql FROM sqlite_master"
    return set(connection.execute(query))


def add_digests(connection: sqlite3.Connection, columns: Columns, types: Mapping[str, str]) -> None:
    """Store the digests of rows that are added, and of their files; or of a file that is named."""
    parts = {_RESULTS: {name: values for name, values in columns.items() if name not in _NAMED}}
    if len(parts[_RESULTS]) == 1:  # the number
        parts.clear()
    if any(columns.get("file", ())):
        parts[_FILE] = {name: columns.get(name, [None]) for name in (NUMBER, *_NAMED)}
    for part, values in parts.items():
        numbers = json.dumps(np.asarray(values[NUMBER]).tolist())
        stored = part, numbers, _digest(values, types)
        connection.execute("INSERT INTO digests VALUES (?, ?, ?)", stored)


def drop_damaged(connection: sqlite3.Connection, progress: Progress) -> int:
    """Remove rows without their digest; return how many. Files without theirs are named no more.

    Args:
        connection: To the database, in a transaction.
        progress: Called with the fraction of the digests that are compared.
    """
    types = {name: kind for _, name, kind, *_ in connection.execute("PRAGMA table_info(runs)")}
    parts = {_RESULTS: [name for name in types if name not in _NAMED], _FILE: [NUMBER, *_NAMED]}
    whole: dict[str, set[int]] = {part: set() for part in parts}
    digests = connection.execute("SELECT rowid, part, numbers, digest FROM digests").fetchall()
    connection.text_factory = lambda text: text.decode(errors="surrogateescape")
    for place, (row, part, text, digest) in enumerate(digests):
        progress(place / len(digests))
        numbers = _numbers(text)
        columns = _columns(connection, parts.get(part, [NUMBER]), numbers)
        if numbers and part in parts and _digest(columns, types) == digest:
            whole[part].update(numbers)
        else:
            connection.execute("DELETE FROM digests WHERE rowid = ?", (row,))
    damaged = [(number,) for (number,) in connection.execute("SELECT number FROM runs")
               if number not in whole[_RESULTS]]  # fmt: skip
    connection.executemany("DELETE FROM runs WHERE number = ?", damaged)
    files = connection.execute(
        "SELECT number FROM runs WHERE file IS NOT NULL OR bytes IS NOT NULL"
    )
    unnamed = [(number,) for (number,) in files if number not in whole[_FILE]]
    connection.executemany("UPDATE runs SET file = NULL, bytes = NULL WHERE number = ?", unnamed)
    connection.text_factory = str
    return len(damaged)


def _numbers(text: Any) -> list[int]:
    """The numbers of a stored list, none where it is damaged."""
    try:
        numbers = json.loads(text)
    except (ValueError, TypeError, RecursionError):
        return []
    whole = isinstance(numbers, list) and all(type(number) is int for number in numbers)
    return numbers if whole else []


def _columns(
    connection: sqlite3.Connection, names: Sequence[str], numbers: Sequence[int]
) -> Columns:
    """Values of rows by column, ordered by number."""
    selected = f"SELECT {', '.join(map(quoted, names))} FROM runs"
    query = f"{selected} WHERE number IN (SELECT value FROM json_each(?)) ORDER BY number"
    rows = connection.execute(query, (json.dumps(numbers),)).fetchall()
    return dict(zip(names, zip(*rows, strict=True), strict=True)) if rows else {}


def _digest(columns: Columns, types: Mapping[str, str]) -> str:
    """The digest of the values of rows; columns without any make no difference."""
    digest = sha256()
    for name in sorted(columns):
        values = columns[name]
        if types[name] == TEXT:
            texts = values.tolist() if isinstance(values, np.ndarray) else list(values)
            content = json.dumps(texts).encode() if texts.count(None) < len(texts) else b""
        else:
            numbers = np.array(values, dtype=float) + 0.0  # SQLite stores -0.0 as 0.0
            missing = np.isnan(numbers)
            numbers[missing] = np.nan
            content = b"" if missing.all() else numbers.tobytes()
        if content:
            digest.update(f"{name}\0".encode() + content)
    return digest.hexdigest()
