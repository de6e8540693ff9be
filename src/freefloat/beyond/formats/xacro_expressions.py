"""Values of the expressions of xacro files, without a way to the rest of Python.

Only operators, literals, subscripts, calls and names are accepted. An attribute is an entry of a
namespace or of a dictionary, or one of a few methods of text, lists and dictionaries: never an
attribute of Python's objects.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from typing import Any

_ACCEPTED = (
    ast.Expression, ast.BoolOp, ast.BinOp, ast.UnaryOp, ast.IfExp, ast.Compare, ast.Call,
    ast.keyword, ast.Attribute, ast.Subscript, ast.Slice, ast.Name, ast.Constant, ast.List,
    ast.Tuple, ast.Dict, ast.Set, ast.expr_context, ast.operator, ast.boolop, ast.unaryop,
    ast.cmpop,
)  # fmt: skip
_METHODS = {
    str: {"count", "endswith", "find", "index", "isdigit", "join", "lower", "lstrip", "replace",
          "rfind", "rsplit", "rstrip", "split", "splitlines", "startswith", "strip", "title",
          "upper", "zfill"},
    list: {"append", "copy", "count", "extend", "index", "insert", "pop", "remove", "reverse"},
    tuple: {"count", "index"},
    dict: {"copy", "get", "items", "keys", "pop", "update", "values"},
}  # fmt: skip
"""Methods by type; ``format`` would reach attributes."""
_ATTRIBUTE = "attribute of"
"""Name of the function for attributes, which no expression can write."""


class ExpressionError(Exception):
    """An expression that is not accepted."""


def evaluate(expression: str, symbols: dict[str, Any]) -> Any:
    """The value of an expression.

    Args:
        expression: Text of the expression.
        symbols: Values of names.

    Raises:
        ExpressionError: If it is more than an expression of numbers, text, lists and functions.
    """
    tree = ast.fix_missing_locations(_Checked().visit(ast.parse(expression.strip(), mode="eval")))
    names = {"__builtins__": {}, _ATTRIBUTE: _attribute}
    return eval(compile(tree, "<expression>", "eval"), names, symbols)


class _Checked(ast.NodeTransformer):
    """Refuses what is not accepted; attributes become calls of a function."""

    def visit(self, node: ast.AST) -> Any:
        if not isinstance(node, _ACCEPTED):
            raise ExpressionError(f"{type(node).__name__} is not accepted in expressions")
        return super().visit(node)

    def visit_Name(self, node: ast.Name) -> ast.Name:
        if node.id.startswith("__"):
            raise ExpressionError(f"the name {node.id} is not accepted in expressions")
        return node

    def visit_Attribute(self, node: ast.Attribute) -> ast.Call:
        if node.attr.startswith("_"):
            raise ExpressionError(f"the attribute {node.attr} is not accepted in expressions")
        function = ast.Name(_ATTRIBUTE, ast.Load())
        return ast.Call(function, [self.visit(node.value), ast.Constant(node.attr)], [])


def _attribute(value: object, name: str) -> Any:
    """An entry of a dictionary or namespace, or a method of a literal."""
    if isinstance(value, Mapping) and name in value:
        return value[name]
    plain = next((kind for kind in _METHODS if isinstance(value, kind)), None)
    if plain is None or name not in _METHODS[plain]:
        raise ExpressionError(f"{type(value).__name__} has no {name} that expressions can use")
    return getattr(value, name)
