"""URDF text of xacro files."""

from __future__ import annotations

from pathlib import Path

from freefloat.errors import ModelError, one_line


def urdf_of_xacro(file: Path) -> str:
    """Text of the URDF that a xacro file makes, all arguments at their defaults.

    ``$(find NAME)`` finds packages among the folders above the file and those of ROS.

    Raises:
        ModelError: If the package for xacro is not installed, or the file has errors.
    """
    try:
        from xacrodoc import XacroDoc
    except ImportError:
        accepted = "after: pip install 'freefloat[xacro]', or a URDF"
        raise ModelError("urdf", "xacrodoc is not installed here", accepted, str(file)) from None
    try:
        document = XacroDoc.from_file(file)
        return str(document.to_urdf_string(use_protocols=True, pretty=True))
    except Exception as error:  # of any kind: macros evaluate expressions
        problem = f"xacro refuses it ({one_line(str(error) or type(error).__name__)})"
        raise ModelError("urdf", problem, "a valid xacro file", str(file)) from None
