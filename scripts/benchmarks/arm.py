"""An arm of any number of joints that every engine can read."""

from __future__ import annotations

_AXES = ("0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "0 0 1", "0 1 0", "0 0 1")
_INERTIAL = (
    '<inertial><origin xyz="{0} 0 0"/><mass value="{1}"/><inertia ixx="{2}" ixy="0" ixz="0" '
    'iyy="{3}" iyz="0" izz="{3}"/></inertial>'
)


def arm_urdf(joints: int) -> str:
    """A spacecraft of 300 kg with rods of 0.5 m; the last link's frame is its centre of mass."""
    text = f'<link name="bus">{_INERTIAL.format(0.0, 300.0, 40.0, 50.0)}</link>\n'
    parent = "bus"
    for k, axis in enumerate(_AXES[:joints], start=1):
        last = k == joints
        text += (
            f'<joint name="q{k}" type="revolute"><parent link="{parent}"/><child link="link_{k}"/>'
            f'<origin xyz="0.5 0.02 0"/><axis xyz="{axis}"/>'
            '<limit lower="-7" upper="7" effort="100" velocity="10"/></joint>\n'
            f'<link name="link_{k}">{_INERTIAL.format(0.0 if last else 0.25, 6.0, 0.05, 0.2)}'
            "</link>\n"
        )
        parent = f"link_{k}"
    return f'<?xml version="1.0"?>\n<robot name="arm">\n{text}</robot>\n'
