"""The same documents told to people: tables and sentences for a terminal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

Document = dict[str, Any]


def _table(title: str) -> Table:
    return Table(title=title, title_justify="left", box=SIMPLE_HEAD, show_edge=False)


def _terse(label: str) -> str:
    """``s+ e- w+`` for ``shoulder+ elbow- wrist+``; nothing for a mere number."""
    return " ".join(word[0] + word[-1] for word in label.split() if not word.isdigit())


def _numbers(values: Sequence[float], digits: int = 4) -> str:
    return " ".join(f"{value:.{digits}f}" for value in values)


def simulation_tables(document: Document, name: str) -> list[RenderableType]:
    """A simulation: the verdict on every branch, the chosen motion, its proof."""
    chosen = document["branch"]
    table = _table(f"{name}: arm branches from this attitude")
    margin = document["min_margin"]
    for column in (
        "branch",
        "joints at the start [rad, m]",
        f"least {margin['measure']}",
        "verdict",
    ):
        table.add_column(column)
    for one in document["branches"]:
        table.add_row(
            f"{one['branch']}{'*' if one['branch'] == chosen else ''} {_terse(one['label'])}",
            _numbers(one["joints"], 3),
            f"{one['min_margin']['sign'] * one['min_margin']['value']:.4g}",
            _verdict(one),
        )
    return [table, *_chosen_lines(document)]


def _verdict(one: Document) -> Text:
    margin = one["min_margin"]
    if one["singular"]:
        return Text(f"singular at {one['singular']['time']:.4f} s", "red")
    if not one["completed"]:
        return Text(f"margin used up at {one['ended_at']:.4f} s", "yellow")
    if not margin["kept"]:
        return Text(f"completes, below {margin['required']:g}", "yellow")
    return Text("completes", "green")


def _chosen_lines(document: Document) -> list[RenderableType]:
    margin, residuals = document["min_margin"], document["residuals"]
    initial, final, singular = document["initial"], document["final"], document["singular"]
    lines = [
        f"Followed: branch {document['branch']} (*). {document['ending']}",
        f"  least |{margin['measure']}| {margin['value']:.6g} at t = {margin['time']:.4f} s, "
        f"{'kept' if margin['kept'] else 'below'} the margin {margin['required']:g}",
        f"  initial attitude x y z w  {_numbers(initial['attitude'], 5)}",
        f"  final attitude   x y z w  {_numbers(final['attitude'], 5)}, t = {final['time']:.4f} s",
        f"  final joints              {_numbers(final['joints'])}",
    ]
    if singular:
        lines.append(
            f"  singular at t = {singular['time']:.4f} s, s = {singular['s']:.4f}, end-effector at "
            f"({', '.join(f'{x:.4f}' for x in singular['end_effector'])}) m"
        )
    turn = residuals["end_effector_attitude"]
    lines.append(
        f"  proof: end-effector off by {residuals['end_effector_position']:.1e} m"
        + (f" and {turn:.1e} rad" if turn is not None else "")
        + f", momentum by {residuals['momentum']:.1e} N m s"
    )
    return [Text(line) for line in lines]


def info_tables(document: Document) -> list[RenderableType]:
    """A robot: its bodies, its joints, what it can reach, and doubts."""
    bodies = _table(f"{document['urdf']}: {document['total_mass']:.6g} kg")
    for column in (
        "moved by",
        "mass [kg]",
        "range",
        "centre of mass [m]",
        "moments about it [kg m²]",
    ):
        bodies.add_column(column)
    ranges = {joint["name"]: _range(joint) for joint in document["joints"]}
    for body in document["bodies"]:
        moments = [body["inertia"][k][k] for k in range(3)]
        bodies.add_row(
            body["moved_by"], f"{body['mass']:.6g}", ranges.get(body["moved_by"], ""),
            _numbers(body["centre_of_mass"]), _numbers(moments),
        )  # fmt: skip
    of = document["measure"]
    lines = [
        f"end-effector {document['end_effector']}, task {document['task']}, "
        f"{document['dof']} joints",
        f"barycentric lengths {_numbers(document['barycentric_lengths'])} m, "
        f"reach {document['reach']:.4f} m from the centre of mass",
        f"{of['name']}: {of['definition']}; over the joint space from {document['s_min']:.6g} to "
        f"{document['s_max']:.6g} {of['unit']}",
        *(f"doubt: {warning}" for warning in document["warnings"]),
    ]
    return [bodies, *(Text(line) for line in lines)]


def _range(joint: Document) -> str:
    if joint["lower"] is None:
        return "endless"
    if joint["type"] == "prismatic":
        return f"{joint['lower']:g} to {joint['upper']:g} m"
    return f"{math.degrees(joint['lower']):.4g}° to {math.degrees(joint['upper']):.4g}°"
