"""The ensemble's kernels as plain Python on NumPy arrays, in which every index is checked.

``plain_kernels`` replaces the compiled functions by their sources, and the functions that give
instructions by NumPy: a float of each motion is an array (WIDTH,), a vector one of (3, WIDTH).
"""

import importlib
import pkgutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import reduce
from operator import or_
from typing import Any
from unittest.mock import patch

import numpy as np
from numba.core.dispatcher import Dispatcher
from numba.core.extending import _Intrinsic

import freefloat.dynamics.kernels
import freefloat.ensemble
import freefloat.lockstep
from freefloat.lockstep.lanes import WIDTH


class Lanes(np.ndarray):
    """Numbers, vectors or truth values of the motions, which ``+=`` does not change in place."""

    __iadd__, __isub__ = np.ndarray.__add__, np.ndarray.__sub__
    __imul__, __itruediv__ = np.ndarray.__mul__, np.ndarray.__truediv__


def as_lanes(value: Any) -> Lanes:
    """A number, or one for each motion, as ``Lanes``."""
    return np.array(np.broadcast_to(value, WIDTH), dtype=float).view(Lanes)


class Table:
    """Rows of columns; an index outside raises IndexError."""

    def __init__(self, array: np.ndarray, columns: int) -> None:
        """Of a flat array, of which each element may be ``Lanes``; it may go on after the table."""
        self.array, self.columns = array, columns

    def place(self, index: Any) -> int:
        """The place of an element in the flat array."""
        row, column = index if isinstance(index, tuple) else (index, 0)
        if not (0 <= column < self.columns and 0 <= row < len(self.array) // self.columns):
            raise IndexError(f"{index} in a table of {len(self.array)} with {self.columns} columns")
        return int(row) * self.columns + int(column)

    def __getitem__(self, index: Any) -> Any:
        value = self.array[self.place(index)]
        return value.copy().view(Lanes) if self.array.ndim == 2 else float(value)

    def __setitem__(self, index: Any, value: Any) -> None:
        self.array[self.place(index)] = value


def _quadrant(turns: Lanes) -> tuple[Lanes, ...]:
    k = turns.astype(np.int64)
    return k & 1 != 0, k & 2 != 0, (k + 1) & 2 != 0


def vector(x: Any, y: Any, z: Any) -> Lanes:
    return np.array([as_lanes(x), as_lanes(y), as_lanes(z)]).view(Lanes)


def cross(a: Lanes, b: Lanes) -> Lanes:
    return np.cross(a, b, axis=0).view(Lanes)


def get_vector(table: Table, row: int, column: int) -> Lanes:
    return vector(*(table[row, column + i] for i in range(3)))


def set_vector(table: Table, row: int, column: int, value: Lanes) -> None:
    for i in range(3):
        table[row, column + i] = value[i]


def pick(table: Table, indices: Lanes) -> Lanes:
    return as_lanes([table.array[table.place((int(i) // table.columns, int(i) % table.columns))]
                     for i in indices])  # fmt: skip


def set_lane(table: Table, row: int, lane: int, value: float) -> None:
    assert 0 <= lane < WIDTH
    table.array[table.place(row), lane] = value


NUMPY = {
    "sqrt": np.sqrt,
    "magnitude": np.abs,
    "nearest": np.rint,
    "floor": np.floor,
    "maximum": lambda a, b: np.where(a > b, a, b).view(Lanes),
    "minimum": lambda a, b: np.where(a < b, a, b).view(Lanes),
    "select": lambda mask, a, b: as_lanes(np.where(mask, a, b)),
    "bits": lambda mask: reduce(or_, (int(bit) << i for i, bit in enumerate(mask))),
    "_quadrant": _quadrant,
    "vector": vector,
    "product": np.multiply,
    "dot": lambda a, b: (a * b).sum(axis=0),
    "cross": cross,
    "rolled": lambda a: np.roll(a, -1, axis=0),
    "components": tuple,
    "floats": lambda array, columns: Table(array.ravel(), columns),
    "lanes": lambda array, columns: Table(array.reshape(-1, WIDTH), columns),
    "first_if_none": lambda value, first, second: first if value is None else second,
    "subtable": lambda table, row, columns: Table(table.array[row * table.columns :], columns),
    "get_vector": get_vector,
    "set_vector": set_vector,
    "pick": pick,
    "pick_row": lambda table, indices: tuple(pick(table, indices + k) for k in range(WIDTH)),
    "get_lane": lambda table, row, lane: float(table[row][lane]),
    "set_lane": set_lane,
}


@contextmanager
def sources(*modules: Any) -> Iterator[None]:
    """Run the compiled functions of modules, which compute with numbers, as plain Python."""
    with ExitStack() as changes:
        for module in modules:
            plain = {name: value.py_func for name, value in vars(module).items()
                     if isinstance(value, Dispatcher)}  # fmt: skip
            changes.enter_context(patch.multiple(module, **plain))
        yield


@contextmanager
def plain_kernels() -> Iterator[None]:
    """Run the kernels as plain Python, also those of ``EnsembleIntegrator.integrate``."""
    names = [
        module.name
        for package in (freefloat.lockstep, freefloat.dynamics.kernels, freefloat.ensemble)
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    ]
    with ExitStack() as changes:
        for module in [importlib.import_module(name) for name in names]:
            plain = {
                name: NUMPY.get(name) or np.errstate(all="ignore")(value.py_func)
                for name, value in vars(module).items()
                if isinstance(value, Dispatcher | _Intrinsic)
            }
            if plain:
                changes.enter_context(patch.multiple(module, **plain))
        yield
