"""Validation of a URDF: a table of rules, errors first."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from freefloat.errors import ModelError
from freefloat.robot.description import MOVING, Joint, RobotDescription, Severity, UrdfDiagnostic
from freefloat.robot.flat_links import with_flat_links
from freefloat.robot.free_base import (
    FREE,
    base_joint_problem,
    held_joint,
    solid_link,
    virtual_joints,
)
from freefloat.robot.plausibility import (
    WARNINGS,
    Fault,
    Faults,
    inertia_sizes,
    root_masses,
    unusable_meshes,
)
from freefloat.robot.source import URDF_TEXT, RobotSource
from freefloat.robot.urdf import parse_urdf

Rule = Callable[[RobotDescription], Faults]
_TREE = "one root link, every other link the child of exactly one joint, unique names"
_GIMBALS = 2
"""Most revolute joints in a row on links without mass that are no virtual base."""


def read_urdf(
    urdf: str | Path | RobotSource, mounted: bool = False, attached: bool = False
) -> RobotDescription:
    """A valid URDF with its warnings.

    Args:
        urdf: A file, XML text (recognized by its leading ``<``), or a source.
        mounted: Whether it may have no mass: an arm for a spacecraft, or a body of a scene.
        attached: Whether it is fixed to another robot: it may have no mass, its root any mass.

    Raises:
        ModelError: If the file cannot be read or is not the XML of a robot; else the first error.
    """
    robot = parse_urdf(urdf)
    diagnostics = _diagnostics(robot, mounted, attached)
    errors = [entry for entry in diagnostics if entry.severity is Severity.ERROR]
    if errors:
        first, more = errors[0].exception(), len(errors) - 1
        if more:
            others = f"{more} more error{'s' if more > 1 else ''}"
            others += "" if robot.source == URDF_TEXT else ": freefloat info"
            remedy = f"{first.accepted} ({others})"
            raise ModelError(first.key, first.problem, remedy, first.source, first.line)
        raise first
    return replace(with_flat_links(robot), diagnostics=diagnostics)


def examine(
    urdf: str | Path | RobotSource, mounted: bool = False, attached: bool = False
) -> tuple[UrdfDiagnostic, ...]:
    """All errors and warnings about a URDF, also where it cannot be loaded.

    Args:
        urdf: A file, XML text or a source.
        mounted: As for :func:`read_urdf`.
        attached: As for :func:`read_urdf`.

    Returns:
        Errors, causes before consequences, then warnings by line, also about mesh files.

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
    return _diagnostics(robot, mounted, attached, unusable_meshes)


def part_warnings(robot: RobotDescription, links: Collection[str]) -> tuple[UrdfDiagnostic, ...]:
    """Warnings about the masses of links that an assembly adds."""
    faults = inertia_sizes(robot, links)
    return tuple(_diagnostic(Severity.WARNING, robot, fault) for fault in faults)


def _diagnostic(severity: Severity, robot: RobotDescription, fault: Fault) -> UrdfDiagnostic:
    element = f"{fault.element.tag} {fault.element.name}".strip()
    line = fault.line or None
    return UrdfDiagnostic(severity, robot.source, line, element, fault.problem, fault.remedy)


def _diagnostics(
    robot: RobotDescription, mounted: bool, attached: bool, *more: Rule
) -> tuple[UrdfDiagnostic, ...]:
    """Errors of the decoder and of the rules in their order, then warnings by line."""
    carried = mounted or attached
    errors: tuple[Rule, ...] = (*_ERRORS, partial(_virtual_base, mounted=carried))
    warnings: tuple[Rule, ...] = (*WARNINGS, *more)
    if not carried:
        errors += (_total_mass,)
    if not attached:
        warnings += (partial(root_masses, mounted=mounted),)
    diagnostics = list(robot.diagnostics)
    for severity, rules in ((Severity.ERROR, errors), (Severity.WARNING, warnings)):
        faults = (fault for rule in rules for fault in rule(robot))
        diagnostics += [_diagnostic(severity, robot, fault) for fault in faults]
    first = [entry for entry in diagnostics if entry.severity is Severity.ERROR]
    last = [entry for entry in diagnostics if entry.severity is Severity.WARNING]
    return (*first, *sorted(last, key=lambda entry: entry.line or 0))


def _names(robot: RobotDescription) -> Faults:
    for group in (robot.links, robot.joints):
        seen: dict[str, int] = {}
        for entry in group:
            if not entry.name:
                yield Fault(entry, entry.tag, f"a <{entry.tag}> without a name", _TREE)
            elif not entry.name.isprintable():
                problem = f"the name {entry.name!r} has characters that are not printed"
                yield Fault(entry, entry.tag, problem, "a name of letters, digits and _")
            elif entry.name in seen:
                line = seen[entry.name]
                problem = "the name is already used" + (f" on line {line}" if line else "")
                yield Fault(entry, entry.tag, problem, _TREE)
            seen.setdefault(entry.name, entry.lines[entry.tag])


