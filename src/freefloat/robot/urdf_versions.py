"""URDF 1.1 and 1.2 as URDF that every reader understands: quaternions become angles."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from freefloat.robot.description import Severity
from freefloat.robot.urdf_numbers import ROUNDED, AttributeReader, text_of
from freefloat.robot.urdf_text import Element

_VERSIONS = ("1.0", "1.1", "1.2")
_CAPSULE = "1.1"
"""The version that introduced capsules, and ``quat_xyzw``."""
_IDENTITY = "0 0 0 1"


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
