"""Numbers of several motions in lock step: the number type of the ensemble's kernels.

A kernel that computes with ``Lanes`` computes for ``WIDTH`` motions at once and reads like one for
floats: ``+ - * /`` work motion by motion, comparisons give a ``Mask``, and :func:`select` replaces
branches. LLVM sees a vector of doubles and uses the widest registers of the computer.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any, TypeAlias

from llvmlite import ir
from numba import types
from numba.core.typeconv.castgraph import Conversion
from numba.extending import (
    intrinsic,
    lower_builtin,
    lower_cast,
    models,
    register_model,
    type_callable,
)

from freefloat.lockstep.compilation import inlined

Float: TypeAlias = Any
"""In annotations of kernels: a float of each motion."""
Mask: TypeAlias = Any
"""In annotations of kernels: a truth value of each motion."""

WIDTH = 8
"""Number of motions in lock step."""
DOUBLE, INTEGER, SHORT = ir.DoubleType(), ir.IntType(64), ir.IntType(32)
LANES, INTEGERS = ir.VectorType(DOUBLE, WIDTH), ir.VectorType(INTEGER, WIDTH)
_FLAGS = ("contract", "nsz")
Generate: TypeAlias = Callable[..., Any]
"""Writes instructions, from LLVM's builder and the values of the arguments."""
builtin: Any = intrinsic
"""Decorator of functions for kernels that give their own instructions."""


class LanesType(types.Type):
    """Numba type of a double for each motion."""

    def __init__(self) -> None:
        super().__init__(name=f"Lanes({WIDTH})")

    def can_convert_from(self, context: Any, other: Any) -> Any:
        """Numbers become the number of each motion."""
        return Conversion.safe if isinstance(other, types.Number) else None

    def unify(self, context: Any, other: Any) -> Any:
        """A variable that is assigned numbers, too, is of this type."""
        return self if isinstance(other, types.Number) else None


class MaskType(types.Type):
    """Numba type of a truth value for each motion."""

    def __init__(self) -> None:
        super().__init__(name=f"Mask({WIDTH})")


lanes_type, mask_type = LanesType(), MaskType()


def represent(kind: type[types.Type], value: ir.Type) -> None:
    """Let values of a Numba type be values of a type of LLVM."""

    @register_model(kind)
    class _(models.PrimitiveModel):
        def __init__(self, manager: Any, numba_type: Any) -> None:
            super().__init__(manager, numba_type, value)


represent(LanesType, LANES)
represent(MaskType, ir.VectorType(ir.IntType(1), WIDTH))