def _ends(robot: RobotDescription) -> Faults:
    for joint in robot.joints:
        for tag, name in (("parent", joint.parent), ("child", joint.child)):
            if name not in robot.links_by_name:
                given = f"its {tag} link is {name}, and there is no such link"
                problem = given if name else f"it has no {tag} link"
                known = ", ".join(robot.links_by_name)
                yield Fault(joint, tag, problem, f'<{tag} link=".."/> with one of {known}')
        first = robot.parent_joints[joint.child]
        if joint is not first and joint.child in robot.links_by_name:
            problem = f"its child {joint.child} is the child of {first.name}, too"
            yield Fault(joint, "child", problem, _TREE)


def _tree(robot: RobotDescription) -> Faults:
    parents = {link: joint.parent for link, joint in robot.parent_joints.items()}
    sizes = dict.fromkeys(robot.roots, 0)
    reported: set[str] = set()
    for link in robot.links_by_name:
        path = [link]
        while (above := parents.get(path[-1])) is not None and above not in path:
            path.append(above)
        if path[-1] in sizes:
            sizes[path[-1]] += 1
        elif above == link and link not in reported:
            reported |= set(path)
            problem = f"its links form a cycle: {' <- '.join([*path, link])}"
            yield Fault(robot.links_by_name[link], "link", problem, _TREE)
    main = max(sizes, key=lambda root: sizes[root], default=None)
    for root in robot.roots:
        if root != main:
            problem = f"it is a root link besides {main}: no joint carries it"
            yield Fault(robot.links_by_name[root], "link", problem, _TREE)


def _joints(robot: RobotDescription) -> Faults:
    for joint in robot.joints:
        if not joint.moving:
            if joint.type != "fixed":
                yield Fault(joint, "joint", *_refused_type(robot, joint))
            continue
        rated = {key: getattr(joint, key) for key in ("effort", "velocity", "acceleration", "jerk")}
        for key, value in rated.items():
            if value is not None and value < 0.0:
                problem = f'its <limit {key}="{value:g}"> is negative'
                yield Fault(joint, "limit", problem, "zero or more")
        if joint.armature < 0.0:
            problem = f'its <dynamics armature="{joint.armature:g}"> is negative'
            yield Fault(joint, "dynamics", problem, "zero or more")
        if np.linalg.norm(joint.axis) == 0.0:  # also for 1e-200, which underflows
            yield Fault(joint, "axis", "its <axis> has no direction", 'xyz="0 0 1"')


def _mimics(robot: RobotDescription) -> Faults:
    """Faults of joints that follow themselves."""
    for joint in robot.joints:
        leader, followers = joint, set[str]()
        while leader.mimic is not None and leader.name not in followers:
            followers.add(leader.name)
            leader = robot.joints_by_name[leader.mimic.joint]
        if joint.mimic is not None and leader.mimic is not None:
            problem = f"it mimics {joint.mimic.joint}, and so itself"
            yield Fault(joint, "mimic", problem, "a joint that does not follow it")


def _refused_type(robot: RobotDescription, joint: Joint) -> tuple[str, str]:
    """Why a joint of a type that does not move is refused, and what is accepted."""
    types = f"{', '.join(MOVING)} or fixed"
    if joint.type in ("floating", "planar"):
        problem = f"its type is {joint.type}, and {base_joint_problem(robot, joint)}"
        return problem, f"{types}; {joint.type} from a massless root to the spacecraft alone"
    return f"its type is {joint.type}" if joint.type else "it has no type", types


def _virtual_base(robot: RobotDescription, mounted: bool) -> Faults:
    """A base that moves by virtual joints, six of them if it is mounted, and not as a free one."""
    joints = virtual_joints(robot)
    sliding = sum(joint.type == "prismatic" for joint in joints)
    if len(joints) == FREE or (not mounted and (sliding > 1 or len(joints) > _GIMBALS)):
        names = ", ".join(joint.name for joint in joints)
        problem = (
            f"{names} carry {joints[-1].child} on links with no or negligible mass: they are "
            "virtual joints of a base, which moves by itself"
        )
        remedy = (
            "no joint above the spacecraft; or a floating joint, or three prismatic and three "
            "revolute ones between links without mass and shapes, which mean the same; on a table "
            "a planar joint about z, or two prismatic and a revolute one"
        )
        held = held_joint(joints)
        if held is not None:
            unit = "m" if held.type == "prismatic" else "rad"
            moves = f"moves from {held.lower:g} to {held.upper:g} {unit} alone"
            problem += f"; {held.name} {f'follows {held.mimic.joint}' if held.mimic else moves}"
            remedy += ", with ranges of at least 2 m and a full turn"
        elif (solid := solid_link(robot, joints[-1].child)) is not None:
            problem += f"; {solid} has mass or shapes"
        yield Fault(held or joints[0], "joint", problem, remedy)


def _masses(robot: RobotDescription) -> Faults:
    for link in robot.links:
        if link.mass < 0.0:
            yield Fault(link, "mass", f"mass {link.mass} kg", "a mass of zero or more")


def _total_mass(robot: RobotDescription) -> Faults:
    """A robot without mass, unless the arm will be mounted on a spacecraft."""
    if not any(link.mass for link in robot.links):
        remedy = 'robot.spacecraft, or <inertial><mass value=".."/> <inertia ../></inertial>'
        yield Fault(robot, "robot", "the total mass is zero", remedy)


_ERRORS = (_names, _ends, _tree, _joints, _mimics, _masses)
