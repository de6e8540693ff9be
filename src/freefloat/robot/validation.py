"""Everything that can be told about a URDF before a robot is built from it, or cannot be."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from freefloat.errors import ModelError
from freefloat.robot.diagnostics import Severity, UrdfDiagnostic, by_severity
from freefloat.robot.meshes import MeshFileError, find_mesh
from freefloat.robot.urdf_text import UrdfText
from freefloat.robot.validation_errors import defects, too_large
from freefloat.robot.validation_warnings import doubts


def examine(urdf: str | Path, carried: bool = False) -> tuple[UrdfDiagnostic, ...]:
    """Everything that can be told about a URDF, also where it cannot be loaded.

    Args:
        urdf: A file or XML text.
        carried: Whether it is an arm to be mounted on a spacecraft.

    Returns:
        Defects, the one that loading stops at first; then doubts and notes, by line.

    Raises:
        ModelError: If there is no such file, or it is no text.
    """
    try:
        text = UrdfText.of(urdf)
    except ModelError as error:
        if error.line is None:
            raise
        return (_unreadable(error, error.line),)
    if too_large(text):
        return tuple(defects(text))
    return (*defects(text), *by_severity([*doubts(text, carried), *_missing_meshes(text)]))


def _unreadable(error: ModelError, line: int) -> UrdfDiagnostic:
    file, problem, remedy = str(error.source), error.problem, error.accepted
    return UrdfDiagnostic(Severity.DEFECT, file, line, error.key, problem, remedy)


def _missing_meshes(urdf: UrdfText) -> Iterator[UrdfDiagnostic]:
    for link in urdf.links:
        for part in ("visual", "collision"):
            for mesh in link.findall(f"{part}/geometry/mesh"):
                name = mesh.get("filename", "")
                try:
                    find_mesh(name, urdf.source)
                except MeshFileError as error:
                    problem = f"the mesh {name or 'without a filename'} of its <{part}>: {error}"
                    remedy = "put the file there, write <mesh filename=..> relative to the URDF, "
                    remedy += "or a plain shape such as <box>"
                    yield urdf.doubt(mesh, link, problem, remedy)