@lower_cast(types.Number, LanesType)
@lower_cast(types.IntegerLiteral, LanesType)
def _repeat(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    value = context.cast(builder, value, source, types.float64)
    first = builder.insert_element(ir.Constant(LANES, ir.Undefined), value, SHORT(0))
    return builder.shuffle_vector(
        first, first, ir.Constant(ir.VectorType(SHORT, WIDTH), [0] * WIDTH)
    )


# --- definition of operations and functions -------------------------------------------------------


def operation(
    function: Callable[..., Any], kinds: tuple[Any, ...], result: Any, generate: Generate
) -> None:
    """Let kernels apply an operator to arguments of some types; ``Lanes`` stand for numbers, too.

    Args:
        function: The operator.
        kinds: Types of its arguments.
        result: Type of the result.
        generate: Gives the instructions.
    """

    @type_callable(function)
    def _(context: Any) -> Any:
        def typer(*arguments: Any) -> Any:
            accepted = len(arguments) == len(kinds) and all(
                kind == given or (kind == lanes_type and isinstance(given, types.Number))
                for kind, given in zip(kinds, arguments, strict=True)
            )
            ours = any(kind in arguments for kind in kinds)
            return result if accepted and ours else None

        return (lambda a: typer(a)) if len(kinds) == 1 else (lambda a, b: typer(a, b))

    choices: list[tuple[Any, ...]] = [()]
    for kind in kinds:
        accepted = (LanesType, types.Number) if kind == lanes_type else (type(kind),)
        choices = [(*choice, entry) for choice in choices for entry in accepted]
    for choice in choices:
        if any(not issubclass(entry, types.Number) for entry in choice):
            lower_builtin(function, *choice)(_lowered(kinds, generate))


def function(result: Any, generate: Generate, *kinds: Any) -> Any:
    """A function for kernels, whose arguments are cast to the types."""
    lower = _lowered(kinds, generate)
    if len(kinds) == 1:
        return intrinsic(lambda typing, a: (result(a), lower))
    if len(kinds) == 2:
        return intrinsic(lambda typing, a, b: (result(a, b), lower))
    return intrinsic(lambda typing, a, b, c: (result(a, b, c), lower))


def _lowered(kinds: tuple[Any, ...], generate: Generate) -> Any:
    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        casts = [
            context.cast(builder, value, source, kind)
            for value, source, kind in zip(values, signature.args, kinds, strict=True)
        ]
        return generate(builder, *casts)

    return lower


def add(builder: Any, a: Any, b: Any) -> Any:
    """Instruction for a sum, which may be part of a fused multiplication."""
    return builder.fadd(a, b, flags=_FLAGS)


def subtract(builder: Any, a: Any, b: Any) -> Any:
    """Instruction for a difference, as :func:`add`."""
    return builder.fsub(a, b, flags=_FLAGS)


def multiply(builder: Any, a: Any, b: Any) -> Any:
    """Instruction for a product, as :func:`add`."""
    return builder.fmul(a, b, flags=_FLAGS)


def negate(builder: Any, a: Any) -> Any:
    """Instruction for the opposite number."""
    return builder.fneg(a)


def _divide(builder: Any, a: Any, b: Any) -> Any:
    return builder.fdiv(a, b)


def _comparison(sign: str) -> Generate:
    """Comparison, false where a number is not a number."""
    return lambda builder, a, b: builder.fcmp_ordered(sign, a, b)


def _library(name: str) -> Generate:
    def generate(builder: Any, value: Any) -> Any:
        kind = ir.FunctionType(LANES, [LANES])
        called = builder.module.declare_intrinsic(f"llvm.{name}.v{WIDTH}f64", fnty=kind)
        return builder.call(called, [value])

    return generate


def _extreme(sign: str) -> Generate:
    """The number for which a comparison holds, the second where one is not a number."""
    return lambda builder, a, b: builder.select(builder.fcmp_ordered(sign, a, b), a, b)


for _plain, _in_place, _generate in (
    (operator.add, operator.iadd, add),
    (operator.sub, operator.isub, subtract),
    (operator.mul, operator.imul, multiply),
    (operator.truediv, operator.itruediv, _divide),
):
    operation(_plain, (lanes_type, lanes_type), lanes_type, _generate)
    operation(_in_place, (lanes_type, lanes_type), lanes_type, _generate)
operation(operator.neg, (lanes_type,), lanes_type, negate)
for _compare, _sign in (
    (operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">="),
    (operator.eq, "=="),
):  # fmt: skip
    operation(_compare, (lanes_type, lanes_type), mask_type, _comparison(_sign))
operation(operator.and_, (mask_type, mask_type), mask_type, lambda b, x, y: b.and_(x, y))
operation(operator.or_, (mask_type, mask_type), mask_type, lambda b, x, y: b.or_(x, y))
operation(operator.invert, (mask_type,), mask_type, lambda b, x: b.not_(x))

sqrt = function(lanes_type, _library("sqrt"), lanes_type)
magnitude = function(lanes_type, _library("fabs"), lanes_type)
nearest = function(lanes_type, _library("rint"), lanes_type)
floor = function(lanes_type, _library("floor"), lanes_type)
maximum = function(lanes_type, _extreme(">"), lanes_type, lanes_type)
minimum = function(lanes_type, _extreme("<"), lanes_type, lanes_type)
select = function(
    lanes_type, lambda b, m, x, y: b.select(m, x, y), mask_type, lanes_type, lanes_type
)


@builtin
def bits(typing: Any, mask: Any) -> Any:
    """A mask as the bits of an integer, the first motion's the lowest."""

    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.zext(builder.bitcast(values[0], ir.IntType(WIDTH)), INTEGER)

    return types.int64(mask), lower


@inlined
def any_of(mask: Mask) -> bool:
    """Whether a mask is true for any of the motions."""
    return bool(bits(mask) != 0)


@builtin
def _quadrant(typing: Any, turns: Any) -> Any:
    """Whether sine and cosine swap, and change their signs, at a number of right angles."""

    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        def constant(number: int) -> Any:
            return ir.Constant(INTEGERS, [number] * WIDTH)

        k = builder.fptosi(values[0], INTEGERS)
        masks = [
            builder.icmp_signed("!=", builder.and_(number, constant(bit)), constant(0))
            for number, bit in ((k, 1), (k, 2), (builder.add(k, constant(1)), 2))
        ]
        return context.make_tuple(builder, signature.return_type, masks)

    return types.UniTuple(mask_type, 3)(turns), lower


@inlined
def sine_cosine(x: Float) -> tuple[Float, Float]:
    """Sine and cosine to one unit in the last place, of angles below 1e5.

    Three-part reduction to a quarter turn and the polynomials of fdlibm (Sun Microsystems, 1993).
    """
    turns = nearest(x * 0.63661977236758134308)
    swapped, sine_negative, cosine_negative = _quadrant(turns)
    r = x - turns * 1.57079632673412561417
    r = r - turns * 6.07710050630396597660e-11
    r = r - turns * 2.02226624879595063154e-21
    z = r * r
    p = z * 1.58969099521155010221e-10 - 2.50507602534068634195e-08
    p = (p * z + 2.75573137070700676789e-06) * z - 1.98412698298579493134e-04
    p = (p * z + 8.33333333332248946124e-03) * z - 1.66666666666666324348e-01
    s = r + r * z * p
    p = z * -1.13596475577881948265e-11 + 2.08757232129817482790e-09
    p = (p * z - 2.75573143513906633035e-07) * z + 2.48015872894767294178e-05
    p = (p * z - 1.38888888888741095749e-03) * z + 4.16666666666666019037e-02
    c = 1.0 - (0.5 * z - z * z * p)
    sine, cosine = select(swapped, c, s), select(swapped, s, c)
    return select(sine_negative, -sine, sine), select(cosine_negative, -cosine, cosine)
