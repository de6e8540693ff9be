"""URDFs as they are met in the wild, each broken in ways of its own, and how each is mended.

All are written here, with round numbers; the ways of being broken are those of public files.
"""

from __future__ import annotations

from dataclasses import dataclass

Fix = tuple[str, str]


@dataclass(frozen=True)
class Ill:
    """One thing that is wrong in a URDF.

    Attributes:
        element: The link or joint to be named.
        at: Text that stands on the line to be named, and nowhere before.
        problem: Words of the problem, its numbers among them.
        remedy: Words of the remedy.
        fixes: What is written instead of what, following the remedy.
    """

    element: str
    at: str
    problem: str
    remedy: str
    fixes: tuple[Fix, ...]


@dataclass(frozen=True)
class Patient:
    """A URDF, all that is wrong in it, and its end-effector where it has several last links."""

    text: str
    ills: tuple[Ill, ...]
    hand: str | None = None

    def line(self, ill: Ill) -> int:
        """The line, counted from 1, on which an ill is to be told."""
        return self.text[: self.text.index(ill.at)].count("\n") + 1

    def mended(self, *ills: Ill) -> str:
        """The text after the remedies for some ills."""
        text = self.text
        for old, new in (fix for ill in ills for fix in ill.fixes):
            assert old in text, old
            text = text.replace(old, new)
        return text


def link(name: str, mass: str, centre: str, moments: str, shape: str = "") -> str:
    """A link over several lines; its moments are ``ixx iyy izz`` or all six, row by row."""
    values = moments.split()
    xx, xy, xz, yy, yz, zz = values if len(values) == 6 else (
        values[0], "0", "0", values[1], "0", values[2])  # fmt: skip
    return f"""
  <link name="{name}">
    <inertial>
      <origin xyz="{centre}" rpy="0 0 0"/>
      <mass value="{mass}"/>
      <inertia ixx="{xx}" ixy="{xy}" ixz="{xz}"
               iyy="{yy}" iyz="{yz}" izz="{zz}"/>
    </inertial>{shape}
  </link>"""


def joint(name: str, kind: str, ends: str, at: str, axis: str = "0 0 1", more: str = "") -> str:
    """A joint over several lines; its ends are ``parent child``."""
    parent, child = ends.split()
    return f"""
  <joint name="{name}" type="{kind}">
    <parent link="{parent}"/>
    <child link="{child}"/>
    <origin xyz="{at}" rpy="0 0 0"/>
    <axis xyz="{axis}"/>{more}
  </joint>"""


def robot(*parts: str) -> str:
    """The whole file."""
    head = '<?xml version="1.0"?>\n<!-- A robot\n     of our own. -->\n<robot name="patient">'
    return f"{head}{''.join(parts)}\n</robot>\n"


LIMIT = '\n    <limit lower="-2" upper="2" effort="100" velocity="0.1"/>'
BUS = link("bus", "300", "0 0 0", "50 50 50")
UPPER = link("upper", "10", "0.5 0 0", "0.1 0.9 0.9")
LOWER = link("lower", "8", "0.5 0 0", "0.1 0.7 0.7")
HAND = '\n  <link name="hand"/>'
WRIST = joint("tool", "fixed", "lower hand", "1 0 0")
ELBOW = joint("elbow", "revolute", "upper lower", "1 0 0", "0 0 1", LIMIT)
SHOULDER = joint("shoulder", "revolute", "bus upper", "0.5 0 0", "0 0 1", LIMIT)
SOUND = robot(BUS, SHOULDER, UPPER, ELBOW, LOWER, WRIST, HAND)
"""A servicer with two joints, in which nothing is wrong."""


def one(
    old: str, new: str, element: str, problem: str, remedy: str, *fixes: Fix, at: str = ""
) -> Patient:
    """The sound servicer with a single ill, on the first line that differs from the sound one."""
    assert old in SOUND
    text = SOUND.replace(old, new, 1)
    pairs = zip(SOUND.splitlines(), text.splitlines(), strict=False)
    at = at or next(ill for well, ill in pairs if well != ill)
    return Patient(text, (Ill(element, at, problem, remedy, fixes or ((new, old),)),))


