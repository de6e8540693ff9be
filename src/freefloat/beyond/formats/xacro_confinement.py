"""Confinement of the library xacro: what evaluates, reads files or looks around is replaced.

The names that are replaced are private to xacro. A release that has not all of them, or calls
something else, would not be confined; so every name has to take effect before a file is read.
"""

from __future__ import annotations

import xml.dom.minidom
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from freefloat.beyond.formats.xacro_expressions import evaluate
from freefloat.errors import ModelError, one_line

_MODULE = ("safe_eval", "parse")
"""Functions of the module xacro that are replaced."""
_SUBSTITUTIONS = ("_eval_find", "_eval_dirname", "_eval_env", "_eval_optenv", "_eval")
"""Functions of the module xacro.substitution_args that are replaced."""
_REFUSED = ("type", "vars")
"""Functions among the symbols of xacro that reach Python's classes."""
_REACHING = (
    type, vars, eval, exec, compile, open, input, getattr, setattr, delattr, globals, locals, dir,
    object, super, __import__,
)  # fmt: skip
"""Functions of Python that lead out of expressions."""
_FILES = {
    "a.xacro": """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
      <xacro:include filename="b.xacro"/><link a="${1 + 1}" b="$(find c)" c="$(dirname)"
      d="$(env e)" e="$(optenv f g)" f="$(eval 1)" g="${load_yaml('h.yaml')}"
      h="${xacro.load_yaml('i.yaml')}"/></robot>""",
    "b.xacro": "<robot/>",
}
"""Texts that use everything that is replaced."""
_CALLED = {*_MODULE[:1], *_SUBSTITUTIONS, "a.xacro", "b.xacro", "h.yaml", "i.yaml"}
"""Functions that they call, and files that are asked for."""


def confine(xacro: Any, functions: Mapping[str, Callable[..., Any]]) -> None:
    """Replace functions of the library.

    Args:
        xacro: The module.
        functions: What takes the place of ``safe_eval``, ``parse``, ``load_yaml`` and the
            substitutions, by name.
    """
    from xacro import substitution_args

    for name in _MODULE:
        setattr(xacro, name, functions[name])
    for name in _SUBSTITUTIONS:
        setattr(substitution_args, name, functions[name])
    symbols = xacro._global_symbols
    for name in _REFUSED:
        symbols["python"].pop(name, None)
    symbols["load_yaml"] = symbols["xacro"]["load_yaml"] = functions["load_yaml"]


def require_confinable(xacro: Any) -> None:
    """Raise a ModelError unless everything that is replaced takes effect in this release.

    It is replaced for that; :func:`confine` has to follow.
    """
    try:
        problem = _unconfined(xacro)
    except Exception as error:  # of any kind: names may be missing, or mean something else
        problem = f"{type(error).__name__}: {error}"
    if problem:
        problem = f"the library {xacro.__file__} cannot be confined ({problem})"
        accepted = "xacro 2.1.1, or the URDF that `xacro FILE > robot.urdf` writes"
        raise ModelError("xacro", one_line(problem), accepted)


def _unconfined(xacro: Any) -> str | None:
    """What of xacro does not call what takes its place; None where everything does."""
    called: set[str] = set()

    def substitute(name: str) -> Callable[..., str]:
        def function(*_: Any, **__: Any) -> str:
            called.add(name)
            return ""

        return function

    def parse(_: None, name: str) -> xml.dom.minidom.Document:
        called.add(Path(name).name)
        return xml.dom.minidom.parseString(_FILES[Path(name).name])

    def safe_eval(expression: str, symbols: dict[str, Any]) -> Any:
        called.add("safe_eval")
        return evaluate(expression, symbols)

    def load_yaml(name: str) -> str:
        called.add(name)
        return ""

    functions: dict[str, Any] = {name: substitute(name) for name in _SUBSTITUTIONS}
    confine(xacro, functions | {"parse": parse, "safe_eval": safe_eval, "load_yaml": load_yaml})
    xacro.process_file("a.xacro", mappings={}, verbosity=0)
    if missing := sorted(_CALLED - called):
        return f"it does not use what takes the place of {', '.join(missing)}"
    for name, value in _symbols(xacro._global_symbols):
        if any(value is function for function in _REACHING):
            return f"its expressions can call {name}"
    return None


def _symbols(symbols: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Names that expressions can use, those in namespaces, too, and their values."""
    for name, value in symbols.items():
        yield name, value
        if isinstance(value, Mapping):
            yield from _symbols(value)
