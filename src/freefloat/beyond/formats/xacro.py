"""URDF text of xacro files; runs in a process of its own.

A xacro file is a program in a small language; it may read XML and YAML files, and nothing else. Its
expressions are evaluated by :mod:`~freefloat.beyond.formats.xacro_expressions`, and the functions
that can be called are xacro's. What evaluates, reads files or looks around is replaced. The names
that are replaced are private to xacro. A release that has not all of them, or calls something else,
would not be confined; so every name has to take effect before a file is read.
"""

from __future__ import annotations

import os
import re
import xml.dom.minidom
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from freefloat.beyond.formats.xacro_expressions import evaluate
from freefloat.errors import ModelError, did_you_mean, one_line
from freefloat.robot.named_files import read_text
from freefloat.robot.reader_process import Argument, UrdfText
from freefloat.robot.source import NAMED_PACKAGE, PACKAGES, find_package

_PREFIX = re.compile(r"<class '[^']*'>: ")
"""Name of an exception's class in messages of xacro."""
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


class _Arguments(dict[str, str]):
    """Values of arguments by name, and which of them the files declare or use."""

    def __init__(self, given: Mapping[str, str]) -> None:
        super().__init__(given)
        self.given = frozenset(given)
        self.known: dict[str, None] = {}

    def __getitem__(self, name: str) -> str:
        self.known[name] = None
        return super().__getitem__(name)

    def declare(self, document: xml.dom.minidom.Document) -> None:
        """Note the arguments that a document declares.

        Those without a default get one that fails where it is needed: xacro demands a default.
        """
        for element in document.getElementsByTagName("xacro:arg"):
            name = element.getAttribute("name")
            self.known[name] = None
            if not element.hasAttribute("default"):
                element.setAttribute("default", f"$(arg {name})")

    def require_known(self, source: str) -> None:
        """Raise a ModelError if one was given that no file declares or uses."""
        for name in sorted(self.given - set(self.known)):
            problem = f"the file has no argument {name!r}{did_you_mean(name, self.known)}"
            accepted = ", ".join(self.known) or "nothing: the file declares no argument"
            raise ModelError(f"arguments.{name}", problem, accepted, source)

    def used(self) -> tuple[Argument, ...]:
        """The arguments with the values that were used."""
        return tuple(Argument(name, self.get(name, ""), name not in self.given)
                     for name in self.known if name in self)  # fmt: skip


def read(
    file: str, packages: Mapping[str, str], arguments: Mapping[str, str] | None = None
) -> UrdfText:
    """The URDF that a xacro file makes.

    Files that it includes are relative to the file that includes them. ``$(find NAME)`` finds
    packages by name, else among the folders above the file and the folders of ROS.

    Args:
        file: The file.
        packages: Folders of packages, by name.
        arguments: Values of its arguments by name; others have their defaults.

    Raises:
        ModelError: If the file has errors, an argument without a default has no value, one is given
            that it does not have, or this release of xacro cannot be confined.
    """
    import xacro

    require_confinable(xacro)
    files: list[str] = []
    values = _Arguments(arguments or {})
    confine(xacro, _functions(xacro, Path(file), packages, files, values))
    try:
        text = xacro.process_file(file, mappings=values, verbosity=0).toxml()
    except MemoryError:
        raise
    except Exception as error:  # of any kind: macros evaluate expressions
        source = next((name for name in reversed(xacro.filestack) if name), file)
        raise _refusal(error, source) from None
    values.require_known(file)
    return UrdfText(text, files=tuple(files), arguments=values.used())


def _refusal(error: Exception, source: str) -> BaseException:
    """The error of a file in place of one of xacro."""
    causes = tuple(_causes(error))
    for cause in causes:
        if isinstance(cause, ModelError | MemoryError):
            return cause
        if type(cause).__name__ == "ArgException":
            name = str(cause)
            accepted = f"--xacro {name}=VALUE (robot.arguments in a scenario)"
            problem = "this argument of the xacro file has neither a value nor a default"
            return ModelError(f"arguments.{name}", problem, accepted, source)
    text, reason = _PREFIX.sub("", str(error)), str(causes[-1])
    text = text.replace(reason, "", text.count(reason) - 1) or type(causes[-1]).__name__
    problem = f"xacro refuses it ({one_line(' '.join(text.split()))})"
    return ModelError("urdf", problem, "a valid xacro file", source)


def _causes(error: object) -> Iterator[object]:
    """An exception of xacro and those that it wraps."""
    while error is not None:
        yield error
        error = getattr(error, "exc", None)


def _functions(
    xacro: Any, file: Path, packages: Mapping[str, str], files: list[str], values: _Arguments
) -> dict[str, Any]:
    """What takes the place of xacro's functions, by name.

    Files that are read are appended to the list; arguments that they declare are noted.
    """

    def parse(_: None, name: str) -> xml.dom.minidom.Document:
        path = Path(name)
        if not path.exists():  # xacro looks for this error where an include is optional
            xacro.filestack.pop()
            problem = f"there is no file {name}"
            raise xacro.XacroException(exc=FileNotFoundError(problem))
        files.append(os.path.abspath(path))
        document = _document(path)
        values.declare(document)
        return document

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

    def refuse(substitution: str) -> None:
        problem = f"$({substitution}) is not evaluated"
        raise ModelError("urdf", problem, "$(optenv NAME DEFAULT) or ${...}", xacro.filestack[-1])

    return {
        "safe_eval": evaluate,
        "parse": parse,
        "load_yaml": load_yaml,
        "_eval_find": find,
        "_eval_dirname": lambda _: str(Path(xacro.filestack[-1]).parent),
        "_eval_env": lambda name: refuse(f"env {name}"),
        "_eval_optenv": lambda name, default="": default,
        "_eval": lambda text, _: refuse(f"eval {text}"),
    }


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


def confine(xacro: Any, functions: Mapping[str, Callable[..., Any]]) -> None:
    """Replace functions of the library by others of the same names."""
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