def _ets_vii() -> Patient:
    """Every centre of mass on its joint; moments of the first link that no body has."""
    text = robot(
        link("satellite", "2500", "0 0 0", "6000 5000 5500"),
        joint("j1", "continuous", "satellite link1", "1.2 0 0.9"),
        link("link1", "35", "0 0 0", "0.9 0.2 0.3"),
        joint("j2", "continuous", "link1 link2", "0 0 0.1", "0 1 0"),
        link("link2", "22", "0 0 0", "0.1 1.4 1.4"),
        joint("j3", "continuous", "link2 link3", "0.9 0 0", "0 1 0"),
        link("link3", "18", "0 0.01 0", "0.1 1.1 1.1"),
        joint("tip", "fixed", "link3 grip", "0.8 0 0"),
        '\n  <link name="grip"/>',
    )
    broken = Ill(
        "link link1", '<inertia ixx="0.9"',
        "principal moments 0.2, 0.3, 0.9 break the triangle inequality", "at most 0.5",
        (('ixx="0.9"', 'ixx="0.5"'),),
    )  # fmt: skip
    second = Ill(
        "link link2", '<origin xyz="0 0 0" rpy="0 0 0"/>\n      <mass value="22"/>',
        "22 kg stands on its joint, although the link is 0.9 m long", '<origin xyz="0.45 0 0"/>',
        (('<origin xyz="0 0 0" rpy="0 0 0"/>\n      <mass value="22"/>',
          '<origin xyz="0.45 0 0"/>\n      <mass value="22"/>'),),
    )  # fmt: skip
    third = Ill(
        "link link3", '<origin xyz="0 0.01 0"',
        "18 kg stands on its joint, although the link is 0.8 m long", '<origin xyz="0.4 0 0"/>',
        (('<origin xyz="0 0.01 0" rpy="0 0 0"/>', '<origin xyz="0.4 0 0"/>'),),
    )  # fmt: skip
    return Patient(text, (broken, second, third))


def _ssrms() -> Patient:
    """Root ``world`` under nothing; a boom of 3 m whose 315 kg are in its joint."""
    text = robot(
        '\n  <link name="world"/>',
        joint("roll", "revolute", "world shoulder", "0 0 0", "0 0 1", LIMIT),
        link("shoulder", "100", "0 0.2 0", "9 9 9"),
        joint("yaw", "revolute", "shoulder boom", "0 0.4 0", "1 0 0", LIMIT),
        link("boom", "315", "0 0 0.02", "10 300 300"),
        joint("pitch", "revolute", "boom wrist", "3 0 0.4", "0 0 1", LIMIT),
        link("wrist", "100", "0 -0.2 0", "9 9 9"),
        joint("lee", "fixed", "wrist latch", "0 -0.5 0"),
        '\n  <link name="latch"/>',
    )
    root = Ill(
        "link world", '<link name="world"/>', "a spacecraft of 0 kg", "<inertial> in this link",
        (('<link name="world"/>', link("world", "9000", "0 0 0", "9e4 9e4 9e4").strip()),),
    )  # fmt: skip
    boom = Ill(
        "link boom", '<origin xyz="0 0 0.02"',
        "315 kg stands on its joint, although the link is 3.027 m long",
        '<origin xyz="1.5 0 0.2"/>',
        (('<origin xyz="0 0 0.02" rpy="0 0 0"/>', '<origin xyz="1.5 0 0.2"/>'),),
    )  # fmt: skip
    return Patient(text, (root, boom))


def _pulsar() -> Patient:
    """Expressions where numbers belong: nobody works them out."""
    turned = SOUND.replace('<origin xyz="0.5 0 0" rpy="0 0 0"/>\n    <axis',
                           '<origin xyz="0.16/2 0 0" rpy="0 0 pi/2"/>\n    <axis')  # fmt: skip
    text = turned.replace('lower="-2"', 'lower="${-pi + 0.5}"', 1)
    half = Ill("joint shoulder", "0.16/2", '<origin xyz="0.16/2 0 0">', 'xyz="0.08',
               (('xyz="0.16/2 0 0"', 'xyz="0.08 0 0"'),))  # fmt: skip
    turn = Ill("joint shoulder", "0 0 pi/2", '<origin rpy="0 0 pi/2">',
               'rpy="0 0 1.5707963267948966"', (("pi/2", "1.5707963267948966"),))  # fmt: skip
    lower = Ill("joint shoulder", "${-pi", '"${-pi + 0.5}"', 'lower="-2.6415926535897931"',
                (("${-pi + 0.5}", "-2.6415926535897931"),))  # fmt: skip
    return Patient(text, (half, turn, lower))


