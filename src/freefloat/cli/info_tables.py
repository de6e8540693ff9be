"""A robot told to people: what it is made of, and what was found in its file."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence

from rich.console import RenderableType
from rich.text import Text

from freefloat.cli.limit_tables import plain_table
from freefloat.cli.tables import Document, decimals


def info_tables(document: Document) -> list[RenderableType]:
    """A robot: its bodies, its joints, what it can reach, and what was found in its file."""
    title = Text(f"{document['urdf']}: {document['total_mass']:.6g} kg")
    bodies = plain_table(
        "moved by", "mass [kg]", "range", "centre of mass [m]", "moments about it [kg m²]"
    )
    ranges = {joint["name"]: _range(joint) for joint in document["joints"]}
    for body in document["bodies"]:
        moments = [body["inertia"][k][k] for k in range(3)]
        bodies.add_row(
            body["moved_by"], f"{body['mass']:.6g}", ranges.get(body["moved_by"], ""),
            decimals(body["centre_of_mass"]), decimals(moments),
        )  # fmt: skip
    of = document["measure"]
    lines = [
        f"end-effector {document['end_effector']}, task {document['task']}, "
        f"{document['dof']} joints",
        f"barycentric lengths {decimals(document['barycentric_lengths'])} m, "
        f"reach {document['reach']:.4f} m from the centre of mass",
        f"{of['name']}: {of['definition']}; over the joint space from {document['s_min']:.6g} to "
        f"{document['s_max']:.6g} {of['unit']}",
    ]
    return [title, bodies, *(Text(line) for line in lines), *_finding_lines(document["findings"])]


def _finding_lines(findings: Sequence[Document]) -> Iterator[RenderableType]:
    """What was found in a file; what several links or joints have in common is told once."""
    alike: dict[tuple[str, str, str, str], list[Document]] = {}
    for one in findings:
        kind, _, _ = one["element"].partition(" ")
        alike.setdefault((one["severity"], kind, one["problem"], one["remedy"]), []).append(one)
    if findings:
        counts = Counter(one["severity"] for one in findings)
        told = ", ".join(f"{n} {word}{'s' * (n > 1)}" for word, n in counts.items())
        yield Text(f"{findings[0]['file']}: {told}")
    for (severity, kind, problem, remedy), ones in alike.items():
        several = "s" * (len(ones) > 1)
        where = f"line{several} {', '.join(str(one['line']) for one in ones)}"
        names = ", ".join(one["element"].removeprefix(kind).strip() for one in ones)
        style = "yellow" if severity == "warning" else ""
        yield Text(f"  {severity}, {where}, {kind}{several} {names}: {problem}", style)
        yield Text(f"    {remedy}")


def _range(joint: Document) -> str:
    if joint["lower"] is None:
        return "endless"
    if joint["type"] == "prismatic":
        return f"{joint['lower']:g} to {joint['upper']:g} m"
    return f"{math.degrees(joint['lower']):.4g}° to {math.degrees(joint['upper']):.4g}°"
