"""Small changes of a source text: operators, comparisons, numbers, conditions, statements."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass

OPERATORS: dict[type, list[type]] = {
    ast.Add: [ast.Sub], ast.Sub: [ast.Add], ast.Mult: [ast.Div], ast.Div: [ast.Mult],
    ast.FloorDiv: [ast.Mult], ast.Mod: [ast.Mult], ast.Pow: [ast.Mult],
    ast.BitAnd: [ast.BitOr], ast.BitOr: [ast.BitAnd], ast.And: [ast.Or], ast.Or: [ast.And],
    ast.Lt: [ast.LtE, ast.GtE], ast.LtE: [ast.Lt, ast.Gt], ast.Gt: [ast.GtE, ast.LtE],
    ast.GtE: [ast.Gt, ast.Lt], ast.Eq: [ast.NotEq], ast.NotEq: [ast.Eq],
    ast.Is: [ast.IsNot], ast.IsNot: [ast.Is], ast.In: [ast.NotIn], ast.NotIn: [ast.In],
}  # fmt: skip
NAMES = {"min": "max", "max": "min", "any": "all", "all": "any", "minimum": "maximum",
         "maximum": "minimum", "hstack": "vstack"}  # fmt: skip
SYMMETRIC = {"min", "max", "minimum", "maximum", "joint_distance", "leg"}
"""Functions whose arguments may be exchanged; ``leg(start, end)`` orders its times."""
IGNORED = {"dtype", "order", "strict", "frozen", "eq", "repr"}
"""Keywords that change types or checks, not results."""


@dataclass
class Mutant:
    """One small change, and the test that noticed it."""

    line: int
    kind: str
    before: str
    after: str
    killed_by: str = ""

    def __str__(self) -> str:
        return f"{self.line}: {self.kind}: {self.before}  ->  {self.after}"


def other_numbers(value: float) -> list[float]:
    """Numbers to put in place of a number; tolerances and counts change by more.

    An index of zero becomes one: -1 is the same in arrays of one row.
    """
    if isinstance(value, int) and value == 0:
        return [1]
    if isinstance(value, int):
        return [value + 1, value - 1] if abs(value) < 20 else [value // 10]
    return [1.0] if value == 0.0 else [1e3 * value, 1e-3 * value] if value < 0.01 else [2.0 * value]


def other_expressions(node: ast.expr) -> Iterator[tuple[str, ast.expr]]:
    """Mutants of an expression, each with its kind."""
    match node:
        case ast.BinOp(a, ast.MatMult(), b):
            yield "swap", ast.BinOp(b, ast.MatMult(), a)
        case ast.BinOp(a, op, b):
            yield from (("operator", ast.BinOp(a, new(), b)) for new in OPERATORS.get(type(op), ()))
        case ast.BoolOp(op, values):
            yield "operator", ast.BoolOp(OPERATORS[type(op)][0](), values)
        case ast.Compare(a, [op, *more], values):
            for new in OPERATORS[type(op)]:
                yield "comparison", ast.Compare(a, [new(), *more], values)
        case ast.UnaryOp(ast.USub() | ast.Not() | ast.Invert(), operand):
            yield "sign", operand
        case ast.Constant(bool(value)):
            yield "constant", ast.Constant(not value)
        case ast.Constant(int(value) | float(value)):
            yield from (("constant", ast.Constant(new)) for new in other_numbers(value))
        case ast.IfExp(test, body, orelse):
            yield "branches", ast.IfExp(test, orelse, body)
        case ast.Call(function, args, keywords):
            yield from other_calls(function, args, keywords)
        case ast.Attribute(value, name, context) if name in NAMES:
            yield "name", ast.Attribute(value, NAMES[name], context)
        case ast.Name(name, context) if name in NAMES:
            yield "name", ast.Name(NAMES[name], context)


def other_calls(
    function: ast.expr, args: list[ast.expr], keywords: list[ast.keyword]
) -> Iterator[tuple[str, ast.expr]]:
    symmetric = getattr(function, "id", getattr(function, "attr", "")) in SYMMETRIC
    for i in range(0 if symmetric else len(args) - 1):
        if not isinstance(args[i], ast.Starred) and ast.dump(args[i]) != ast.dump(args[i + 1]):
            swapped = [*args[:i], args[i + 1], args[i], *args[i + 2 :]]
            yield "arguments", ast.Call(function, swapped, keywords)
    for i, keyword in enumerate(keywords):
        if keyword.arg and keyword.arg not in IGNORED:
            yield "arguments", ast.Call(function, args, keywords[:i] + keywords[i + 1 :])


def other_statements(node: ast.stmt) -> Iterator[tuple[str, ast.stmt]]:
    """Mutants of a statement, each with its kind."""
    match node:
        case ast.Return(value) if value is not None and not isinstance(value, ast.Constant):
            yield "return value", ast.Return(ast.Constant(None))
        case ast.Expr(ast.Constant()):
            return
        case ast.Expr() | ast.AugAssign() | ast.Raise() | ast.Continue() | ast.Break():
            yield "removed", ast.Pass()
        case ast.Assign([ast.Attribute() | ast.Subscript()]):
            yield "removed", ast.Pass()
        case ast.If(_, body, orelse) | ast.While(_, body, orelse):
            yield "condition", type(node)(ast.Constant(False), body, orelse)
            if isinstance(node, ast.If):
                yield "condition", ast.If(ast.Constant(True), body, orelse)


def sites(node: ast.AST) -> Iterator[tuple[ast.AST, str, int | None, str, ast.AST]]:
    """Every change below a node: parent, field, index in it, kind, new node."""
    for field, value in ast.iter_fields(node):
        if field in ("annotation", "returns", "decorator_list"):
            continue
        for index, child in enumerate(value if isinstance(value, list) else [value]):
            position = index if isinstance(value, list) else None
            if isinstance(child, ast.expr):
                changes: Iterator[tuple[str, ast.AST]] = other_expressions(child)
            elif isinstance(child, ast.stmt):
                changes = other_statements(child)
            else:
                changes = iter(())
            yield from ((node, field, position, kind, new) for kind, new in changes)
            if isinstance(child, ast.AST) and not is_left_alone(child):
                yield from sites(child)


def is_left_alone(node: ast.AST) -> bool:
    """Whether changes inside cannot change results."""
    if isinstance(node, ast.keyword):
        return node.arg in IGNORED
    return isinstance(node, ast.JoinedStr | ast.Raise | ast.Import | ast.ImportFrom)


def mutants_of(source: str) -> list[tuple[Mutant, str]]:
    """All mutants of a source, each with the source that it makes."""
    mutants = []
    tree = ast.parse(source)
    for parent, field, index, kind, new in sites(tree):
        value = getattr(parent, field)
        old = value if index is None else value[index]
        line = getattr(old, "lineno", getattr(parent, "lineno", 0))
        replace(parent, field, index, new)
        changed = ast.unparse(ast.fix_missing_locations(tree))
        replace(parent, field, index, old)
        before, after = (" ".join(ast.unparse(node).split())[:120] for node in (old, new))
        mutants.append((Mutant(line, kind, before, after), changed))
    return mutants


def replace(parent: ast.AST, field: str, index: int | None, child: ast.AST) -> None:
    if index is None:
        setattr(parent, field, child)
    else:
        getattr(parent, field)[index] = child
