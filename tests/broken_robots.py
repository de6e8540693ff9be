"""A valid URDF, and faults of URDFs: what is changed, and what is reported on which line."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    """A mistake in the valid URDF.

    Attributes:
        severity: Of the diagnostic.
        element: The link or joint concerned.
        old: Text that is replaced once.
        new: The mistake.
        at: Text on the line of the diagnostic; default: the first line that differs.
    """

    severity: str
    element: str
    old: str
    new: str
    at: str = ""

    @property
    def text(self) -> str:
        """The URDF with the mistake."""
        assert self.old in VALID
        return VALID.replace(self.old, self.new, 1)

    @property
    def diagnosis(self) -> tuple[str, int, str]:
        """Severity, line and element of the diagnostic."""
        lines = self.text.splitlines()
        pairs = enumerate(zip(VALID.splitlines(), lines, strict=False), 1)
        line = (
            self.text[: self.text.index(self.at)].count("\n") + 1
            if self.at
            else next(number for number, (right, wrong) in pairs if right != wrong)
        )
        return self.severity, line, self.element


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
_MOMENTS = 'ixx="0.1" ixy="0" ixz="0"\n               iyy="0.9" iyz="0" izz="0.9"'

FAULTS = {
    "a massless root": Fault(
        "warning", "link bus", BUS.strip(), '<link name="bus"/>'),
    "a massless moving link": Fault(
        "warning", "link lower", LOWER.strip(), '<link name="lower"/>'),
    "a gyration radius beyond the link": Fault(
        "warning", "link upper", _MOMENTS, _MOMENTS.replace("0.9", "90").replace("0.1", "90")),
    "a centre of mass on its joint": Fault(
        "warning", "link upper", '<origin xyz="0.5 0 0" rpy="0 0 0"/>\n      <mass',
        '<origin xyz="0 0 0.01" rpy="0 0 0"/>\n      <mass'),
    "an inertia that is not positive definite": Fault(
        "warning", "link bus", 'ixy="0"', 'ixy="60"'),
    "an expression": Fault("error", "joint shoulder", 'lower="-2"', 'lower="-pi + 0.5"'),
    "no limits": Fault(
        "warning", "joint shoulder", LIMIT, "", at='<joint name="shoulder"'),
    "an axis that is not a unit vector": Fault(
        "warning", "joint shoulder", '<axis xyz="0 0 1"/>', '<axis xyz="0 3 4"/>'),
    "an axis without direction": Fault(
        "error", "joint shoulder", '<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>'),
    "a mimic of nothing": Fault(
        "warning", "joint shoulder", LIMIT, LIMIT + '\n    <mimic joint="elbo" multiplier="2"/>'),
    "a mimic of itself": Fault(
        "error", "joint shoulder", LIMIT, LIMIT + '\n    <mimic joint="shoulder"/>'),
    "a missing mesh": Fault(
        "warning", "link bus", "</inertial>", f"</inertial>{_MESH}", at="<mesh filename"),
    "two parents": Fault(
        "error", "joint brace", "\n</robot>", f"{_BRACE}\n</robot>",
        at='<child link="lower"/>\n  </joint>'),
    "a cycle": Fault(
        "error", "link upper", '<parent link="bus"/>', '<parent link="lower"/>',
        at='<link name="upper"'),
    "an unknown parent": Fault(
        "error", "joint shoulder", '<parent link="bus"/>', '<parent link="buss"/>'),
    "a joint without a child": Fault(
        "error", "joint tool", '<child link="hand"/>', '<child link=""/>'),
    "a link without a name": Fault(
        "error", "link", '<link name="hand"/>', '<link name="hand"/>\n  <link/>'),
    "a link twice": Fault(
        "error", "link bus", '<link name="hand"/>', '<link name="hand"/>\n  <link name="bus"/>'),
    "a second root": Fault(
        "error", "link lost", '<link name="hand"/>', '<link name="hand"/>\n  <link name="lost"/>'),
    "half an inertial": Fault(
        "error", "link upper", 'iyy="0.9" iyz="0" izz', 'iyy="0.9" izz', at='<inertia ixx="0.1"'),
    "a negative mass": Fault("error", "link upper", '"10"', '"-10"'),
    "an inverted range": Fault(
        "warning", "joint shoulder", 'lower="-2" upper="2"', 'lower="2" upper="-2"'),
    "a floating joint": Fault(
        "error", "joint shoulder", '"shoulder" type="revolute"', '"shoulder" type="floating"'),
    "a macro of xacro": Fault(
        "error", "urdf", "</robot>", f"{_MACRO}\n</robot>", at="<xacro"),
    "a DTD": Fault("error", "urdf", "<!-- A comment\n     of two lines. -->", "<!DOCTYPE robot>"),
}  # fmt: skip
