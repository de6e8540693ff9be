"""What a model of MuJoCo says and the URDF made of it does not.

Values come from the compiled model, in which defaults are resolved: what differs from a model
that states nothing is listed. Lines come from the file, where an element has a name.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from freefloat.beyond.formats.mjcf_spacecraft import SLIDE, base_joints
from freefloat.beyond.formats.mjcf_tree import WORLD, body_name, joint_name, joints_of
from freefloat.robot.named_files import read_text
from freefloat.robot.not_read import NotRead

Lines = Mapping[tuple[str, str], int]
"""Line of an element, by the kind and the name of what it describes."""
SHAPES = {2: "sphere", 3: "capsule", 5: "cylinder", 6: "box"}
"""Types of geoms that are shapes of links."""
_OTHER_SHAPES = {0: "plane", 1: "height field", 4: "ellipsoid", 7: "mesh", 8: "distance field"}
_UNSHAPED = "is neither drawn nor compared for contact"
_RIGID = "the joint moves without it"
_CONTACT = "freefloat keeps bodies apart, and computes no contact forces"
_SOLVER = "MuJoCo's solver; freefloat keeps joint ranges exactly"
_PROPERTIES = {
    "jnt": {
        "stiffness": ("stiffness", f"a spring; {_RIGID}"),
        "stiffnesspoly": ("stiffness", f"a spring; {_RIGID}"),
        "springyield": ("springyield", f"a spring; {_RIGID}"),
        "margin": ("margin", _SOLVER),
        "solref": ("solreflimit", _SOLVER),
        "solimp": ("solimplimit", _SOLVER),
        "actfrcrange": ("actuatorfrcrange", "a limit; limits.joint_torque in a scenario gives one"),
        "actgravcomp": ("actuatorgravcomp", "compensation of gravity; there is none"),
    },
    "dof": {
        "armature": ("armature", "inertia that the base has in some directions; it has its mass"),
        "damping": ("damping", f"viscous friction; {_RIGID}"),
        "dampingpoly": ("damping", f"viscous friction; {_RIGID}"),
        "frictionloss": ("frictionloss", f"dry friction; {_RIGID}"),
        "solref": ("solreffriction", _SOLVER),
        "solimp": ("solimpfriction", _SOLVER),
    },
    "geom": {"fluid": ("fluidshape", "forces of a fluid; there is none")},
    "body": {"gravcomp": ("gravcomp", "compensation of gravity; there is none")},
}
"""Attribute and meaning of properties, by the prefix of their arrays in MuJoCo."""
_USED = {
    "jnt": "actfrclimited actuatorid axis bodyid dofadr group limited plasticadr pos qposadr range "
           "type user",
    "dof": "M0 Madr bodyid invweight0 jntid length parentid simplenum treeid",
    "geom": "aabb bodyid castshadow conaffinity contype dataid group matid plugin pos quat rbound "
            "rgba sameframe size type user",
    "body": "bvhadr bvhnum conaffinity contype dofadr dofnum geomadr geomnum inertia invweight0 "
            "ipos iquat jntadr jntnum margin mass mocapid parentid plugin pos quat rootid "
            "sameframe simple subtreemass treeid user weldid",
}  # fmt: skip
"""Properties that are used, follow from others, or change pictures alone."""
_PLAIN = '<mujoco><worldbody><body><joint/><geom size="1"/></body></worldbody></mujoco>'
"""A model that states nothing about a joint, a geom and a body."""
_WEIGHTLESS = {
    "gravity": "nothing has weight; on a table robot.gravity gives it to the arm",
    "wind": "there is no fluid", "density": "there is no fluid", "viscosity": "there is no fluid",
}  # fmt: skip
_SECTIONS = (
    "actuator", "asset", "compiler", "contact", "custom", "default", "deformable", "equality",
    "extension", "include", "keyframe", "option", "sensor", "size", "statistic", "tendon",
    "visual", "worldbody",
)  # fmt: skip
"""Elements of a model; others are listed."""
_GROUPS = ("actuator", "tendon", "equality", "sensor")
"""Elements that name the kind of the elements in them."""


def not_read(model: Any, bodies: Collection[int], documents: Iterable[Path]) -> Iterator[NotRead]:
    """What the URDF of some bodies of a model leaves out, each once.

    Args:
        model: The compiled model.
        bodies: Numbers of the bodies in the URDF.
        documents: The file, then the files that it includes.
    """
    main, *included = map(_parsed, documents)
    seen = set[tuple[str, str]]()
    elsewhere = (replace(entry, line=None) for root in included for entry in _of_file(root))
    for entry in chain(_of_model(model, bodies, _lines(main)), _of_file(main), elsewhere):
        if (entry.element, entry.attribute) not in seen:
            seen.add((entry.element, entry.attribute))
            yield entry


def _of_model(model: Any, bodies: Collection[int], lines: Lines) -> Iterator[NotRead]:
    import mujoco

    plain = mujoco.MjModel.from_xml_string(_PLAIN)
    for joint in base_joints(model, min(bodies)):
        yield from _of_joint(model, plain, joint, lines, base=True)
    for body in range(1, model.nbody):
        if body in bodies:
            yield from _of_body(model, plain, body, lines)
            for joint in joints_of(model, body) if body != min(bodies) else ():
                yield from _of_joint(model, plain, joint, lines, base=False)
        elif model.body_parentid[body] == WORLD or model.body_parentid[body] in bodies:
            name = body_name(model, body)
            yield NotRead(f"body {name}", "", lines.get(("body", name)), "it is left out")
    for geom in range(model.ngeom):
        if model.geom_bodyid[geom] == WORLD:
            name = str(model.geom(geom).name)
            element = f"geom {name or f'number {geom + 1}'} of the world"
            meaning = f"it {_UNSHAPED}; robot and scene of a scenario are"
            yield NotRead(element, "", lines.get(("geom", name)), meaning)
    yield from _couplings(model, mujoco, lines)


def _of_body(model: Any, plain: Any, body: int, lines: Lines) -> Iterator[NotRead]:
    """What is not used of a body and its geoms."""
    name = body_name(model, body)
    element, line = f"body {name}", lines.get(("body", name))
    yield from _properties(model, plain, ("body", body), element, line)
    if model.body_mocapid[body] >= 0:
        yield NotRead(element, "mocap", line, "a body that is moved from outside; it floats freely")
    geoms = int(model.body_geomadr[body])
    for geom in range(geoms, geoms + int(model.body_geomnum[body])):
        label = str(model.geom(geom).name)
        element = f"geom {label or f'number {geom - geoms + 1}'} of body {name}"
        line = lines.get(("geom", label))
        kind = int(model.geom_type[geom])
        if kind not in SHAPES:
            shape = _OTHER_SHAPES.get(kind, "shape")
            yield NotRead(element, "type", line, f"this {shape} {_UNSHAPED}")
        yield from _properties(model, plain, ("geom", geom), element, line)


def _of_joint(model: Any, plain: Any, joint: int, lines: Lines, *, base: bool) -> Iterator[NotRead]:
    """What is not used of a joint, of the base or of the arm."""
    label = joint_name(model, joint)
    element, line = f"joint {label}", lines.get(("joint", label))
    yield from _properties(model, plain, ("jnt", joint), element, line)
    if base and model.jnt_limited[joint]:
        yield NotRead(element, "range", line, "limits of motion in the world; the base has none")
    first, place = int(model.jnt_dofadr[joint]), int(model.jnt_qposadr[joint])
    last = first + 1 if model.jnt_type[joint] >= SLIDE else first + 6
    for dof in range(first, last):
        for entry in _properties(model, plain, ("dof", dof), element, line):
            if base or entry.attribute != "armature":
                yield entry
    if last == first + 1 and model.qpos_spring[place] != 0.0:  # stated, also without stiffness
        yield NotRead(element, "springref", line, f"a spring; {_RIGID}")


def _properties(
    model: Any, plain: Any, place: tuple[str, int], element: str, line: int | None
) -> Iterator[NotRead]:
    """Properties of an object that differ from the properties of a plain one and are not used.

    Args:
        model: The model.
        plain: The plain model.
        place: Prefix of the arrays, the object's number in the model, and the plain one's number.
        element: The element in what is listed.
        line: Line of the element.
    """
    prefix, number = place
    plain_number = int(prefix == "body")  # body 0 is the world
    used = _USED[prefix].split()
    for name in dir(plain):
        kind, _, key = name.partition("_")
        if kind != prefix or not key or key in used:
            continue
        value, default = np.asarray(getattr(model, name)), np.asarray(getattr(plain, name))
        if not np.array_equal(value[number], default[plain_number]):
            meaning = _CONTACT if prefix == "geom" else "freefloat does not use it"
            attribute, meaning = _PROPERTIES[prefix].get(key, (key, meaning))
            yield NotRead(element, attribute, line, meaning)


def _couplings(model: Any, mujoco: Any, lines: Lines) -> Iterator[NotRead]:
    """What acts on several bodies or joints: constraints, tendons, actuators, contacts, flexes."""
    kinds = mujoco.mjtObj
    actuators = getattr(model, "nactuator", model.nu)  # of releases before 4
    groups = (
        ("equality", kinds.mjOBJ_EQUALITY, model.neq, "a constraint; joints move without it"),
        ("tendon", kinds.mjOBJ_TENDON, model.ntendon, "joints move without it"),
        ("actuator", kinds.mjOBJ_ACTUATOR, actuators, "a drive, its gains and its ranges of "
         "control and force; limits.joint_torque in a scenario limits torques"),
        ("pair", kinds.mjOBJ_PAIR, model.npair, _CONTACT),
        ("flex", kinds.mjOBJ_FLEX, model.nflex, f"a deformable body; it {_UNSHAPED}"),
        ("skin", kinds.mjOBJ_SKIN, model.nskin, "it is not drawn"),
        ("sensor", kinds.mjOBJ_SENSOR, model.nsensor, "a sensor; none is modelled"),
        ("key", kinds.mjOBJ_KEY, model.nkey,
         "a state of a keyframe; attitudes and joint values are given to commands"),
        ("plugin", kinds.mjOBJ_PLUGIN, model.nplugin, "forces or shapes of a plugin of MuJoCo"),
    )  # fmt: skip
    for kind, number, count, meaning in groups:
        for index in range(count):
            name = mujoco.mj_id2name(model, number, index) or f"number {index + 1}"
            yield NotRead(f"{kind} {name}", "", lines.get((kind, name)), meaning)


def _of_file(root: Any) -> Iterator[NotRead]:
    """Options of the simulation, and sections of a kind that is not known."""
    for element in root if root.tag == "mujoco" else ():
        if element.tag not in _SECTIONS:
            yield NotRead(str(element.tag), "", element.sourceline, "it is not known")
    for element in root.xpath("//option | //option/flag"):
        for key, value in element.attrib.items():
            if key in _WEIGHTLESS and not any(word.strip("-+0.") for word in value.split()):
                continue
            meaning = _WEIGHTLESS.get(key, "how MuJoCo simulates; freefloat integrates itself")
            yield NotRead(element.tag, key, element.sourceline, meaning)


def _parsed(path: Path) -> Any:
    """The root of an XML file, an empty one of another file: MuJoCo accepts more than XML."""
    parser = etree.XMLParser(
        encoding="utf-8", no_network=True, resolve_entities=False, remove_comments=True
    )
    try:
        text = read_text(path)
        root = etree.fromstring(text.encode(), parser)
    except (ValueError, SyntaxError):
        return etree.Element("mujoco")
    lines = text.split("\n")
    for element in root.iter("*"):  # lxml has the line of a start tag's end
        while element.sourceline > 1 and f"<{element.tag}" not in lines[element.sourceline - 1]:
            element.sourceline -= 1
    return root


def _lines(root: Any) -> Lines:
    """Lines of the named elements of a file, without elements of defaults."""
    lines: dict[tuple[str, str], int] = {}
    for element in root.iter("*"):
        name, parent = element.get("name"), element.getparent()
        if name is None or parent is None or parent.tag == "default":
            continue
        kind = {"freejoint": "joint"}.get(element.tag, element.tag)
        kind = parent.tag if parent.tag in _GROUPS else kind
        lines.setdefault((kind, name), element.sourceline)
    return lines
