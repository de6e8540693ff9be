"""Numbers of several motions in lock step: the number type of the ensemble's kernels.

A kernel that computes with ``Lanes`` computes for ``WIDTH`` motions at once and reads like one for
floats: ``+ - * /`` work lane by lane, comparisons give a ``Mask``, and :func:`select` replaces
branches. LLVM sees a vector of doubles and uses the widest registers of the computer. A ``Vector``
has three components of this kind, for which :func:`dot` and :func:`cross` exist.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typeconv import Conversion
from numba.extending import (
    intrinsic,
    lower_builtin,
    lower_cast,
    models,
    register_model,
    type_callable,
)

from freefloat.dynamics.kernels.compilation import inlined

WIDTH = int(__import__("os").environ.get("LANES", "8"))
"""Number of motions in lock step."""
_DOUBLE, _INT, _SHORT = ir.DoubleType(), ir.IntType(64), ir.IntType(32)
_LANES = ir.VectorType(_DOUBLE, WIDTH)
_INTS = ir.VectorType(_INT, WIDTH)
_BITS = ir.VectorType(ir.IntType(1), WIDTH)
_FLAGS = ("contract", "nsz")


class LanesType(types.Type):
    """Numba type of a double for each motion."""

    def __init__(self) -> None:
        super().__init__(name=f"Lanes({WIDTH})")

    def can_convert_from(self, context: Any, other: Any) -> Any:
        return Conversion.safe if isinstance(other, types.Number) else None

    def unify(self, context: Any, other: Any) -> Any:
        return self if isinstance(other, types.Number) else None


class MaskType(types.Type):
    """Numba type of a truth value for each motion."""

    def __init__(self) -> None:
        super().__init__(name=f"Mask({WIDTH})")


class VectorType(types.Type):
    """Numba type of three ``Lanes``."""

    def __init__(self) -> None:
        super().__init__(name=f"Vector({WIDTH})")


Lanes, Mask, Vector = LanesType(), MaskType(), VectorType()


def _represented_by(kind: type[types.Type], value: ir.Type) -> None:
    @register_model(kind)
    class _(models.PrimitiveModel):
        def __init__(self, manager: Any, numba_type: Any) -> None:
            super().__init__(manager, numba_type, value)


_represented_by(LanesType, _LANES)
_represented_by(MaskType, _BITS)
_represented_by(VectorType, ir.ArrayType(_LANES, 3))


@lower_cast(types.Number, LanesType)
@lower_cast(types.IntegerLiteral, LanesType)
def _splat(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    value = context.cast(builder, value, source, types.float64)
    first = builder.insert_element(ir.Constant(_LANES, ir.Undefined), value, _SHORT(0))
    return builder.shuffle_vector(first, first, ir.Constant(ir.VectorType(_SHORT, WIDTH), [0] * WIDTH))


# --- arithmetic -----------------------------------------------------------------------------------


def _operation(
    function: Callable[..., Any], kinds: tuple[Any, ...], result: Any, generate: Callable[..., Any]
) -> None:
    """Let a kernel apply a function to arguments of some kinds; numbers become ``Lanes``.

    Args:
        function: An operator.
        kinds: Types of its arguments, of which ``Lanes`` stands for numbers, too.
        result: Type of the result.
        generate: Gives the instructions, from the builder and the values.
    """

    @type_callable(function)
    def _(context: Any) -> Any:
        def typer(*arguments: Any) -> Any:
            accepted = all(
                kind == given or (kind == Lanes and isinstance(given, types.Number))
                for kind, given in zip(kinds, arguments, strict=False)
            )
            special = any(isinstance(a, LanesType | MaskType | VectorType) for a in arguments)
            matches = len(arguments) == len(kinds) and accepted and special
            return result if matches else None

        if len(kinds) == 1:
            return lambda a: typer(a)
        return lambda a, b: typer(a, b)

    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        casts = [
            context.cast(builder, value, given, kind)
            for value, given, kind in zip(values, signature.args, kinds, strict=True)
        ]
        return generate(builder, *casts)

    choices: list[tuple[Any, ...]] = [()]
    for kind in kinds:
        accepted = (LanesType, types.Number) if kind == Lanes else (type(kind),)
        choices = [(*choice, entry) for choice in choices for entry in accepted]
    for choice in choices:
        if any(not issubclass(entry, types.Number) for entry in choice):
            lower_builtin(function, *choice)(lower)


def _components(builder: Any, vector: Any) -> list[Any]:
    return [builder.extract_value(vector, i) for i in range(3)]


def _vector(builder: Any, components: Any) -> Any:
    result = ir.Constant(ir.ArrayType(_LANES, 3), ir.Undefined)
    for i, component in enumerate(components):
        result = builder.insert_value(result, component, i)
    return result


def _instruction(name: str) -> Callable[..., Any]:
    return lambda builder, *values: getattr(builder, name)(*values, flags=_FLAGS)


_add, _subtract, _multiply, _negate = (
    _instruction(name) for name in ("fadd", "fsub", "fmul", "fneg")
)


def _negated(builder: Any, value: Any) -> Any:
    return builder.fneg(value)


def _divide(builder: Any, a: Any, b: Any) -> Any:
    return builder.fdiv(a, b)


def _by_component(generate: Callable[..., Any]) -> Callable[..., Any]:
    def both(builder: Any, a: Any, b: Any) -> Any:
        pairs = zip(_components(builder, a), _components(builder, b), strict=True)
        return _vector(builder, [generate(builder, x, y) for x, y in pairs])

    return both


def _scaled(builder: Any, vector: Any, factor: Any) -> Any:
    return _vector(builder, [_multiply(builder, x, factor) for x in _components(builder, vector)])


for _plain, _in_place, _generate in (
    (operator.add, operator.iadd, _add),
    (operator.sub, operator.isub, _subtract),
    (operator.mul, operator.imul, _multiply),
    (operator.truediv, operator.itruediv, _divide),
):
    _operation(_plain, (Lanes, Lanes), Lanes, _generate)
    _operation(_in_place, (Lanes, Lanes), Lanes, _generate)
for _plain, _generate in (
    (operator.add, _by_component(_add)), (operator.iadd, _by_component(_add)),
    (operator.sub, _by_component(_subtract)), (operator.isub, _by_component(_subtract)),
):  # fmt: skip
    _operation(_plain, (Vector, Vector), Vector, _generate)
_operation(operator.mul, (Vector, Lanes), Vector, _scaled)
_operation(operator.mul, (Lanes, Vector), Vector, lambda b, x, v: _scaled(b, v, x))
_operation(operator.neg, (Lanes,), Lanes, _negated)
_operation(
    operator.neg, (Vector,), Vector,
    lambda b, v: _vector(b, [_negated(b, x) for x in _components(b, v)]),
)  # fmt: skip


def _comparison(sign: str) -> Callable[..., Any]:
    """Comparison, false where a number is not a number."""
    return lambda builder, a, b: builder.fcmp_ordered(sign, a, b)


for _compare, _sign in (
    (operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">="),
    (operator.eq, "=="),
):  # fmt: skip
    _operation(_compare, (Lanes, Lanes), Mask, _comparison(_sign))
_operation(operator.and_, (Mask, Mask), Mask, lambda b, x, y: b.and_(x, y))
_operation(operator.or_, (Mask, Mask), Mask, lambda b, x, y: b.or_(x, y))
_operation(operator.invert, (Mask,), Mask, lambda b, x: b.not_(x))


# --- functions ------------------------------------------------------------------------------------


def _function(result: Any, generate: Callable[..., Any], *kinds: Any) -> Any:
    """A function for kernels, whose arguments are cast to the kinds."""

    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        casts = [
            context.cast(builder, value, given, kind)
            for value, given, kind in zip(values, signature.args, kinds, strict=True)
        ]
        return generate(builder, *casts)

    if len(kinds) == 1:
        return intrinsic(lambda typing, a: (result(a), lower))
    if len(kinds) == 2:
        return intrinsic(lambda typing, a, b: (result(a, b), lower))
    return intrinsic(lambda typing, a, b, c: (result(a, b, c), lower))


def _call(name: str) -> Callable[..., Any]:
    def generate(builder: Any, value: Any) -> Any:
        kind = ir.FunctionType(_LANES, [_LANES])
        name_of_width = f"llvm.{name}.v{WIDTH}f64"
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, name_of_width), [value])

    return generate


def _dot(builder: Any, a: Any, b: Any) -> Any:
    (a0, a1, a2), (b0, b1, b2) = _components(builder, a), _components(builder, b)
    total = _multiply(builder, a0, b0)
    for x, y in ((a1, b1), (a2, b2)):
        total = _add(builder, total, _multiply(builder, x, y))
    return total


def _cross(builder: Any, a: Any, b: Any) -> Any:
    a, b = _components(builder, a), _components(builder, b)

    def minor(i: int, j: int) -> Any:
        first, second = _multiply(builder, a[i], b[j]), _multiply(builder, a[j], b[i])
        return _subtract(builder, first, second)

    return _vector(builder, (minor(1, 2), minor(2, 0), minor(0, 1)))


def _extreme(sign: str) -> Callable[..., Any]:
    return lambda builder, a, b: builder.select(builder.fcmp_ordered(sign, a, b), a, b)


sqrt = _function(Lanes, _call("sqrt"), Lanes)
magnitude = _function(Lanes, _call("fabs"), Lanes)
nearest = _function(Lanes, _call("rint"), Lanes)
floor = _function(Lanes, _call("floor"), Lanes)
maximum = _function(Lanes, _extreme(">"), Lanes, Lanes)
minimum = _function(Lanes, _extreme("<"), Lanes, Lanes)
select = _function(Lanes, lambda b, m, x, y: b.select(m, x, y), Mask, Lanes, Lanes)
vector = _function(Vector, lambda b, *xyz: _vector(b, xyz), Lanes, Lanes, Lanes)
product = _function(Vector, _by_component(_multiply), Vector, Vector)
dot = _function(Lanes, _dot, Vector, Vector)
cross = _function(Vector, _cross, Vector, Vector)


@intrinsic
def rolled(typing: Any, a: Any) -> Any:
    """The vector (y, z, x) of a vector (x, y, z)."""

    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        x, y, z = _components(builder, values[0])
        return _vector(builder, (y, z, x))

    return Vector(a), lower


@intrinsic
def components(typing: Any, a: Any) -> Any:
    """The three components of a vector."""

    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return context.make_tuple(builder, signature.return_type, _components(builder, values[0]))

    return types.UniTuple(Lanes, 3)(a), lower


def _integers(number: int) -> Any:
    return ir.Constant(_INTS, [number] * WIDTH)


@intrinsic
def bits(typing: Any, mask: Any) -> Any:
    """A mask as the bits of an integer, the first motion's the lowest."""

    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.zext(builder.bitcast(values[0], ir.IntType(WIDTH)), _INT)

    return types.int64(mask), lower


@inlined
def any_of(mask):
    """Whether a mask is true for any of the motions."""
    return bits(mask) != 0


@intrinsic
def _quadrant(typing: Any, turns: Any) -> Any:
    """Of a number of right angles: whether sine and cosine swap, and change their signs."""

    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        k = builder.fptosi(values[0], _INTS)
        masks = [
            builder.icmp_signed("!=", builder.and_(number, _integers(bit)), _integers(0))
            for number, bit in ((k, 1), (k, 2), (builder.add(k, _integers(1)), 2))
        ]
        return context.make_tuple(builder, signature.return_type, masks)

    return types.UniTuple(Mask, 3)(turns), lower


@inlined
def sine_cosine(x):
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
