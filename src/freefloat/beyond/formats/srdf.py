"""SRDF files: pairs of links that are not compared for contact."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from freefloat.errors import ModelError, did_you_mean
from freefloat.robot.not_read import NotRead, shown_tag
from freefloat.robot.reader_process import UrdfText
from freefloat.robot.urdf_xml import PAIR, Element, root_element

_ENDS = "link1", "link2"
_MEANINGS = {
    "group": "joints for a planner; end_effector names the arm",
    "group_state": "joint values by name; robot.held and search.joints give them",
    "end_effector": "a tool of a planner; end_effector names the link that follows the path",
    "virtual_joint": "how the base moves; robot.base says it",
    "passive_joint": "a joint without drive; it is held, or moves as planned",
    "disable_default_collisions": "a link that touches nothing; disable_collisions names pairs",
    "enable_collisions": "a pair that may not touch; all pairs but those disabled are compared",
}


def add_pairs(robot: Element, read: UrdfText, source: str) -> Iterator[NotRead]:
    """Add the pairs of an SRDF file to a ``<robot>``, and yield what else the file says.

    Raises:
        ModelError: If it is no SRDF, or a pair has a link that the robot has not.
    """
    links = robot.xpath("link/@name")
    for pair in _root(read, source):
        if pair.tag != PAIR:
            yield _not_read(pair)
            continue
        for key in _ENDS:
            name, line = pair.get(key), pair.sourceline or None
            if name is None:
                accepted = f'<{PAIR} link1=".." link2=".."/>'
                raise ModelError("srdf", f"a <{PAIR}> without {key}", accepted, source, line)
            if name not in links:
                problem = f"<{PAIR}> names {name}, and the robot has no such link"
                accepted = f"links of the URDF, not of added parts{did_you_mean(name, links)}"
                raise ModelError("srdf", problem, accepted, source, line)
        etree.SubElement(robot, PAIR, {key: pair.get(key) for key in _ENDS})


def _not_read(element: Element) -> NotRead:
    """What an element says that is no pair."""
    tag = shown_tag(element)
    names = (element.get(key) for key in ("name", "link", "link1"))
    owner = next((name for name in names if name), "")
    meaning = f"SRDF: {_MEANINGS.get(tag, 'freefloat does not know it')}"
    return NotRead(f"{tag} {owner}".strip(), "", element.sourceline or None, meaning)


def _root(read: UrdfText, source: str) -> Element:
    accepted = "an SRDF file, a <robot> with <disable_collisions>"
    try:
        root = root_element(read, source)
    except ModelError as error:
        line = error.line
        raise ModelError("srdf", error.problem, accepted, error.source, line) from None
    if root.find("link") is not None:
        raise ModelError("srdf", "it is a URDF, which has links", accepted, source)
    return root
