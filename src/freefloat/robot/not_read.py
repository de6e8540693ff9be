"""What a robot file says and freefloat does not use."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from freefloat.errors import did_you_mean


@dataclass(frozen=True)
class NotRead:
    """An element or attribute of a robot file that carries physics, geometry or a limit, unused.

    Attributes:
        element: The element and the link, joint or body that it belongs to, as in
            ``"dynamics of joint elbow"``; ``"joint elbow"`` for the joint itself.
        attribute: The attribute, as in ``"damping"``; empty where the whole element is meant.
        line: Line of the element, counted from 1; None where it is not known.
        meaning: What it means and what freefloat does instead, a phrase.
    """

    element: str
    attribute: str
    line: int | None
    meaning: str


_GAIN = "a gain of a joint controller; motions have no controller"
_SOFT = "an end of the range for a controller; the range of <limit> is kept"
_CONTACT = "contact forces; motions have no contact"
_DRIVE = "gears and motors; joints move as planned"
_SENSOR = "a sensor; none is modelled"
_ABOVE = "a limit that freefloat does not use"
_MEANINGS = {
    ("dynamics", "damping"): "viscous friction of the joint; joints have no friction",
    ("dynamics", "friction"): "Coulomb friction of the joint; joints have no friction",
    ("limit", "deceleration"): _ABOVE,
    ("safety_controller", "soft_lower_limit"): _SOFT,
    ("safety_controller", "soft_upper_limit"): _SOFT,
    ("safety_controller", "k_position"): _GAIN,
    ("safety_controller", "k_velocity"): _GAIN,
    ("calibration", ""): "where a joint switch is; joint values are exact",
    ("transmission", ""): _DRIVE,
    ("ros2_control", ""): _DRIVE,
    ("sensor", ""): _SENSOR,
    ("gazebo", ""): "settings of the simulator Gazebo; none is used",
    ("contact", ""): _CONTACT,
    ("surface", ""): _CONTACT,
}
"""What elements mean that are not read, by tag and attribute; empty for the whole element."""
_SOLIDS = ("box", "capsule", "cylinder", "sphere")
SHAPES = (*_SOLIDS, "mesh")
"""Elements of which a ``<geometry>`` has one."""
_READ: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "robot": (("name", "version"), ("link", "joint", "disable_collisions")),
    "disable_collisions": (("link1", "link2", "reason"), ()),
    "link": (("name", "type"), ("inertial", "visual", "collision")),
    "inertial": ((), ("origin", "mass", "inertia")),
    "visual": (("name",), ("origin", "geometry")),
    "collision": (("name", "group"), ("origin", "geometry")),
    "geometry": (("name",), SHAPES),
    "joint": (
        ("name", "type"),
        ("parent", "child", "origin", "axis", "limit", "dynamics", "mimic"),
    ),
    "mimic": (("joint", "multiplier", "offset"), ()),
    "dynamics": (("armature", "damping", "friction"), ()),
    "origin": (("xyz", "rpy", "quat_xyzw"), ()),
    "mass": (("value",), ()),
    "inertia": (("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), ()),
    "parent": (("link",), ()),
    "child": (("link",), ()),
    "axis": (("xyz",), ()),
    "limit": (("lower", "upper", "effort", "velocity", "acceleration", "jerk"), ()),
    "box": (("size",), ()),
    "capsule": (("radius", "length"), ()),
    "cylinder": (("radius", "length"), ()),
    "sphere": (("radius",), ()),
    "mesh": (("filename", "scale"), ()),
}
"""Attributes and elements that are read, by the tag of the element that has them."""
_SHAPED = ("visual", "collision")
_SEVERAL = ("link", "joint", "disable_collisions", *_SHAPED)
"""Elements of which all are read, and not the first alone."""
_WITHOUT_PHYSICS = ("material", "verbose", "dont_collapse")
"""Elements and attributes of pictures and programs."""
_OF_MOTION = ("axis", "limit", "dynamics", "safety_controller", "calibration", "mimic")
"""Elements that mean nothing in a fixed joint."""
_FIRST = "1.0"
"""Version of URDF of a file that states none."""
_SCHEMA = "{http://www.w3.org/2001/XMLSchema-instance}"
"""Namespace of what a schema says about a file."""


def what_is_not_read(robot: Any) -> Iterator[NotRead]:
    """What a ``<robot>`` element says and freefloat does not use, in the order of the file.

    That is every attribute and element that carries physics, geometry or a limit, also if it is
    misspelt or given twice. Materials, and elements of motion in fixed joints, carry none.
    """
    yield from _of_element(robot)


def _of_element(element: Any) -> Iterator[NotRead]:
    """Attributes and children of an element that are not read."""
    attributes, children = _READ[element.tag]
    for key, value in element.attrib.items():
        if key in attributes:
            meaning = _unused_value(element, key, value)
        elif key in _WITHOUT_PHYSICS or key.startswith(_SCHEMA):
            continue
        else:
            meaning = _MEANINGS.get((element.tag, key), _unknown(key, attributes))
        if meaning:
            yield _entry(element, key, meaning)
    yield from _of_text(element)
    if (element.tag in _SHAPED and element.find("geometry") is None) or (
        element.tag == "geometry" and _draws_alone(element)
    ):
        yield _entry(element, "", "it has no shape")
    if element.tag in _SOLIDS:
        for key in attributes:
            if key not in element.attrib:
                yield _entry(element, key, "it is missing; the shape is left out")
    fixed = element.tag == "joint" and element.get("type") == "fixed"
    seen: set[str] = set()
    for child in element:
        kind = "shape" if child.tag in SHAPES else child.tag
        if child.tag in _WITHOUT_PHYSICS or (fixed and child.tag in _OF_MOTION):
            continue
        if child.tag not in children:
            yield from _of_other(child, children)
        elif kind in seen and kind not in _SEVERAL:
            yield _entry(child, "", f"a second {kind}; the first counts")
        else:
            yield from _of_element(child)
        seen.add(kind)


def _of_other(element: Any, known: tuple[str, ...]) -> Iterator[NotRead]:
    """What an element says that is not read at all: as a whole, or attribute by attribute."""
    tag = element.tag
    says = {*element.attrib} - {"reference"} or any(_of_text(element))
    if tag == "gazebo" and not says and _draws_alone(element):
        return
    if any(name == tag and key for name, key in _MEANINGS):
        for key, value in element.attrib.items():
            if not _is_zero(value):
                yield _entry(element, key, _MEANINGS.get((tag, key)) or _unknown(key, ()))
        yield from _of_text(element)
        for child in element:
            yield from _of_other(child, ())
        return
    yield _entry(element, "", _MEANINGS.get((tag, "")) or _unknown(tag, known))


def _draws_alone(element: Any) -> bool:
    """Whether no element in an element carries physics."""
    return all(child.tag in _WITHOUT_PHYSICS for child in element)


def _of_text(element: Any) -> Iterator[NotRead]:
    """Text of an element, before, between or behind the elements in it."""
    if any((text or "").strip() for text in (element.text, *(child.tail for child in element))):
        yield _entry(element, "", "text in place of attributes")


def _unused_value(element: Any, key: str, value: str) -> str:
    """What the value of an attribute means that is read and then not used; nothing if it is."""
    root = element.getroottree().getroot()
    if key == "quat_xyzw" and root.get("version", _FIRST) == _FIRST:
        return "a rotation in URDF 1.1; this file is URDF 1.0, which has rpy alone"
    if key == "group":
        return "which links touch; all that no joint connects are compared"
    if element.tag == "dynamics" and not _is_zero(value):
        return _MEANINGS.get((element.tag, key), "")
    kind = element.getparent().get("type") if element.tag == "limit" else None
    if kind == "continuous" and key in ("lower", "upper") and not _is_zero(value):
        return "an end of a range; a continuous joint has none, a revolute one has"
    rated = key in ("effort", "velocity", "acceleration", "jerk")
    if kind not in (None, "fixed") and rated and _is_zero(value):
        return "a limit of zero; it is taken as none"
    sizes = value.split() if element.tag in _SOLIDS else []
    if any(_is_zero(word) or word.startswith("-") for word in sizes):
        return "a size that is not positive; the shape is left out"
    return ""


def _is_zero(text: str) -> bool:
    """Whether a text is the number zero."""
    with suppress(ValueError):
        return float(text) == 0.0
    return False


def _unknown(name: str, known: tuple[str, ...]) -> str:
    return f"freefloat does not know it{did_you_mean(name, known)}"


def _entry(element: Any, attribute: str, meaning: str) -> NotRead:
    """An entry about an element of a link, of a joint, or of the robot."""
    owner = element
    while owner.getparent() is not None and owner.getparent().tag != "robot":
        owner = owner.getparent()
    name = f"{shown_tag(owner)} {owner.get('name') or owner.get('reference') or ''}".strip()
    place = name if owner is element else f"{shown_tag(element)} of {name}"
    return NotRead(place, attribute, element.sourceline or None, meaning)


def shown_tag(element: Any) -> str:
    """The tag of an element of lxml as in the file, with its prefix."""
    _, _, name = element.tag.rpartition("}")
    return f"{element.prefix}:{name}" if element.prefix else str(name)
