"""Attributes of a URDF: numbers, what is wrong with them, and what its versions mean."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from freefloat.robot.description import Severity, UrdfDiagnostic
from freefloat.robot.urdf_text import Element
from freefloat.so3 import Array, frozen

MAGNITUDE = 1e12
"""Largest accepted number: squares of larger ones overflow."""
ROUNDED = 1e-3
"""Error of a unit vector or quaternion written with three digits."""
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_VERSIONS = ("1.0", "1.1", "1.2")
_CAPSULE = "1.1"
"""The version that introduced capsules, and ``quat_xyzw``."""
_IDENTITY = "0 0 0 1"


class AttributeReader:
    """Reads numbers, and collects what is wrong with elements and attributes.

    Attributes:
        diagnostics: What was collected.
    """

    def __init__(self, source: str) -> None:
        """Read for a file, which diagnostics name."""
        self.diagnostics: list[UrdfDiagnostic] = []
        self._source = source

    def number(self, element: Element, key: str) -> float:
        """The number of an attribute; zero where it is missing, NaN where it is wrong."""
        return float(self.numbers(element, key, "0")[0])

    def numbers(self, element: Element, key: str, default: str) -> Array:
        """The numbers of an attribute, as many as the default has; NaN where they are wrong."""
        text = default if element is None else element.get(key, default)
        words = text.split()
        count = len(default.split())
        accepted = "a finite number" if count == 1 else f"{count} finite numbers"
        if len(words) == count and are_numbers(words):
            values = frozen([float(word) for word in words])
            if np.abs(values).max() <= MAGNITUDE or element.tag == "limit":
                return values
            accepted += f" of at most {MAGNITUDE:g}"
        problem = f'<{element.tag} {key}="{text}"> is not {accepted}'
        remedy = f"{accepted}; expressions are not evaluated"
        self.report(Severity.ERROR, element, problem, remedy)
        return np.full(count, np.nan)

    def report(self, severity: Severity, element: Element, problem: str, remedy: str) -> None:
        """Collect a diagnostic about the link or joint that an element belongs to."""
        owner = element
        while owner.getparent() is not None and owner.getparent().tag != "robot":
            owner = owner.getparent()
        name = f"{owner.tag} {owner.get('name', '')}".strip()
        line = element.sourceline
        self.diagnostics.append(UrdfDiagnostic(severity, self._source, line, name, problem, remedy))


def text_of(values: npt.ArrayLike) -> str:
    """Numbers as the text of an attribute, with all digits."""
    return " ".join(map(repr, np.ravel(values).tolist()))


def are_numbers(words: Sequence[str]) -> bool:
    """Whether all words are finite decimal numbers."""
    return all(_NUMBER.fullmatch(word) and math.isfinite(float(word)) for word in words)


def require_version(robot: Element, version: str) -> None:
    """Set the version of a ``<robot>`` element unless it is that or a later one."""
    if robot.get("version", _VERSIONS[0]) < version:
        robot.set("version", version)


def read_version(robot: Element, reader: AttributeReader) -> None:
    """Write ``quat_xyzw`` as ``rpy``, and a version that other readers accept with the rest."""
    version = robot.get("version", _VERSIONS[0])
    if version not in _VERSIONS:
        problem = f"its version is {version!r}, and is read as {_VERSIONS[-1]}"
        reader.report(Severity.WARNING, robot, problem, f"one of {', '.join(_VERSIONS)}")
        version = _VERSIONS[-1]
        robot.set("version", version)
    for origin in robot.iterfind(".//origin[@quat_xyzw]"):
        if version < _CAPSULE:
            problem = f"quat_xyzw of its <origin> is not read: it is new in URDF {_CAPSULE}"
            taken = "rpy" if "rpy" in origin.attrib else "no rotation"
            remedy = f'rpy, or <robot version="{_CAPSULE}">; as other readers do, {taken} is taken'
            reader.report(Severity.WARNING, origin, problem, remedy)
        else:
            _write_angles(origin, reader)
        del origin.attrib["quat_xyzw"]
    for capsule in robot.iterfind("link/*/geometry/capsule"):
        if version < _CAPSULE:
            problem = f"<capsule> is new in URDF {_CAPSULE}; other readers refuse it here"
            reader.report(Severity.WARNING, capsule, problem, f'<robot version="{_CAPSULE}">')
        require_version(robot, _CAPSULE)


def _write_angles(origin: Element, reader: AttributeReader) -> None:
    """Write the rotation of an ``<origin>`` as roll, pitch and yaw."""
    text = origin.get("quat_xyzw")
    if "rpy" in origin.attrib:
        problem = "its <origin> has both rpy and quat_xyzw"
        reader.report(Severity.ERROR, origin, problem, "one of them")
        return
    quaternion = reader.numbers(origin, "quat_xyzw", _IDENTITY)
    if not np.isfinite(quaternion).all():
        return
    norm = float(np.linalg.norm(quaternion))
    if norm < ROUNDED:
        problem = f'<origin quat_xyzw="{text}"> is no rotation'
        reader.report(Severity.ERROR, origin, problem, f'x y z w, such as "{_IDENTITY}" for none')
        return
    unit = quaternion / norm
    if abs(norm - 1.0) > ROUNDED:
        problem = f'<origin quat_xyzw="{text}"> has norm {norm:.6g}; only its direction is used'
        shown = " ".join(f"{value:.9g}" for value in unit + 0.0)
        reader.report(Severity.WARNING, origin, problem, f'quat_xyzw="{shown}"')
    angles = pin.rpy.matrixToRpy(pin.Quaternion(unit).matrix())
    origin.set("rpy", text_of(angles))
