"""Valid scenarios, studies, samples, maps and a robot with meshes, from which mutations begin."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

import freefloat as ff
from freefloat.planning.margin_map import HeadingMap
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.so3 import heading_quaternion
from tests.maps import branch_results
from tests.samples import bundled, content

RICH = """\
robot:
  urdf: spatial_6dof.urdf
  end_effector: end_effector
  scale_mass: {link_1: 1.5}
  payload: {mass: 4, inertia: [1, 1, 1], com: [0, 0, 0.1], mesh: part.stl}
  attached: [{urdf: planar_3dof.urdf, mount: {xyz: [0, 0, 1], rpy: [0, 0, 0]}, prefix: b_}]
  held: {b_q1: 0.3}
task: pose
momentum: [0.5, 0.3, 0.1]
path:
  arc: {center: [1, 0, 0], normal: [0, 0, 1], from: [1.2, 0, 0], angle_deg: 40}
  attitude:
    slerp: {from: [0, 0, 0, 1], to: {axes: {x: [1, 0, 0], z: [0, 0.1, 1]}}}
timing: {law: trapezoidal, duration: 50, stops: [{s: 0.5, t: 20}]}
margin: {measure: sigma, value: 0.01}
search: {objective: nearest, from_attitude: [0, 0, 0, 1], samples: 64, seed: 3}
limits: {joint_rate: 0.5, joint_torque: {}, base_rate: 1, clearance: 0.01}
"""


SAMPLED = """\
robot:
  urdf: planar_3dof.urdf
  end_effector: end_effector
  spacecraft: {mass: 200, inertia: [10, 10, 12], size: [1, 1, 1]}
task: position
path: {samples: points.csv}
timing: {duration: 20}
margin: {value: 0}
"""


POINTS = "s,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n0.4,0.5,0,0.1,0,0,0.1,1\n1,1,0.2,0.3,0,0,1,0\n"


STUDY: dict[str, Any] = {
    "base": "base.yaml",
    "command": "plan",
    "vary": {
        "momentum": {"normal": {"mean": [0, 0, 1], "sd": [0, 0, 0.1]}},
        "timing.duration": {"list": [50, 100]},
        "path.polynomial.x": {"grid": {"from": [2, -3], "to": [2.1, -3], "count": [3, 1]}},
        "margin.value": {"range": [1, 3, 0.5]},
    },
    "cases": 3,
    "seed": 1,
}


START: dict[str, Any] = {
    "base": "base.yaml",
    "command": "simulate",
    "start": {"branch": "best"},
    "vary": {
        "attitude": {"so3": {"center": [0, 0, 0, 1], "angle_deg": 20}},
        "robot.urdf": {"list": ["planar_3dof.urdf", "spatial_6dof.urdf"]},
        "path": {"list": [{"samples": "points.csv"}, {"samples": "none.csv"}]},
        "momentum.2": {"uniform": [0, 1]},
    },
    "cases": 4,
}


HEADINGS = {
    "base": "planar_3dof/parabola", "command": "simulate", "combine": "zipped",
    "vary": {"heading_deg": {"list": [200.0, 20.0]}, "momentum.2": {"list": [0.1, 0.2]}},
}  # fmt: skip


def meshed() -> bytes:
    """A robot with meshes, a material and a prismatic joint."""
    text = bundled("planar_3dof")[0].decode()
    shown = '<visual><geometry><mesh filename="part.stl" scale="1 1 2"/></geometry></visual>'
    shown += '<collision><geometry><mesh filename="part.stl"/></geometry></collision>'
    text = text.replace("</link>", f"{shown}</link>", 2)
    limit = '<limit lower="-1" upper="1" effort="9" velocity="1"/>'
    return text.replace('type="continuous">', f'type="prismatic">{limit}', 1).encode()


@cache
def maps() -> tuple[bytes, bytes]:
    """A map over headings and one over attitudes."""
    problem = ff.load_scenario("planar_3dof/parabola").problem()
    headings = np.linspace(0.0, 3.0, 4)
    attitudes = heading_quaternion(headings)
    results = branch_results(attitudes, np.ones((4, 2)), 3, ended_at=np.full((4, 2), 100.0))
    heading_map = HeadingMap(problem, results, headings, (0, 1))
    spatial = ff.load_scenario("spatial_6dof/line").problem()
    attitude_map = AttitudeMap(spatial, branch_results(attitudes, np.ones((4, 8))))
    return content(heading_map), content(attitude_map)