def _manisat() -> Patient:
    """Two arms; products of inertia copied with the wrong sign or place: not positive definite."""
    text = robot(
        BUS, SHOULDER, link("upper", "10", "0.5 0 0", "0.1 0.5 0 0.9 0 0.9"), ELBOW, LOWER, WRIST,
        HAND, joint("left_joint", "revolute", "bus left", "-0.5 0 0", "0 0 1", LIMIT),
        link("left", "5", "-0.2 0 0", "0.02 -0.06 0.06"),
    )  # fmt: skip
    first = Ill("link upper", 'ixy="0.5"', "not positive definite (principal moments -0.14",
                "products", (('ixy="0.5"', 'ixy="0.05"'),))  # fmt: skip
    second = Ill("link left", '<inertia ixx="0.02"', "principal moments -0.06, 0.02, 0.06",
                 "ixx, iyy, izz are positive", (('iyy="-0.06"', 'iyy="0.06"'),))  # fmt: skip
    return Patient(text, (first, second), "hand")


def _cepheus() -> Patient:
    """A moving link without mass; an arm of 0.2 m with the moments of a rotor of metres."""
    text = robot(
        link("base", "13", "0 0 0", "0.12 0.12 0.12"),
        joint("spin", "continuous", "base turret", "0.15 0 0"),
        '\n  <link name="turret"/>',
        joint("lift", "continuous", "turret arm", "0 0 0.05", "0 1 0"),
        link("arm", "0.1", "0.1 0 0", "0.01 0.15 0.15"),
        joint("reach", "continuous", "arm finger", "0.2 0 0", "0 1 0"),
        link("finger", "0.08", "0.05 0 0", "1e-5 7e-5 7e-5"),
        joint("tip", "fixed", "finger tip", "0.1 0 0"),
        '\n  <link name="tip"/>',
    )
    massless = Ill(
        "link turret", '<link name="turret"/>', "it moves but has no mass", "a small <inertial>",
        (('<link name="turret"/>', link("turret", "0.1", "0 0 0", "1e-4 1e-4 1e-4").strip()),),
    )  # fmt: skip
    moments = Ill(
        "link arm", 'ixx="0.01"',
        "gyration radius is 1.22 m (largest moment 0.15 kg m² of 0.1 kg), but it reaches 0.1 m",
        "a rod of this mass and length has 0.000333",
        (('ixx="0.01"', 'ixx="1e-5"'), ("0.15", "0.000333"), ("0.000333 0 0", "0.15 0 0")),
    )  # fmt: skip
    return Patient(text, (massless, moments))


def _spart() -> Patient:
    """Revolute joints that say nothing of their limits."""
    text = SOUND.replace(LIMIT, "")
    ills = tuple(
        Ill(f"joint {name}", f'<joint name="{name}"', "a revolute joint without a <limit>",
            '<limit lower="-3.14" upper="3.14" effort="100" velocity="1"/>',
            ((f'"{name}" type="revolute">', f'"{name}" type="revolute">\n    <limit '
              'lower="-3.14" upper="3.14" effort="100" velocity="1"/>'),))
        for name in ("shoulder", "elbow")
    )  # fmt: skip
    return Patient(text, ills)


_MESH = """
    <visual><geometry>
      <mesh filename="package://gone/arm.stl"/>
    </geometry></visual>"""
_BRACE = """
  <joint name="brace" type="fixed">
    <parent link="bus"/>
    <child link="lower"/>
  </joint>"""
_MOMENTS = '\n      <inertia ixx="0.1"'
_ORIGIN, _MASS = '\n      <origin xyz="0.5 0 0" rpy="0 0 0"/>', '\n      <mass value="10"/>'
_LOOP = '<parent link="lower"/>\n    <child link="upper"/>'

