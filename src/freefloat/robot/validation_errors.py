"""What a URDF must not say: with any of these no robot can be built from it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator

import numpy as np

from freefloat.robot.diagnostics import UrdfDiagnostic
from freefloat.robot.urdf_numbers import number_defects
from freefloat.robot.urdf_text import UrdfText, plain_number, plain_numbers

MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
MOVING = ("revolute", "continuous", "prismatic")
_MOST = 1000
"""Links and joints of a robot."""
_TREE = "one root link, every other link the child of exactly one joint"
_LIMIT = {"lower": "-3.14", "upper": "3.14", "effort": "100", "velocity": "1"}
"""What a limit might be, where nothing else is known."""


def defects(urdf: UrdfText) -> Iterator[UrdfDiagnostic]:
    """Every defect; causes before what follows from them."""
    if too_large(urdf):
        problem = f"it has {len(urdf.links):,} links and {len(urdf.joints):,} joints"
        yield urdf.defect(urdf.robot, urdf.robot, problem, f"at most {_MOST:,} in all")
        return
    yield from number_defects(urdf)
    yield from _inertial_defects(urdf)
    yield from _name_defects(urdf)
    yield from _tree_defects(urdf)
    for joint in urdf.joints:
        yield from _joint_defects(urdf, joint)
    yield from _mass_defects(urdf)


def too_large(urdf: UrdfText) -> bool:
    """Whether it has more links and joints than anybody would wait for."""
    return len(urdf.links) + len(urdf.joints) > _MOST


def mass_of(link: ET.Element) -> float:
    """A link's mass [kg]; zero without an inertial, NaN where it cannot be read."""
    return plain_number(link.find("inertial/mass"), "value")


def end_of(joint: ET.Element, tag: str) -> str | None:
    """The link that a joint names as its ``parent`` or ``child``."""
    element = joint.find(tag)
    return None if element is None else element.get("link")


def _inertial_defects(urdf: UrdfText) -> Iterator[UrdfDiagnostic]:
    """Half an inertial is dropped whole, without a word, by the usual parser."""
    for link in urdf.links:
        inertial = link.find("inertial")
        if inertial is None:
            continue
        for tag, names in (("mass", ("value",)), ("inertia", MOMENTS)):
            element = inertial.find(tag)
            missing = [n for n in names if element is None or n not in element.attrib]
            if missing:
                at = inertial if element is None else element
                attributes = " ".join(f'{name}=".."' for name in names)
                remedy = f"<{tag} {attributes}/> with all numbers [kg, m]"
                problem = f"its <inertial> lacks {', '.join(missing)} of <{tag}>"
                yield urdf.defect(at, link, problem, remedy)


def _name_defects(urdf: UrdfText) -> Iterator[UrdfDiagnostic]:
    for elements in (urdf.links, urdf.joints):
        seen: dict[str, int] = {}
        for element in elements:
            name = element.get("name")
            if not name:
                remedy = f'<{element.tag} name=".."> with a name of its own'
                yield urdf.defect(element, element, f"this <{element.tag}> has no name", remedy)
            elif name in seen:
                problem = f"the name is given twice, first on line {seen[name]}"
                yield urdf.defect(element, element, problem, f"{_TREE}, unique names")
            else:
                seen[name] = urdf.lines[element]


def _tree_defects(urdf: UrdfText) -> Iterator[UrdfDiagnostic]:
    """Everything but one root, every other link the child of one joint, no circle."""
    links = {str(link.get("name")): link for link in reversed(urdf.links)}
    parents: dict[str, str] = {}
    first: dict[str, str] = {}
    for joint in urdf.joints:
        for tag in ("parent", "child"):
            if end_of(joint, tag) not in links:
                at = joint.find(tag)
                problem = f"its {tag} link is {end_of(joint, tag)}, and there is no such link"
                remedy = f'<{tag} link=".."/> with one of {", ".join(reversed(links))}'
                yield urdf.defect(joint if at is None else at, joint, problem, remedy)
        child, at = str(end_of(joint, "child")), joint.find("child")
        if child in first and child in links and at is not None:
            problem = f"it is the child of two joints, {first[child]} and {joint.get('name')}"
            remedy = f"one joint: leave out {joint.get('name')}, or give it a link of its own"
            yield urdf.defect(at, links[child], problem, remedy)
        else:
            first[child] = str(joint.get("name"))
            parents[child] = str(end_of(joint, "parent"))
    yield from _circles(urdf, links, parents)
    yield from _spare_roots(urdf, links, parents)


