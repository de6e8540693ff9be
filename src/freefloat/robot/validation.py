"""Errors of a URDF: what keeps the model from being loaded."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from freefloat.errors import ModelError
from freefloat.robot.diagnostics import Severity, UrdfDiagnostic
from freefloat.robot.parsing import parse_urdf
from freefloat.robot.plausibility import missing_meshes, warnings_about
from freefloat.robot.urdf import MOVING, Joint, RobotDescription

_TREE = "one root link, every other link the child of exactly one joint, unique names"
_LIMIT = '<limit lower=".." upper=".." effort=".." velocity=".."/>'


def read_urdf(urdf: str | Path, mounted: bool = False) -> RobotDescription:
    """A valid URDF with its warnings.

    Args:
        urdf: A file, or XML text (recognized by its leading ``<``).
        mounted: Whether it is an arm that will be mounted on a spacecraft.

    Raises:
        ModelError: If the file cannot be read or is not the XML of a robot; else the first error.
    """
    robot = parse_urdf(urdf)
    robot = replace(robot, diagnostics=validate(robot, mounted))
    for error in robot.errors:
        raise error.exception()
    return robot


def examine(urdf: str | Path, mounted: bool = False) -> tuple[UrdfDiagnostic, ...]:
    """All errors and warnings about a URDF, also where it cannot be loaded.

    Args:
        urdf: A file or XML text.
        mounted: Whether it is an arm that will be mounted on a spacecraft.

    Raises:
        ModelError: If there is no such file, or it is not text.
    """
    try:
        robot = parse_urdf(urdf)
    except ModelError as error:
        if error.line is None:
            raise
        return (UrdfDiagnostic(Severity.ERROR, str(error.source), error.line, error.key,
                               error.problem, error.accepted),)  # fmt: skip
    diagnostics = (*validate(robot, mounted), *missing_meshes(robot))
    return tuple(sorted(diagnostics, key=_order))


def validate(robot: RobotDescription, mounted: bool = False) -> tuple[UrdfDiagnostic, ...]:
    """Errors, causes before consequences, then warnings by line.

    Args:
        robot: As :func:`~freefloat.robot.parsing.parse_urdf` returns it.
        mounted: Whether it is an arm that will be mounted on a spacecraft.
    """
    checks = (_names(robot), _tree(robot), _cycles(robot), _joints(robot), _masses(robot))
    found = [*robot.diagnostics, *(error for errors in checks for error in errors)]
    return tuple(sorted([*found, *warnings_about(robot, mounted)], key=_order))


def _order(diagnostic: UrdfDiagnostic) -> int:
    """Errors in the order in which they were found, then warnings by line."""
    return 0 if diagnostic.severity is Severity.ERROR else 1 + diagnostic.line


def _names(robot: RobotDescription) -> Iterator[UrdfDiagnostic]:
    for group in (robot.links, robot.joints):
        seen: dict[str, int] = {}
        for one in group:
            if not one.name:
                yield robot.error(one, one.tag, f"a <{one.tag}> without a name", _TREE)
            elif one.name in seen:
                problem = f"the name is already used on line {seen[one.name]}"
                yield robot.error(one, one.tag, problem, _TREE)
            seen.setdefault(one.name, one.lines[one.tag])


def _tree(robot: RobotDescription) -> Iterator[UrdfDiagnostic]:
    for joint in robot.joints:
        for tag, name in (("parent", joint.parent), ("child", joint.child)):
            if name not in robot.link:
                problem = f"its {tag} link is {name}, and there is no such link"
                remedy = f'<{tag} link=".."/> with one of {", ".join(robot.link)}'
                yield robot.error(joint, tag, problem, remedy)
        first = robot.parent_joint[joint.child]
        if joint is not first and joint.child in robot.link:
            problem = f"its child {joint.child} is the child of {first.name}, too"
            yield robot.error(joint, "child", problem, _TREE)
    sizes = {root: len(_descendants(robot, root)) for root in robot.roots}
    main = max(sizes, key=lambda root: sizes[root], default=None)
    for root in robot.roots:
        if root != main:
            problem = f"it is a root link besides {main}: no joint carries it"
            yield robot.error(robot.link[root], "link", problem, _TREE)


def _descendants(robot: RobotDescription, root: str) -> list[str]:
    links = [root]
    for link in links:
        children = (joint.child for joint in robot.children.get(link, ()))
        links += [child for child in children if child not in links]
    return links


def _cycles(robot: RobotDescription) -> Iterator[UrdfDiagnostic]:
    parents = {link: joint.parent for link, joint in robot.parent_joint.items()}
    reported: set[str] = set()
    for link in robot.link:
        above, cycle = parents.get(link), [link]
        while above is not None and above not in cycle:
            cycle.append(above)
            above = parents.get(above)
        if above == link and link not in reported:
            reported |= set(cycle)
            problem = f"its links form a cycle: {' <- '.join([*cycle, link])}"
            yield robot.error(robot.link[link], "link", problem, _TREE)


def _joints(robot: RobotDescription) -> Iterator[UrdfDiagnostic]:
    for joint in robot.joints:
        if not joint.moving:
            if joint.type != "fixed":
                accepted = f"{', '.join(MOVING)} or fixed"
                yield robot.error(joint, "joint", f"its type is {joint.type}", accepted)
            continue
        yield from _limits(robot, joint)
        if np.linalg.norm(joint.axis) == 0.0:  # also that of 1e-200
            yield robot.error(joint, "axis", "its <axis> has no direction", 'xyz="0 0 1"')


def _limits(robot: RobotDescription, joint: Joint) -> Iterator[UrdfDiagnostic]:
    given = {"effort": joint.effort, "velocity": joint.velocity}
    missing = [key for key, value in given.items() if value is None]
    if joint.type != "continuous" and missing:
        problem = f"a {joint.type} joint without {' and '.join(missing)} in its <limit>"
        remedy = _LIMIT + ', or type="continuous"' * (joint.type == "revolute")
        yield robot.error(joint, "limit", problem, remedy)
    for key, value in given.items():
        if value is not None and value < 0.0:
            problem = f'its <limit {key}="{value:g}"> is negative'
            yield robot.error(joint, "limit", problem, "zero or more")


def _masses(robot: RobotDescription) -> Iterator[UrdfDiagnostic]:
    for link in robot.links:
        if link.mass < 0.0:
            yield robot.error(link, "mass", f"mass {link.mass} kg", "a mass of zero or more")
    if not any(link.mass for link in robot.links):
        remedy = 'links with <inertial><mass value=".."/> <inertia ../></inertial>'
        name, problem = f"robot {robot.name}".strip(), "the total mass is zero"
        yield UrdfDiagnostic(Severity.ERROR, robot.source, 1, name, problem, remedy)
