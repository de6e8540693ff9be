"""Numbers of a URDF that are none: words, expressions, too many or too few."""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Iterator

from freefloat.robot.diagnostics import UrdfDiagnostic
from freefloat.robot.urdf_text import MAGNITUDE, UrdfText, is_plain

_NUMBERS = {
    "origin": {"xyz": 3, "rpy": 3},
    "mass": {"value": 1},
    "inertia": dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), 1),
    "axis": {"xyz": 3},
    "limit": dict.fromkeys(("lower", "upper", "effort", "velocity"), 1),
    "dynamics": {"damping": 1, "friction": 1},
    "mimic": {"multiplier": 1, "offset": 1},
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "mesh": {"scale": 3},
}
"""How many numbers the attributes of each element hold."""
_WORDS = re.compile(r"\$\{[^}]*\}|[^\s,]+")
_LONGEST = 80
"""Characters of an expression that is worked out; ``-2*(pi - 0.3)/4`` has a dozen."""
_OPERATORS: dict[type[ast.AST], Callable[..., float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}


def number_defects(urdf: UrdfText) -> Iterator[UrdfDiagnostic]:
    """A defect for every attribute of a link or joint whose numbers are none."""
    for owner in (*urdf.links, *urdf.joints):
        for element in owner.iter():
            for name, count in _NUMBERS.get(element.tag, {}).items():
                given = element.get(name)
                if given is None:
                    continue
                words = given.split()
                plain = all(map(is_plain, words))
                if not plain or len(words) != count:
                    wanted = "finite number" if count == 1 else f"{count} finite numbers"
                    problem = f'<{element.tag} {name}="{given}"> is not {_article(count)}{wanted}'
                    yield urdf.defect(element, owner, problem, _remedy(name, given, count))
                elif element.tag != "limit" and max(abs(float(word)) for word in words) > MAGNITUDE:
                    problem = f'<{element.tag} {name}="{given}"> is out of all proportion'
                    yield urdf.defect(element, owner, problem, f"magnitudes up to {MAGNITUDE:g}")


def _article(count: int) -> str:
    return "a " if count == 1 else ""


def _remedy(name: str, given: str, count: int) -> str:
    values = [value_of(word) for word in _WORDS.findall(given)]
    numbers = [value for value in values if value is not None]
    here = ""
    if len(values) == len(numbers) == count:
        here = f', here {name}="{" ".join(f"{number:.17g}" for number in numbers)}"'
    xacro = "" if "$" not in given else "; xacro makes such a file a URDF"
    return f"finite numbers{here} (expressions are not evaluated{xacro})"


def value_of(expression: str) -> float | None:
    """What somebody meant by ``pi/2``, ``0.16/2`` or ``${2*pi}``; None where that is not plain."""
    inner = expression.removeprefix("${").removesuffix("}").strip()
    if len(inner) > _LONGEST or "_" in inner:
        return None
    try:
        value = _value(ast.parse(inner, mode="eval").body)
    except (SyntaxError, ValueError, ArithmeticError, RecursionError):
        return None
    return value if math.isfinite(value) else None


def _value(node: ast.AST) -> float:
    if (
        isinstance(node, ast.Constant)
        and isinstance(node.value, int | float)
        and not isinstance(node.value, bool)
    ):
        return float(node.value)
    if isinstance(node, ast.Name) and node.id in ("pi", "M_PI"):
        return math.pi
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        return _OPERATORS[type(node.op)](_value(node.left), _value(node.right))
    if isinstance(node, ast.UnaryOp) and type(node.op) in _OPERATORS:
        return _OPERATORS[type(node.op)](_value(node.operand))
    raise ValueError
