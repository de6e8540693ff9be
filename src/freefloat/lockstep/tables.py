"""Arrays in kernels, as bare pointers: they cost nothing to pass on from kernel to kernel.

A table has a number of columns that the compiler knows. ``table[row, column]`` is a float or, in a
table of ``Lanes``, one for each motion in lock step; ``table[row]`` is short for its first column.
Indices are not checked, and whoever calls a kernel keeps the array of the table alive.
"""

from __future__ import annotations

import math
import operator
from typing import Any, TypeAlias

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import lower_builtin, models, register_model, type_callable

from freefloat.lockstep.lanes import (
    DOUBLE,
    INTEGER,
    LANES,
    SHORT,
    WIDTH,
    LanesType,
    builtin,
    lanes_type,
)
from freefloat.lockstep.vectors import pack, unpack, vector_type
from freefloat.so3 import Array

Table: TypeAlias = Any
"""In annotations of kernels: a table."""


_CACHE_LINE = 8
"""Numbers in a cache line."""


def workspace(*shapes: tuple[int, ...]) -> list[Array]:
    """Zeros for tables of ``Lanes`` with so many rows, or rows and columns, one array for each.

    They begin at the beginnings of cache lines: vectors across two take twice as long to store.
    """
    sizes = [WIDTH * math.prod(shape) for shape in shapes]
    room = np.zeros(sum(sizes) + _CACHE_LINE)
    begin = -room.ctypes.data // room.itemsize % _CACHE_LINE
    arrays = []
    for shape, size in zip(shapes, sizes, strict=True):
        arrays.append(room[begin : begin + size].reshape(*shape, WIDTH))
        begin += size
    return arrays


class TableType(types.Type):
    """Numba type of a table."""

    def __init__(self, columns: int, dtype: Any) -> None:
        self.columns, self.dtype = columns, dtype
        super().__init__(name=f"Table({columns}, {dtype})")


@register_model(TableType)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, DOUBLE.as_pointer())


def _view(dtype: Any) -> Any:
    @builtin(prefer_literal=True)
    def view(typing: Any, array: Any, columns: Any) -> Any:
        if not isinstance(columns, types.IntegerLiteral):
            return None

        def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return context.make_array(signature.args[0])(context, builder, values[0]).data

        return TableType(columns.literal_value, dtype)(array, columns), lower

    return view


floats, lanes = _view(types.float64), _view(lanes_type)
"""In a kernel: an array as a table with a literal number of columns."""


@builtin(prefer_literal=True)
def subtable(typing: Any, table: Any, row: Any, columns: Any) -> Any:
    """The table that begins at a row of another one, with a literal number of columns."""
    if not isinstance(columns, types.IntegerLiteral):
        return None

    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        row = context.cast(builder, values[1], signature.args[1], types.int64)
        return _address(builder, signature.args[0], values[0], row, INTEGER(0))

    return TableType(columns.literal_value, table.dtype)(table, row, columns), lower


@builtin
def first_if_none(typing: Any, value: Any, first: Any, second: Any) -> Any:
    """The first of two tables where a value is None, else the second; its type decides."""
    place = 1 if isinstance(value, types.NoneType) else 2
    chosen = (first, second)[place - 1]
    return chosen(value, first, second), lambda context, builder, kind, values: values[place]


def _address(builder: Any, table: TableType, start: Any, row: Any, column: Any) -> Any:
    place = builder.add(builder.mul(row, INTEGER(table.columns)), column)
    if table.dtype == lanes_type:
        place = builder.mul(place, INTEGER(WIDTH))
    return builder.gep(start, [place], inbounds=True, source_etype=DOUBLE)


def _indices(context: Any, builder: Any, kind: Any, value: Any) -> list[Any]:
    if hasattr(kind, "types"):
        return [
            context.cast(builder, builder.extract_value(value, i), entry, types.int64)
            for i, entry in enumerate(kind.types)
        ]
    return [context.cast(builder, value, kind, types.int64), INTEGER(0)]


def _load(builder: Any, table: TableType, pointer: Any) -> Any:
    if table.dtype != lanes_type:
        return builder.load(pointer, typ=DOUBLE)
    value = builder.load(builder.bitcast(pointer, LANES.as_pointer()), typ=LANES)
    value.align = 8
    return value


def _store(builder: Any, table: TableType, pointer: Any, value: Any) -> None:
    if table.dtype == lanes_type:
        pointer = builder.bitcast(pointer, LANES.as_pointer())
    builder.store(value, pointer).align = 8


@type_callable(operator.getitem)
def _(context: Any) -> Any:
    return lambda table, index: table.dtype if isinstance(table, TableType) else None


@type_callable(operator.setitem)
def _(context: Any) -> Any:
    return lambda table, index, value: types.none if isinstance(table, TableType) else None