def _circles(
    urdf: UrdfText, links: dict[str, ET.Element], parents: dict[str, str]
) -> Iterator[UrdfDiagnostic]:
    told: set[str] = set()
    for link in reversed(links):
        above, circle = parents.get(link), {link: None}  # in order
        while above is not None and above not in circle:
            circle[above] = None
            above = parents.get(above)
        if above == link and link not in told:
            told |= set(circle)
            problem = f"its links go round in a circle: {' <- '.join([*circle, link])}"
            remedy = f"{_TREE}: leave out the joint that closes the circle"
            yield urdf.defect(links[link], links[link], problem, remedy)


def _spare_roots(
    urdf: UrdfText, links: dict[str, ET.Element], parents: dict[str, str]
) -> Iterator[UrdfDiagnostic]:
    """Roots beyond the one that carries the most links."""
    carried: Counter[str] = Counter()
    for link in links:
        above, seen = link, {link}
        while above in parents and parents[above] not in seen:
            above = parents[above]
            seen.add(above)
        carried[above] += 1
    roots = [link for link in reversed(links) if link not in parents]
    main = max(roots, key=lambda root: carried[root], default=None)
    for root in roots:
        if root != main:
            problem = f"it is a root link besides {main}: no joint carries it"
            remedy = f'{_TREE}: a <joint> with <child link="{root}"/>, or leave the link out'
            yield urdf.defect(links[root], links[root], problem, remedy)


def _joint_defects(urdf: UrdfText, joint: ET.Element) -> Iterator[UrdfDiagnostic]:
    kind, limit, axis = joint.get("type"), joint.find("limit"), joint.find("axis")
    if kind not in (*MOVING, "fixed"):
        remedy = f"{', '.join(MOVING)} or fixed"
        if kind == "floating":
            remedy += f": the root link floats by itself, leave out {joint.get('name')} and"
            remedy += f" the link {end_of(joint, 'parent')} above it"
        yield urdf.defect(joint, joint, f"its type is {kind}", remedy)
    if kind in ("revolute", "prismatic"):
        missing = [n for n in ("effort", "velocity") if limit is None or n not in limit.attrib]
        if missing:
            written = {**_LIMIT, **({} if limit is None else limit.attrib)}
            numbers = " ".join(f'{name}="{value}"' for name, value in written.items())
            remedy = f"<limit {numbers}/> with the arm's numbers [rad or m, N m or N, per s]"
            remedy += ', or type="continuous" where it turns without end' * (kind == "revolute")
            at = joint if limit is None else limit
            problem = f"a {kind} joint without a <limit>"
            if limit is not None:
                problem = f"a {kind} joint whose <limit> lacks {' and '.join(missing)}"
            yield urdf.defect(at, joint, problem, remedy)
    negative = [n for n in ("effort", "velocity") if plain_number(limit, n) < 0.0]
    if kind in MOVING and limit is not None and negative:
        given = " ".join(f'{name}="{limit.get(name)}"' for name in negative)
        problem = f"its <limit {given}> is negative"
        yield urdf.defect(limit, joint, problem, "magnitudes of zero or more")
    length = 1.0 if axis is None else np.linalg.norm(plain_numbers(axis, "xyz", "1 0 0"))
    if kind != "fixed" and axis is not None and length == 0.0:  # so is that of 1e-200
        problem = f'<axis xyz="{axis.get("xyz")}"> has no direction'
        yield urdf.defect(axis, joint, problem, 'three numbers, not all zero, as in xyz="0 0 1"')


def _mass_defects(urdf: UrdfText) -> Iterator[UrdfDiagnostic]:
    masses = {link: mass_of(link) for link in urdf.links}
    for link, mass in masses.items():
        at = link.find("inertial/mass")
        if at is not None and mass < 0.0:
            yield urdf.defect(at, link, f"mass {mass} kg", "a mass of zero or more")
    if not np.any(list(masses.values())):
        remedy = 'links with <inertial><mass value=".."/> <inertia ../></inertial>'
        yield urdf.defect(urdf.robot, urdf.robot, "the total mass is zero", remedy)
