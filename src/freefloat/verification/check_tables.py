"""The verdict on a saved plan, for people."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import RenderableType
from rich.text import Text

from freefloat.cli.limit_tables import Document, plain_table


def check_tables(document: Document) -> Sequence[RenderableType]:
    """Every check with what was found and what is allowed; then what failed, and where."""
    table = plain_table("checked", "found", "allowed", "at [s]", "verdict", "")
    for one in document["checks"]:
        table.add_row(
            Text(one["name"]),
            _number(one["found"]) + (f" {one['unit']}" if one["unit"] else ""),
            _number(one["allowed"]),
            "" if one["time"] is None else f"{one['time']:.4f}",
            Text("holds", "green") if one["passed"] else Text("fails", "red"),
            Text(one["told"] if one["passed"] else ""),
        )
    lines: list[RenderableType] = [table]
    proof = document["certificate"]
    if proof is not None:
        lines.append(Text(f"Between points: {proof['method']} ({proof['intervals']:,} of them)."))
        lines.append(Text(f"Integrated again: {proof['integrator']}."))
    if document["proved"]:
        return [*lines, Text(f"{document['file']}: proved again.", "green")]
    failed = [Text(f"  {reason}", "red") for reason in document["reasons"]]
    return [*lines, Text(f"{document['file']}: not proved.", "red"), *failed]


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"
