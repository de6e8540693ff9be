"""Limits along a motion, for people."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

Document = dict[str, Any]

_LIMITS = {
    "joint_range": "joint range [rad, m]",
    "joint_rate": "joint rate [rad/s, m/s]",
    "base_rate": "base rate [rad/s]",
    "joint_torque": "joint torque [N m, N]",
    "clearance": "clearance [m]",
}


def plain_table(*columns: str) -> Table:
    """An empty table with the headings of its columns."""
    table = Table(box=SIMPLE_HEAD, show_edge=False)
    for column in columns:
        table.add_column(column)
    return table


def limit_tables(findings: Sequence[Document]) -> list[RenderableType]:
    """Limits along a motion, each where it is nearest to being broken; nothing where none are."""
    if not findings:
        return []
    table = plain_table("limit", "worst", "allowed", "at [s]", "where", "verdict")
    for one in findings:
        table.add_row(
            Text(_LIMITS[one["limit"]]),
            "no bound" if one["worst"] is None else f"{one['worst']:.5g}",
            "any" if one["allowed"] is None else f"{one['allowed']:.5g}",
            f"{one['time']:.4f}",
            one["where"],
            Text("kept", "green") if one["kept"] else Text("broken", "red"),
        )
    lines = [f"  not looked at: {note}" for one in findings for note in one["notes"]]
    lines += [
        f"  inverse dynamics: a wrench of {one['base_wrench']:.1e} of the torques on the base"
        for one in findings
        if one["base_wrench"] is not None
    ]
    return [table, *(Text(line) for line in lines)]
