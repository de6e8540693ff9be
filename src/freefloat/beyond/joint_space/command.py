"""``freefloat singularities``: where in its joint space an arm is singular."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from rich.console import RenderableType

from freefloat.cli.console import Console, decimals, table
from freefloat.cli.delivery import Delivery
from freefloat.cli.options import Json, Plots, Quiet, ResultFile, option
from freefloat.cli.robots import (
    EndEffector,
    FileOptions,
    Packages,
    RobotName,
    Root,
    Xacro,
    load_robot,
)
from freefloat.errors import InputError, finite_number
from freefloat.ik.numbering import short_label

if TYPE_CHECKING:
    from freefloat.beyond.joint_space.components import SingularityComponents
    from freefloat.beyond.joint_space.singularity_map import SingularityMap
    from freefloat.singularities.global_maximum import GlobalMaximum

_KINDS = {
    "positive": "free of singularities, det A > 0",
    "negative": "free of singularities, det A < 0",
    "singular": "boxes with a singular configuration",
    "undecided": "undecided boxes",
}
_REDUNDANT = {
    "positive": "free of singularities, det(S* S*ᵀ) > 0",
    "undecided": "undecided boxes, where it may vanish",
}
"""Kinds for redundant arms: the determinant is never negative, so that no sign proves a zero."""
_Resolution = Annotated[float | None, option(
    "DEG", "Width down to which boxes are cut; default 0.1 where det A depends on two joints, "
    "1 for three, 5 for four, 15 for more.",
)]  # fmt: skip
_Fix = Annotated[list[str] | None, option(
    "JOINT=Q", "Map the slice with this value of a joint, rad or m, which still moves; may be "
    "repeated. robot.held of a scenario locks a joint.",
)]  # fmt: skip
_Page = Annotated[Path | None, option("FILE", "Write a page with the surface det A = 0.", "--html")]


def singularities(
    robot: RobotName,
    end_effector: EndEffector = None,
    root: Root = None,
    package: Packages = None,
    xacro: Xacro = None,
    resolution: _Resolution = None,
    fix: _Fix = None,
    output: ResultFile = None,
    html: _Page = None,
    plots: Plots = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Map the joint space: boxes certified to be free of dynamic singularities, and the others.

    Det A of (5) is a polynomial of the sines and cosines of the joints; its bounds certify boxes.
    Configurations of a component can be reached from each other without a singularity.

    Example: freefloat singularities planar_3dof

    Example: freefloat singularities ets_vii --fix q1=0 --resolution 6 --plots figures
    """
    from freefloat.beyond.joint_space.components import singularity_components
    from freefloat.beyond.joint_space.singularity_map import singularity_map
    from freefloat.singularities.global_maximum import guaranteed_magnitude

    console = Console(as_json, quiet)
    loaded = load_robot(console, robot, end_effector, FileOptions(root, package, xacro))
    model, task, measure = loaded.model, loaded.task, loaded.measure
    delivery = Delivery(console, output, html, plots)
    delivery.prepare()
    width = None
    if resolution is not None:
        accepted = "0.0001 to 180, in degrees"
        width = math.radians(finite_number("resolution", resolution, accepted, 1e-4, 180.0))
    began = time.perf_counter()
    with console.progress("dividing the joint space") as progress:
        found = singularity_map(model, task, width, fixed=_fixed(fix or ()), progress=progress)
    with console.progress("joining boxes"):
        components = singularity_components(found)
        whole = model.dof == len(task.rows) and not fix
        names = ("system", *(["gjm"] if measure.name == "gjm" else [])) if whole else ()
        largest = {name: guaranteed_magnitude(model, task, name) for name in names}
    seconds = time.perf_counter() - began
    document = {
        "robot": robot,
        **found.to_dict(),
        "components": components.to_dict(),
        "largest": {
            name: {
                "value": maximum.value,
                "upper_bound": maximum.upper_bound if math.isfinite(maximum.upper_bound) else None,
            }
            for name, maximum in largest.items()
        },
        "seconds": seconds,
    }
    tables = _tables(robot, found, components, largest, seconds)
    delivery.deliver(found, tables, robot, document=document)


def _fixed(options: Sequence[str]) -> dict[str, float]:
    """Values of joints from options such as ``q1=0.5``."""
    values: dict[str, float] = {}
    for text in options:
        name, _, value = text.partition("=")
        try:
            if name in values:
                raise ValueError
            values[name] = float(value)
        except ValueError:
            accepted = "a joint and its only value: q1=0.5"
            raise InputError("fix", f"{text!r} was given", accepted) from None
    return values


def _tables(
    name: str,
    found: SingularityMap,
    components: SingularityComponents,
    largest: dict[str, GlobalMaximum],
    seconds: float,
) -> Iterator[RenderableType]:
    names = [found.model.joint_names[joint] for joint in found.joints]
    redundant = found.model.dof > len(found.task.rows)
    determinant = "det(S* S*ᵀ)" if redundant else "det A"
    polynomial = found.polynomial
    yield (
        f"{name}, task {found.task}: {determinant} depends on {', '.join(names) or 'no joint'}; "
        f"{polynomial.coefficients.size:,} coefficients, residual {polynomial.residual:.1g}"
    )
    volumes = table("joint space", "[%]")
    for kind, volume in found.volumes.items():
        rows = _REDUNDANT if redundant else _KINDS
        if kind.name.lower() in rows:
            volumes.add_row(rows[kind.name.lower()], f"{100.0 * volume:.3f}")
    yield volumes
    yield f"{found.boxes:,} boxes, down to {math.degrees(found.resolution):.4g} deg"
    columns = ["component", "det A", "[%]"]
    if any(part.branches for part in components.components):
        columns.append("arm branches of random poses")
    listed = table(*columns)
    for number, part in enumerate(components.components):
        branches = sorted(part.branches.items(), key=lambda item: -item[1])
        words = ", ".join(f"{short_label(label) or label} {count}" for label, count in branches)
        entries = str(number), "+" if part.sign > 0 else "-", f"{100.0 * part.volume:.3f}", words
        listed.add_row(*entries[: len(columns)])
    if components.components:
        yield listed
    for measure, maximum in largest.items():
        where = decimals(maximum.joints)
        word = "det A" if measure == "system" else "det S*"
        proof = "not proven: it takes too many boxes"
        if math.isfinite(maximum.upper_bound):
            gap = maximum.upper_bound / maximum.value - 1.0
            proof = f"no configuration exceeds it by more than {gap:.1g} of it"
        yield f"largest |{word}|: {maximum.value:.8g} at joints {where}; {proof}"
    yield f"{seconds:.1f} s"