def _get(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    table, index = signature.args
    row, column = _indices(context, builder, index, values[1])
    return _load(builder, table, _address(builder, table, values[0], row, column))


def _set(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    table, index, source = signature.args
    row, column = _indices(context, builder, index, values[1])
    value = context.cast(builder, values[2], source, table.dtype)
    _store(builder, table, _address(builder, table, values[0], row, column), value)
    return context.get_dummy_value()


for _index in (types.BaseTuple, types.Integer):
    lower_builtin(operator.getitem, TableType, _index)(_get)
    for _value in (LanesType, types.Number):
        lower_builtin(operator.setitem, TableType, _index, _value)(_set)


@builtin
def get_vector(typing: Any, table: Any, row: Any, column: Any) -> Any:
    """The vector in three columns of a table, the same for all motions in a table of floats."""

    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        row, column = (
            context.cast(builder, values[k], signature.args[k], types.int64) for k in (1, 2)
        )
        elements = []
        for i in range(3):
            pointer = _address(builder, table, values[0], row, builder.add(column, INTEGER(i)))
            value = _load(builder, table, pointer)
            elements.append(context.cast(builder, value, table.dtype, lanes_type))
        return pack(builder, elements)

    return vector_type(table, row, column), lower


@builtin
def set_vector(typing: Any, table: Any, row: Any, column: Any, value: Any) -> Any:
    """Write a vector to three columns of a table of ``Lanes``."""

    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        row, column = (
            context.cast(builder, values[k], signature.args[k], types.int64) for k in (1, 2)
        )
        for i, component in enumerate(unpack(builder, values[3])):
            pointer = _address(builder, table, values[0], row, builder.add(column, INTEGER(i)))
            _store(builder, table, pointer, component)
        return context.get_dummy_value()

    return types.none(table, row, column, value), lower


@builtin
def pick(typing: Any, table: Any, index: Any) -> Any:
    """The elements of a table of floats, read as one row, at an index for each motion."""

    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        indices = builder.fptosi(values[1], ir.VectorType(INTEGER, WIDTH))
        result = ir.Constant(LANES, ir.Undefined)
        for i in range(WIDTH):
            place = builder.extract_element(indices, SHORT(i))
            pointer = builder.gep(values[0], [place], inbounds=True, source_etype=DOUBLE)
            result = builder.insert_element(result, builder.load(pointer, typ=DOUBLE), SHORT(i))
        return result

    return lanes_type(table, lanes_type), lower


@builtin
def pick_row(typing: Any, table: Any, index: Any) -> Any:
    """The ``WIDTH`` elements that follow one another from an index for each motion, as a tuple.

    The elements of a motion are loaded at once; a transposition makes one of all motions of each.
    """

    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        indices = builder.fptosi(values[1], ir.VectorType(INTEGER, WIDTH))
        rows = []
        for i in range(WIDTH):
            place = builder.extract_element(indices, SHORT(i))
            pointer = builder.gep(values[0], [place], inbounds=True, source_etype=DOUBLE)
            row = builder.load(builder.bitcast(pointer, LANES.as_pointer()), typ=LANES)
            row.align = 8
            rows.append(row)
        return context.make_tuple(builder, signature.return_type, _transposed(builder, rows))

    return types.UniTuple(lanes_type, WIDTH)(table, lanes_type), lower


def _transposed(builder: Any, rows: list[Any]) -> list[Any]:
    rows, half = list(rows), 1
    while half < WIDTH:  # exchange elements between rows that are ``half`` apart
        low = [k if not k & half else WIDTH + k - half for k in range(WIDTH)]
        masks = [
            ir.Constant(ir.VectorType(SHORT, WIDTH), [k + shift for k in low])
            for shift in (0, half)
        ]
        for i in (i for i in range(WIDTH) if not i & half):
            pair = rows[i], rows[i + half]
            rows[i], rows[i + half] = (builder.shuffle_vector(*pair, mask) for mask in masks)
        half *= 2
    return rows


@builtin
def get_lane(typing: Any, table: Any, row: Any, lane: Any) -> Any:
    """The number of one of the motions in the first column of a table of ``Lanes``."""

    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.load(_lane(context, builder, signature, values), typ=DOUBLE)

    return types.float64(table, row, lane), lower


@builtin
def set_lane(typing: Any, table: Any, row: Any, lane: Any, value: Any) -> Any:
    """Write the number of one of the motions to the first column of a table of ``Lanes``."""

    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        number = context.cast(builder, values[3], signature.args[3], types.float64)
        builder.store(number, _lane(context, builder, signature, values))
        return context.get_dummy_value()

    return types.none(table, row, lane, value), lower


def _lane(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    row, lane = (context.cast(builder, values[k], signature.args[k], types.int64) for k in (1, 2))
    start = _address(builder, signature.args[0], values[0], row, INTEGER(0))
    return builder.gep(start, [lane], inbounds=True, source_etype=DOUBLE)
