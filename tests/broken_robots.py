"""Broken URDFs: what is wrong in each, on which line, and how it is corrected.

All are written here with round numbers; the mistakes are those of public files.
"""

from __future__ import annotations

from dataclasses import dataclass

Fix = tuple[str, str]


@dataclass(frozen=True)
class Fault:
    """A mistake in a URDF.

    Attributes:
        element: The link or joint concerned.
        at: Text on the line of the diagnostic, which occurs nowhere before.
        fixes: Text to replace, and the correction.
        severity: Of the diagnostic.
    """

    element: str
    at: str
    fixes: tuple[Fix, ...]
    severity: str


@dataclass(frozen=True)
class Broken:
    """A URDF, all its faults, and its end-effector where it has several last links."""

    text: str
    faults: tuple[Fault, ...]
    end_effector: str | None = None

    def line(self, fault: Fault) -> int:
        """The line of a fault, counted from 1."""
        return self.text[: self.text.index(fault.at)].count("\n") + 1

    def corrected(self, *faults: Fault) -> str:
        """The text with some faults corrected."""
        text = self.text
        for old, new in (fix for fault in faults for fix in fault.fixes):
            assert old in text, old
            text = text.replace(old, new)
        return text


def warning(element: str, at: str, *fixes: Fix) -> Fault:
    return Fault(element, at, fixes, "warning")


def error(element: str, at: str, *fixes: Fix) -> Fault:
    return Fault(element, at, fixes, "error")


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
    head = '<?xml version="1.0"?>\n<!-- A comment\n     of two lines. -->\n<robot name="servicer">'
    return f"{head}{''.join(parts)}\n</robot>\n"


LIMIT = '\n    <limit lower="-2" upper="2" effort="100" velocity="0.1"/>'
BUS = link("bus", "300", "0 0 0", "50 50 50")
UPPER = link("upper", "10", "0.5 0 0", "0.1 0.9 0.9")
LOWER = link("lower", "8", "0.5 0 0", "0.1 0.7 0.7")
HAND = '\n  <link name="hand"/>'
WRIST = joint("tool", "fixed", "lower hand", "1 0 0")
ELBOW = joint("elbow", "revolute", "upper lower", "1 0 0", "0 0 1", LIMIT)
SHOULDER = joint("shoulder", "revolute", "bus upper", "0.5 0 0", "0 0 1", LIMIT)
VALID = robot(BUS, SHOULDER, UPPER, ELBOW, LOWER, WRIST, HAND)
"""A valid servicer with two joints."""


def single(severity: str, element: str, old: str, new: str, *fixes: Fix, at: str = "") -> Broken:
    """The valid servicer with a single fault, on the first line that differs."""
    assert old in VALID
    text = VALID.replace(old, new, 1)
    pairs = zip(VALID.splitlines(), text.splitlines(), strict=False)
    at = at or next(wrong for right, wrong in pairs if right != wrong)
    return Broken(text, (Fault(element, at, fixes or ((new, old),), severity),))


def _ets_vii() -> Broken:
    """Centres of mass on the joints; moments of the first link that no body has."""
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
    origin = '<origin xyz="0 0 0" rpy="0 0 0"/>\n      <mass value="22"/>'
    return Broken(text, (
        warning("link link1", '<inertia ixx="0.9"', ('ixx="0.9"', 'ixx="0.5"')),
        warning("link link2", origin, (origin, origin.replace("0 0 0", "0.45 0 0", 1))),
        warning("link link3", '<origin xyz="0 0.01 0"', ("0 0.01 0", "0.4 0 0")),
    ))  # fmt: skip


def _ssrms() -> Broken:
    """A root link without mass; a boom of 3 m with its mass in its joint."""
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
    world, massive = '<link name="world"/>', link("world", "9000", "0 0 0", "9e4 9e4 9e4").strip()
    return Broken(text, (
        warning("link world", world, (world, massive)),
        warning("link boom", '<origin xyz="0 0 0.02"', ("0 0 0.02", "1.5 0 0.2")),
    ))  # fmt: skip


def _pulsar() -> Broken:
    """Expressions in place of numbers."""
    rotated = VALID.replace('<origin xyz="0.5 0 0" rpy="0 0 0"/>\n    <axis',
                           '<origin xyz="0.16/2 0 0"\n rpy="0 0 pi/2"/>\n    <axis')  # fmt: skip
    return Broken(rotated.replace('lower="-2"', 'lower="-pi + 0.5"', 1), (
        error("joint shoulder", '"0.16/2', ("0.16/2", "0.08"), ("pi/2", "1.5708")),
        error("joint shoulder", '"-pi', ("-pi + 0.5", "-2.64")),
    ))  # fmt: skip


def _manisat() -> Broken:
    """Two arms; inertias that are not positive definite."""
    text = robot(
        BUS, SHOULDER, link("upper", "10", "0.5 0 0", "0.1 0.5 0 0.9 0 0.9"), ELBOW, LOWER, WRIST,
        HAND, joint("left_joint", "revolute", "bus left", "-0.5 0 0", "0 0 1", LIMIT),
        link("left", "5", "-0.2 0 0", "0.02 -0.06 0.06"),
    )  # fmt: skip
    return Broken(text, (
        warning("link upper", 'ixy="0.5"', ('ixy="0.5"', 'ixy="0.05"')),
        warning("link left", '<inertia ixx="0.02"', ('iyy="-0.06"', 'iyy="0.06"')),
    ), "hand")  # fmt: skip


