"""Records as trees of plain values, and back, by the type hints of their fields.

A record is a dataclass or a named tuple. Its tree is a dictionary with the name of its class and an
entry for each field:

| hint | entry |
|---|---|
| ``float``, ``int``, ``bool``, ``str`` | the value |
| an enumeration | name of the member |
| an array; a tuple of numbers, texts or members | :class:`Quantity`, with the unit of the hint |
| a record, one of several classes, a protocol | tree of the record |
| a tuple of records with values and arrays alone | :class:`Quantity` for each field; nan for None |
| a tuple of other records, a mapping | dictionary by number, or by key |
| a type of the context, such as the problem | nothing; True or None where it is optional |

A record in two places is one dictionary, and one record again once decoded.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, is_dataclass
from enum import Enum, EnumType
from functools import cache
from typing import Any, TypeVar, get_args

import numpy as np
import numpy.typing as npt

from freefloat.records import Hint, Known, Origin, Quantity, Tree, derived_of, fields_of, parsed

T = TypeVar("T")
_VALUES = {float: (float, int), int: (int,), bool: (bool,), str: (str,)}
"""Types of stored values, by hint."""


@dataclass(frozen=True)
class Codec:
    """Encoder and decoder of records.

    Attributes:
        context: Types of values that are not stored: whoever decodes a record has them.
        members: Record classes that implement a protocol.
    """

    context: tuple[type, ...] = ()
    members: Mapping[type, tuple[type, ...]] = field(default_factory=dict)

    def encode(self, record: Any) -> Tree:
        """The tree of a record, or of what is known of it."""
        return _Encoder(self).tree(record)

    def decode(self, kind: type[T], tree: Tree, context: Mapping[type, Any]) -> T:
        """The record of a tree, whose derived properties and unknown parts are left out.

        Args:
            kind: Class of the record.
            tree: As :meth:`encode` returns it.
            context: Values of the types that are not stored.

        Raises:
            ValueError: If the tree does not represent such a record.
            InputError: If the class refuses its fields.
        """
        record: T = _Decoder(self, context).record((kind,), tree, "record")
        return record

    def classes(self, hint: Hint) -> tuple[type, ...]:
        """Record classes that a hint stands for; none if it stands for no record."""
        kinds = (member for kind in hint.kinds for member in self.members.get(kind, (kind,)))
        return tuple(kind for kind in kinds if is_dataclass(kind) or hasattr(kind, "_fields"))

    def is_given(self, hint: Hint) -> bool:
        """Whether the values of a hint are not stored."""
        return hint.kinds[0] in self.context


@cache
def _is_table(classes: tuple[type, ...]) -> bool:
    """Whether a tuple of records of these classes is a table: they have values and arrays alone."""
    return len(classes) == 1 and all(
        hint.container is np.ndarray
        or hint.kinds[0] in _VALUES
        or isinstance(hint.kinds[0], EnumType)
        for hint in fields_of(classes[0]).values()
    )


class _Encoder:
    def __init__(self, codec: Codec) -> None:
        self._codec = codec
        self._known: dict[int, Tree] = {}

    def tree(self, record: Any) -> Tree:
        if isinstance(record, Known):
            return self._tree(record.kind, record.values, {})
        if id(record) not in self._known:
            kind: Any = type(record)
            values = {name: getattr(record, name) for name in (*fields_of(kind), *derived_of(kind))}
            self._tree(kind, values, self._known.setdefault(id(record), {}))
        return self._known[id(record)]

    def _tree(self, kind: Any, values: Mapping[str, Any], tree: Tree) -> Tree:
        tree["class"] = kind.__name__
        for name, hint in fields_of(kind).items():
            if name in values and (hint.optional or not self._codec.is_given(hint)):
                tree[name] = self._entry(hint, values[name])
        for name, unit in derived_of(kind).items():
            if name in values:
                value = values[name]
                tree[name] = value if isinstance(value, Origin) else Quantity(value, unit)
        return tree

    def _entry(self, hint: Hint, value: Any) -> Any:
        if value is None or isinstance(value, Origin):
            return value
        if self._codec.is_given(hint):
            return True
        if classes := self._codec.classes(hint):
            if (value.kind if isinstance(value, Known) else type(value)) not in classes:
                raise TypeError(f"a {type(value).__name__} is not stored here")
            return self.tree(value)
        (kind,) = hint.kinds
        if hint.container is np.ndarray:
            return Quantity(np.asarray(value), hint.unit)
        if hint.container is tuple:
            return self._items(parsed(get_args(kind)[0]), hint.unit, value)
        if hint.container in (dict, Mapping):
            inner = parsed(get_args(kind)[1])
            return {str(key): self._entry(inner, item) for key, item in value.items()}
        return value.name if isinstance(value, Enum) else kind(value)

    def _items(self, hint: Hint, unit: str, values: tuple[Any, ...]) -> Any:
        entries = [self._entry(hint, value) for value in values]
        classes = self._codec.classes(hint)
        if not classes:
            return _column(hint._replace(unit=unit), entries)
        if not entries or not _is_table(classes):
            return {str(number): entry for number, entry in enumerate(entries)}
        return {name: _column(inner, [entry[name] for entry in entries])
                for name, inner in fields_of(classes[0]).items()
                if all(name in entry for entry in entries)}  # fmt: skip


def _column(hint: Hint, entries: list[Any]) -> Quantity:
    """Entries as one array."""
    if hint.container is np.ndarray:
        return Quantity(np.array([entry.values for entry in entries]), hint.unit)
    kind = hint.kinds[0] if hint.kinds[0] in (float, int, bool) else object
    cells = [math.nan if entry is None else entry for entry in entries]
    return Quantity(np.array(cells, float if None in entries else kind), hint.unit)


class _Decoder:
    def __init__(self, codec: Codec, context: Mapping[type, Any]) -> None:
        self._codec, self._context = codec, context
        self._known: dict[tuple[int, type], tuple[Any, Any]] = {}  # trees, too: they keep their ids

    def record(self, classes: tuple[type, ...], tree: Any, place: str) -> Any:
        name = _checked(tree, dict, place).get("class")
        kind = next((entry for entry in classes if entry.__name__ == name), None)
        if kind is None:
            raise ValueError(f"its part {place} is a {name}")
        if (id(tree), kind) not in self._known:
            self._known[id(tree), kind] = tree, self._record(kind, tree, place)
        return self._known[id(tree), kind][1]

    def _record(self, kind: type, tree: Tree, place: str) -> Any:
        return kind(**{name: self._value(hint, tree.get(name), f"{place}/{name}")
                       for name, hint in fields_of(kind).items()})  # fmt: skip

    def _value(self, hint: Hint, entry: Any, place: str) -> Any:
        if self._codec.is_given(hint) and (entry is True or not hint.optional):
            return self._context[hint.kinds[0]]
        if entry is None and hint.optional:
            return None
        if classes := self._codec.classes(hint):
            return self.record(classes, entry, place)
        (kind,) = hint.kinds
        if hint.container is np.ndarray:
            return _array(kind, entry, place)
        if hint.container is tuple:
            return self._items(get_args(kind), entry, place)
        if hint.container in (dict, Mapping):
            key, inner = get_args(kind)
            items = _checked(entry, dict, place).items()
            return {key(k): self._value(parsed(inner), v, f"{place}/{k}") for k, v in items}
        if kind in _VALUES:
            return kind(_checked(entry, _VALUES[kind], place))
        if _checked(entry, str, place) not in kind.__members__:
            raise ValueError(f"its part {place} is {entry}")
        return kind[entry]

    def _items(self, kinds: tuple[Any, ...], entry: Any, place: str) -> tuple[Any, ...]:
        hint = parsed(kinds[0])
        classes = self._codec.classes(hint)
        if not classes:
            entries = _checked(entry, Quantity, place).values.tolist()
        elif _is_table(classes):
            entries = _rows(classes[0], _checked(entry, dict, place), place)
        else:
            entries = [entry.get(str(k)) for k in range(len(_checked(entry, dict, place)))]
        if kinds[1] is not ... and len(entries) != len(kinds):
            raise ValueError(f"its part {place} has {len(entries)} entries")
        return tuple(self._value(hint, e, f"{place}/{k}") for k, e in enumerate(entries))


def _rows(kind: type, columns: Tree, place: str) -> list[Tree]:
    """Trees of records of a class from their table."""
    cells = [
        [_cell(hint, cell) for cell in _checked(columns.get(name), Quantity, place).values]
        for name, hint in fields_of(kind).items()
        if columns
    ]
    rows = (zip(fields_of(kind), row, strict=True) for row in zip(*cells, strict=True))
    return [{"class": kind.__name__, **dict(row)} for row in rows]


def _cell(hint: Hint, cell: Any) -> Any:
    """An entry of a table; None and whole numbers are floats there."""
    if isinstance(cell, np.ndarray):
        return Quantity(cell)
    value = cell.item() if isinstance(cell, np.generic) else cell
    if not hint.optional or not isinstance(value, float):
        return value
    if math.isnan(value):
        return None
    return int(value) if int in hint.kinds and value.is_integer() else value


def _array(kind: Any, entry: Any, place: str) -> npt.NDArray[Any]:
    """A read-only array of the type of a hint, or of less precision."""
    dtype = np.dtype(get_args(get_args(kind)[1])[0])
    values: npt.NDArray[Any] = _checked(entry, Quantity, place).values.copy()
    if values.dtype.kind != dtype.kind or values.dtype.itemsize > dtype.itemsize:
        raise ValueError(f"its part {place} contains no {dtype} numbers")
    values.setflags(write=False)
    return values


def _checked(entry: Any, kinds: Any, place: str) -> Any:
    """An entry of some types; a truth value is no number."""
    if (isinstance(entry, bool) and kinds != (bool,)) or not isinstance(entry, kinds):
        problem = "missing" if entry is None else "of another type"
        raise ValueError(f"its part {place} is {problem}")
    return entry
