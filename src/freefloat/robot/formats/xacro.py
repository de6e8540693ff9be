"""URDF text of xacro files; runs in a process of its own.

A xacro file is a program in a small language; it may read XML and YAML files, and nothing else. Its
expressions are evaluated without a way to the rest of Python: only operators, literals, subscripts,
calls and names are accepted. An attribute is an entry of a namespace or of a dictionary, or one of
a few methods of text, lists and dictionaries: never an attribute of Python's objects. The functions
that can be called are xacro's.
"""

from __future__ import annotations

import ast
import os
import re
import xml.dom.minidom
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from freefloat.errors import ModelError, one_line
from freefloat.robot.bundled import read_text
from freefloat.robot.formats.reader_process import UrdfText
from freefloat.robot.mesh_files import NAMED_PACKAGE, PACKAGES, find_package

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


_REFUSED = ("type", "vars")
"""Functions of xacro that reach Python's classes."""
_PREFIX = re.compile(r"<class '[^']*'>: ")
"""Name of an exception's class in messages of xacro."""


def read(file: str, packages: Mapping[str, str]) -> UrdfText:
    """The URDF that a xacro file makes, all arguments at their defaults.

    Files that it includes are relative to the file that includes them. ``$(find NAME)`` finds
    packages by name, else among the folders above the file and those of ROS.

    Args:
        file: The file.
        packages: Folders of packages, by name.

    Raises:
        ModelError: If the file has errors.
    """
    import xacro

    files: list[str] = []
    _confine(xacro, Path(file), packages, files)
    try:
        text = xacro.process_file(file, mappings={}, verbosity=0).toxml()
        return UrdfText(text, files=tuple(files))
    except MemoryError:
        raise
    except Exception as error:  # of any kind: macros evaluate expressions
        causes = tuple(_causes(error))
        for cause in causes:
            if isinstance(cause, ModelError | MemoryError):
                raise cause from None
        text, reason = _PREFIX.sub("", str(error)), str(causes[-1])
        text = text.replace(reason, "", text.count(reason) - 1) or type(causes[-1]).__name__
        problem = f"xacro refuses it ({one_line(' '.join(text.split()))})"
        source = next((name for name in reversed(xacro.filestack) if name), file)
        raise ModelError("urdf", problem, "a valid xacro file", source) from None


def _causes(error: object) -> Iterator[object]:
    """An exception of xacro and those that it wraps."""
    while error is not None:
        yield error
        error = getattr(error, "exc", None)


def _confine(xacro: Any, file: Path, packages: Mapping[str, str], files: list[str]) -> None:
    """Replace what evaluates expressions, reads files or looks around on this machine.

    Files that are read are appended to the list.
    """
    from xacro import substitution_args

    def parse(_: None, name: str) -> xml.dom.minidom.Document:
        path = Path(name)
        if not path.exists():  # xacro looks for this error where an include is optional
            xacro.filestack.pop()
            problem = f"there is no file {name}"
            raise xacro.XacroException(exc=FileNotFoundError(problem))
        files.append(os.path.abspath(path))
        return _document(path)

    def find(package: str) -> str:
        folder = packages.get(package) or find_package(package, file)
        if folder is None:
            problem = f"there is no folder of the package {package} {PACKAGES}"
            raise ModelError("urdf", problem, NAMED_PACKAGE.format(package), str(file))
        return str(folder)

    def load_yaml(name: str) -> Any:
        if not name.endswith((".yaml", ".yml")):
            raise xacro.XacroException(f"{name} is no .yaml file")
        path = xacro.abs_filename_spec(name)
        read_text(Path(path))  # refuses devices and large files
        files.append(os.path.abspath(path))
        return xacro.load_yaml(name)

    def refused(substitution: str) -> ModelError:
        problem = f"$({substitution}) is not evaluated"
        return ModelError("urdf", problem, "$(optenv NAME DEFAULT) or ${...}", xacro.filestack[-1])

    def refuse_env(name: str) -> None:
        raise refused(f"env {name}")

    def refuse_eval(text: str, context: object) -> None:
        raise refused(f"eval {text}")

    xacro.safe_eval = evaluate
    xacro.parse = parse
    substitution_args._eval_find = find
    substitution_args._eval_dirname = lambda _: str(Path(xacro.filestack[-1]).parent)
    substitution_args._eval_env = refuse_env
    substitution_args._eval = refuse_eval
    substitution_args._eval_optenv = lambda name, default="": default
    symbols = xacro._global_symbols
    for name in _REFUSED:
        symbols["python"].pop(name, None)
    symbols["load_yaml"] = symbols["xacro"]["load_yaml"] = load_yaml


def _document(path: Path) -> xml.dom.minidom.Document:
    """An XML file; entities could expand without bound, or read other files."""
    try:
        text = read_text(path)
    except ValueError as error:
        raise ModelError("urdf", str(error), "a readable xacro file", str(path)) from None
    declaration = text.find("<!DOCTYPE")
    if declaration >= 0:
        line = text.count("\n", 0, declaration) + 1
        raise ModelError("urdf", "it declares a DTD", "XML without <!DOCTYPE>", str(path), line)
    return xml.dom.minidom.parseString(text)
