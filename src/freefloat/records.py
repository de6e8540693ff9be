"""What the type hints of records say of their fields, and units of their arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache, cached_property
from types import NoneType, UnionType
from typing import Annotated, Any, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy.typing as npt

from freefloat.so3 import Array

Tree = dict[str, Any]
"""A record as plain values."""
T = TypeVar("T")

Quaternions = Annotated[Array, "1, quaternion x y z w"]
Joints = Annotated[Array, "rad or m"]
Times = Annotated[Array, "s"]
Angles = Annotated[Array, "rad"]


class Quantity(NamedTuple):
    """An array of numbers or texts, and its unit."""

    values: npt.NDArray[Any]
    unit: str = ""


class Known(NamedTuple):
    """A record of which some fields alone are known; its tree has entries for these."""

    kind: type  # class of the record
    values: Mapping[str, Any]  # the fields by name; a record among them may be such a part, too


class Origin(Enum):
    """What stands in the tree of a :class:`Known` record for a field that has no value there."""

    GIVEN = "part of the question"
    TESTED = "tested as a whole"


class derived(cached_property[T]):
    """A cached array of a record, stored for other programs; it must agree with a loaded record."""


class Hint(NamedTuple):
    """A type hint: its types other than None, the unit, and whether None is one of them."""

    kinds: tuple[Any, ...]
    unit: str = ""
    optional: bool = False

    @property
    def container(self) -> Any:
        """Type of arrays, tuples and mappings; None for values."""
        return get_origin(self.kinds[0])


@cache
def parsed(hint: Any) -> Hint:
    """The parts of a type hint."""
    if hasattr(get_origin(hint), "__value__"):  # an alias, as NumPy's NDArray since Python 3.12
        return parsed(get_origin(hint).__value__[get_args(hint)])
    if get_origin(hint) is Annotated:
        inner, unit = get_args(hint)[:2]
        return parsed(inner)._replace(unit=unit)
    if get_origin(hint) not in (Union, UnionType):
        return Hint((hint,))
    members = [parsed(member) for member in get_args(hint) if member is not NoneType]
    kinds = tuple(kind for member in members for kind in member.kinds)
    return Hint(kinds, members[0].unit, NoneType in get_args(hint))


@cache
def fields_of(kind: Any) -> dict[str, Hint]:
    """Hints of the fields of a record class."""
    hints = get_type_hints(kind, include_extras=True)
    names = [entry.name for entry in fields(kind)] if is_dataclass(kind) else kind._fields
    return {name: parsed(hints[name]) for name in names}


@cache
def derived_of(kind: Any) -> dict[str, str]:
    """Units of the derived properties of a record class."""
    return {
        name: parsed(get_type_hints(value.func, include_extras=True)["return"]).unit
        for base in kind.__mro__
        for name, value in vars(base).items()
        if isinstance(value, derived)
    }