PATIENTS = {
    "ETS-VII: centres on joints": _ets_vii(),
    "SSRMS: root world, a boom's centre on its joint": _ssrms(),
    "PULSAR: expressions": _pulsar(),
    "ManiSat: not positive definite": _manisat(),
    "Cepheus: massless, gyration radius": _cepheus(),
    "SPART: no limits": _spart(),
    "a limit without rate": one(
        *(' effort="100" velocity="0.1"/>', ' effort="100"/>', "joint shoulder"),
        *("whose <limit> lacks velocity", '<limit lower="-2" upper="2" effort="100" velocity='),
    ),
    "an axis that is not a unit vector": one(
        *('<axis xyz="0 0 1"/>', '<axis xyz="0 3 4"/>', "joint shoulder", "has length 5"),
        *('<axis xyz="0 0.6 0.8"/>', ('xyz="0 3 4"', 'xyz="0 0.6 0.8"')),
    ),
    "angles in degrees": one(
        *('rpy="0 0 0"/>\n    <axis', 'rpy="0 90 0"/>\n    <axis', "joint shoulder"),
        *("turns by more than a turn", 'write rpy="0 1.57079633 0"'),
        ('rpy="0 90 0"', 'rpy="0 1.57079633 0"'),
    ),
    "an axis without direction": one(
        *('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>', "joint shoulder"),
        *('<axis xyz="0 0 0"> has no direction', 'xyz="0 0 1"'),
    ),
    "an axis whose length is lost in rounding": one(
        *('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1e-200"/>', "joint shoulder"),
        *('<axis xyz="0 0 1e-200"> has no direction', 'xyz="0 0 1"'),
    ),
    "a mimic": one(
        *(LIMIT, LIMIT + '\n    <mimic joint="elbow" multiplier="2"/>', "joint shoulder"),
        *("it mimics elbow, which is ignored", "leave out <mimic>"),
    ),
    "a mesh that is not there": one(
        *("</inertial>", f"</inertial>{_MESH}", "link bus"),
        *("package://gone/arm.stl of its <visual>: no such file", "a plain shape such as <box>"),
        (_MESH, '\n    <visual><geometry><box size="1 1 1"/></geometry></visual>'),
        at="<mesh filename",
    ),
    "two parents": one(
        *("\n</robot>", f"{_BRACE}\n</robot>", "link lower"),
        *("it is the child of two joints, elbow and brace", "leave out brace", (_BRACE, "")),
        at='<child link="lower"/>\n  </joint>',
    ),
    "a circle": one(
        *('<parent link="bus"/>', '<parent link="lower"/>', "link upper"),
        *("go round in a circle: upper <- lower <- upper", "leave out the joint that closes"),
        *[(_LOOP, _LOOP.replace("lower", "bus"))],
        at='<link name="upper"',
    ),
    "a link twice": one(
        *('<link name="hand"/>', '<link name="hand"/>\n  <link name="bus"/>', "link bus"),
        *("the name is given twice, first on line 5", "unique names"),
    ),
    "a joint twice": one(
        *('<joint name="tool"', '<joint name="elbow"', "joint elbow", "the name is given twice"),
        "unique names", ('"elbow" type="fixed"', '"tool" type="fixed"'),
    ),
    "a link that nothing carries": one(
        *('<link name="hand"/>', '<link name="hand"/>\n  <link name="lost"/>', "link lost"),
        *("a root link besides bus", '<child link="lost"/>', ('\n  <link name="lost"/>', "")),
    ),
    "a parent that is not there": one(
        *('<parent link="upper"/>', '<parent link="uper"/>', "joint elbow"),
        *("its parent link is uper", "with one of bus, upper, lower, hand"),
    ),
    "half an inertial": one(
        *('iyy="0.9" iyz="0" izz', 'iyy="0.9" izz', "link upper", "lacks iyz of <inertia>"),
        'iyz=".."', at='<inertia ixx="0.1"',
    ),
    "an inertial without mass": one(
        *(_ORIGIN + _MASS, _ORIGIN, "link upper", "lacks value of <mass>"),
        '<mass value=".."/>', (_ORIGIN + _MOMENTS, _ORIGIN + _MASS + _MOMENTS),
        at=f"<inertial>{_ORIGIN}",
    ),
    "a negative mass": one(
        *('"10"', '"-10"', "link upper", "mass -10.0 kg", "zero or more"),
    ),
    "a negative rate": one(
        *('velocity="0.1"', 'velocity="-0.1"', "joint shoulder", '<limit velocity="-0.1">'),
        "zero or more",
    ),
    "a range turned round": one(
        *('lower="-2" upper="2"', 'lower="2" upper="-2"', "joint shoulder"),
        *("its range is 2 to -2", '<limit lower="-2" upper="2" .../>'),
    ),
    "a floating joint": one(
        *('"shoulder" type="revolute"', '"shoulder" type="floating"', "joint shoulder"),
        *("its type is floating", "revolute, continuous, prismatic or fixed: the root link floats"),
    ),
    "a comma": one(
        *('<axis xyz="0 0 1"/>', '<axis xyz="0,0,1"/>', "joint shoulder"),
        *('<axis xyz="0,0,1"> is not 3 finite numbers', 'xyz="0 0 1"'),
    ),
    "a macro": one(
        *('"10"', '"${m_upper}"', "link upper", '"${m_upper}"', "xacro makes such a file a URDF"),
    ),
    "not well-formed": one(
        *("</robot>", "</robt>", "urdf", "mismatched tag", "a URDF file"),
    ),
    "a DTD": one(
        *("<!-- A robot\n     of our own. -->", "<!DOCTYPE robot>", "urdf", "it declares a DTD"),
        "plain XML without",
    ),
}  # fmt: skip
