"""Robots in the style of SPART's examples: no limits, massless roots, inertias of the plane."""

from pathlib import Path

import numpy as np
import yaml

from tests.robots import inertial_text, link_text


def link(name: str, mass: float, centre: str, moments: list[float]) -> str:
    """A link with principal moments."""
    return link_text(name, inertial_text(mass, np.diag(moments), centre))


def joint(name: str, parent: str, child: str, at: str, kind: str = "revolute", axis: str = "0 0 1",
          limit: str = "") -> str:  # fmt: skip
    """A joint; SPART's have no ``<limit>``."""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{at}"/><axis xyz="{axis}"/>{limit}</joint>'
    )


def arm(prefix: str, at: str, moments: list[float], limit: str = "") -> str:
    """Two links of 1 m and an end-effector on the link ``base``."""
    upper, lower, tip = (f"{prefix}{name}" for name in ("upper", "lower", "tip"))
    return "\n".join(
        [
            joint(f"{prefix}J1", "base", upper, at, limit=limit),
            link(upper, 10.0, "0.5 0 0", moments),
            joint(f"{prefix}J2", upper, lower, "1 0 0", limit=limit),
            link(lower, 8.0, "0.5 0 0", moments),
            joint(f"{prefix}tool", lower, tip, "1 0 0", "fixed"),
            link_text(tip),
        ]
    )


def robot(*parts: str) -> str:
    """The whole file."""
    return '<?xml version="1.0"?>\n<robot name="SC_2DoF">\n' + "\n".join(parts) + "\n</robot>\n"


_BUS = link("base", 100.0, "0 0 0", [20, 20, 20])
_SLIM, _FLAT = [0.1, 0.8, 0.8], [0, 0, 0.8]
ROBOTS = {
    "no limits": robot(_BUS, arm("", "0.5 0 0", _SLIM)),
    "a range without effort and velocity": robot(
        _BUS, arm("", "0.5 0 0", _SLIM, '<limit lower="-3" upper="3"/>')
    ),
    "a massless root, inertias of the plane": robot(
        link_text("origin"), joint("fixing", "origin", "base", "0 0 0", "fixed"),
        link("base", 100.0, "0 0 0", [0, 0, 20]), arm("", "0.5 0 0", _FLAT),
    ),
    "two arms": robot(_BUS, arm("", "0.5 0 0", _SLIM), arm("left_", "-0.5 0 0", _SLIM)),
}  # fmt: skip
"""URDFs with two revolute joints; the second arm of the last is held."""


SCENARIO = {
    "task": "planar-position",
    "path": {"line": {"from": [1.55, 0.6, 0], "to": [1.35, 0.9, 0]}},
    "timing": {"duration": 60},
    "margin": {"measure": "system", "value": 1e-3},
}
"""What these robots can do."""


def write_scenario(folder: Path, urdf: str, **robot: object) -> Path:
    """Write what they can do with a robot, whose end-effector is ``tip``."""
    section = {"urdf": urdf, "end_effector": "tip"} | robot
    (folder / "s.yaml").write_text(yaml.safe_dump(SCENARIO | {"robot": section}))
    return folder / "s.yaml"


def scene(target: str = "") -> str:
    """A scene of MuJoCo with 23 bodies in the world, of which one can be the root.

    A chaser with an arm, a target with bodies on it, markers, a floor.
    """
    return f"""<mujoco model="orbit"><option gravity="0 0 0"/><worldbody>
  <light pos="0 0 5"/><geom name="floor" type="plane" size="5 5 0.1" pos="0 0 -3"/><site/>
  <body name="chaser"><freejoint/><inertial pos="0 0 0" mass="100" diaginertia="20 20 20"/>
    <geom type="box" size="0.5 0.4 0.4" mass="0" contype="0" conaffinity="0"/><site name="imu"/>
    <body name="upper" pos="0.5 0 0"><joint name="q1" axis="0 0 1"/>
      <inertial pos="0.5 0 0" mass="10" diaginertia="0.1 0.8 0.8"/>
      <body name="lower" pos="1 0 0"><joint name="q2" axis="0 0 1"/>
        <inertial pos="0.5 0 0" mass="8" diaginertia="0.1 0.8 0.8"/>
        <body name="tip" pos="1 0 0"><site name="tool"/></body>
      </body>
    </body>
  </body>
  <body name="target" pos="3 0 0"><freejoint/><geom size="0.3"/>{target}</body>
  <body name="goal" mocap="true" pos="2 0 0"><geom size="0.05" contype="0" conaffinity="0"/></body>
  <replicate count="20" offset="0 0.1 0">
    <body name="marker" pos="1 1 1"><geom size="0.02"/></body>
  </replicate>
</worldbody></mujoco>
"""
