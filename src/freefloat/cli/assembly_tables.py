"""A robot that was put together, told to people."""

from __future__ import annotations

from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text


def assembly_tables(document: dict[str, Any]) -> list[RenderableType]:
    """The file, the robot's mass, centre of mass and inertia, its joints, and warnings."""
    title = Text(f"{document['file']}: {document['robot']}, {document['total_mass']:.6g} kg")
    joints = Table(box=SIMPLE_HEAD, show_edge=False)
    for column in ("joint", "type", ""):
        joints.add_column(column)
    for joint in document["joints"]:
        held = f"held at {joint['held']:g}" if joint["held"] is not None else "moves"
        joints.add_row(joint["name"], joint["type"], held)
    rows = document["inertia"]
    lines = [
        f"root {document['root']}, end-effector {document['end_effector']}",
        f"centre of mass {_numbers(document['centre_of_mass'])} m in the root's frame, joints at 0",
        "inertia about it, axes of the root [kg m²]:",
        *(f"  {_numbers(row)}" for row in rows),
    ]
    if document["meshes"]:
        lines.append(f"{len(document['meshes'])} mesh files, the first {document['meshes'][0]}")
    lines += [f"warning: {warning}" for warning in document["warnings"]]
    return [title, joints, *(Text(line) for line in lines)]


def _numbers(values: list[float]) -> str:
    return " ".join(f"{value:.6g}" for value in values)
