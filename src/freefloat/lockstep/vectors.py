"""Vectors with three components in kernels, each a float of every motion."""

from __future__ import annotations

import operator
from typing import Any, TypeAlias

from llvmlite import ir
from numba import types

from freefloat.lockstep.lanes import (
    LANES,
    Generate,
    add,
    builtin,
    function,
    lanes_type,
    multiply,
    negate,
    operation,
    represent,
    subtract,
)

Vector: TypeAlias = Any
"""In annotations of kernels: a vector of each motion."""
_THREE = ir.ArrayType(LANES, 3)


class VectorType(types.Type):
    """Numba type of a vector for each motion."""

    def __init__(self) -> None:
        super().__init__(name=f"Vector({LANES})")


vector_type = VectorType()
represent(VectorType, _THREE)


def unpack(builder: Any, value: Any) -> list[Any]:
    """The values of the components."""
    return [builder.extract_value(value, i) for i in range(3)]


def pack(builder: Any, values: Any) -> Any:
    """The value of a vector with these components."""
    result = ir.Constant(_THREE, ir.Undefined)
    for i, component in enumerate(values):
        result = builder.insert_value(result, component, i)
    return result


def _by_component(generate: Generate) -> Generate:
    def both(builder: Any, a: Any, b: Any) -> Any:
        pairs = zip(unpack(builder, a), unpack(builder, b), strict=True)
        return pack(builder, [generate(builder, x, y) for x, y in pairs])

    return both


def _scale(builder: Any, a: Any, factor: Any) -> Any:
    return pack(builder, [multiply(builder, x, factor) for x in unpack(builder, a)])


def _negate(builder: Any, a: Any) -> Any:
    return pack(builder, [negate(builder, x) for x in unpack(builder, a)])


def _dot(builder: Any, a: Any, b: Any) -> Any:
    products = unpack(builder, _by_component(multiply)(builder, a, b))
    return add(builder, add(builder, products[0], products[1]), products[2])


def _cross(builder: Any, a: Any, b: Any) -> Any:
    a, b = unpack(builder, a), unpack(builder, b)

    def minor(i: int, j: int) -> Any:
        return subtract(builder, multiply(builder, a[i], b[j]), multiply(builder, a[j], b[i]))

    return pack(builder, (minor(1, 2), minor(2, 0), minor(0, 1)))


for _plain, _generate in (
    (operator.add, add), (operator.iadd, add), (operator.sub, subtract), (operator.isub, subtract),
):  # fmt: skip
    operation(_plain, (vector_type, vector_type), vector_type, _by_component(_generate))
operation(operator.mul, (vector_type, lanes_type), vector_type, _scale)
operation(operator.neg, (vector_type,), vector_type, _negate)

vector = function(
    vector_type, lambda builder, *xyz: pack(builder, xyz), lanes_type, lanes_type, lanes_type
)
product = function(vector_type, _by_component(multiply), vector_type, vector_type)
"""The vector of the products of components."""
dot = function(lanes_type, _dot, vector_type, vector_type)
cross = function(vector_type, _cross, vector_type, vector_type)


@builtin
def rolled(typing: Any, a: Any) -> Any:
    """The vector (y, z, x) of a vector (x, y, z)."""

    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        x, y, z = unpack(builder, values[0])
        return pack(builder, (y, z, x))

    return vector_type(a), lower


@builtin
def components(typing: Any, a: Any) -> Any:
    """The three components of a vector."""

    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return context.make_tuple(builder, signature.return_type, unpack(builder, values[0]))

    return types.UniTuple(lanes_type, 3)(a), lower