def _cepheus() -> Broken:
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
    turret = '<link name="turret"/>'
    massive = link("turret", "0.1", "0 0 0", "1e-4 1e-4 1e-4").strip()
    return Broken(text, (
        warning("link turret", turret, (turret, massive)),
        warning("link arm", 'ixx="0.01"', ('ixx="0.01"', 'ixx="1e-5"'),
                ("0.15", "0.000333"), ("0.000333 0 0", "0.15 0 0")),
    ))  # fmt: skip


def _spart() -> Broken:
    """Revolute joints without limits."""
    faults = tuple(
        warning(f"joint {name}", f'<joint name="{name}"',
                (f'"{name}" type="revolute">', f'"{name}" type="revolute">{LIMIT}'))
        for name in ("shoulder", "elbow")
    )  # fmt: skip
    return Broken(VALID.replace(LIMIT, ""), faults)


_MACRO = '  <xacro:property xmlns:xacro="http://ros.org/wiki/xacro" name="a" value="1"/>'
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

BROKEN = {
    "ETS-VII: centres of mass on joints": _ets_vii(),
    "SSRMS: massless root, centre of mass on a joint": _ssrms(),
    "PULSAR: expressions": _pulsar(),
    "ManiSat: not positive definite": _manisat(),
    "Cepheus: massless link, gyration radius": _cepheus(),
    "SPART: no limits": _spart(),
    "a limit without velocity": single(
        "warning", "joint shoulder", ' effort="100" velocity="0.1"/>', ' effort="100"/>'),
    "an axis that is not a unit vector": single(
        "warning", "joint shoulder", '<axis xyz="0 0 1"/>', '<axis xyz="0 3 4"/>'),
    "angles in degrees": single(
        "warning", "joint shoulder", 'rpy="0 0 0"/>\n    <axis', 'rpy="0 90 0"/>\n    <axis'),
    "an axis without direction": single(
        "error", "joint shoulder", '<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>'),
    "an axis whose length underflows": single(
        "error", "joint shoulder", '<axis xyz="0 0 1"/>', '<axis xyz="0 0 1e-200"/>'),
    "a mimic": single(
        "warning", "joint shoulder", LIMIT, LIMIT + '\n    <mimic joint="elbow" multiplier="2"/>'),
    "a missing mesh": single(
        "warning", "link bus", "</inertial>", f"</inertial>{_MESH}", (_MESH, ""),
        at="<mesh filename"),
    "two parents": single(
        "error", "joint brace", "\n</robot>", f"{_BRACE}\n</robot>", (_BRACE, ""),
        at='<child link="lower"/>\n  </joint>'),
    "a cycle": single(
        "error", "link upper", '<parent link="bus"/>', '<parent link="lower"/>',
        (_LOOP, _LOOP.replace("lower", "bus")), at='<link name="upper"'),
    "a link twice": single(
        "error", "link bus", '<link name="hand"/>', '<link name="hand"/>\n  <link name="bus"/>'),
    "a joint twice": single(
        "error", "joint elbow", '<joint name="tool"', '<joint name="elbow"',
        ('"elbow" type="fixed"', '"tool" type="fixed"')),
    "a second root": single(
        "error", "link lost", '<link name="hand"/>', '<link name="hand"/>\n  <link name="lost"/>',
        ('\n  <link name="lost"/>', "")),
    "a missing parent": single(
        "error", "joint elbow", '<parent link="upper"/>', '<parent link="uper"/>'),
    "half an inertial": single(
        "error", "link upper", 'iyy="0.9" iyz="0" izz', 'iyy="0.9" izz', at='<inertia ixx="0.1"'),
    "an inertial without mass": single(
        "error", "link upper", _ORIGIN + _MASS, _ORIGIN,
        (_ORIGIN + _MOMENTS, _ORIGIN + _MASS + _MOMENTS), at=f"<inertial>{_ORIGIN}"),
    "a negative mass": single("error", "link upper", '"10"', '"-10"'),
    "a negative velocity": single(
        "error", "joint shoulder", 'velocity="0.1"', 'velocity="-0.1"'),
    "an inverted range": single(
        "warning", "joint shoulder", 'lower="-2" upper="2"', 'lower="2" upper="-2"'),
    "a floating joint": single(
        "error", "joint shoulder", '"shoulder" type="revolute"', '"shoulder" type="floating"'),
    "commas": single("error", "joint shoulder", '<axis xyz="0 0 1"/>', '<axis xyz="0,0,1"/>'),
    "an expression of xacro": single("error", "urdf", '"10"', '"${m_upper}"', at="<mass value=\"$"),
    "a macro of xacro": single(
        "error", "urdf", "</robot>", f"{_MACRO}\n</robot>", (_MACRO, ""), at="<xacro"),
    "XML that is not well-formed": single("error", "urdf", "</robot>", "</robt>"),
    "a DTD": single("error", "urdf", "<!-- A comment\n     of two lines. -->", "<!DOCTYPE robot>"),
}  # fmt: skip
