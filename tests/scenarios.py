"""Scenarios that several tests begin with."""

PARABOLA = """\
robot: {urdf: planar_3dof.urdf, end_effector: end_effector}
task: planar-pose
momentum: [0, 0, 0.5]
path:
  polynomial: {x: [2, -3], y: [0, 0.5, 1.5], z: [0]}
  attitude: {follow: {axis: -y, normal: [0, 0, 1]}}
timing: {law: quintic, duration: 100}
margin: {measure: system, value: 5}
"""
"""The paper's Example 1 with little momentum, its robot beside it."""
EASY = """\
robot: {urdf: spatial_6dof, end_effector: end_effector}
task: pose
momentum: [0.5, 0.3, 0.1]
path:
  line: {from: [1, 0, 0], to: [0.98, 0.02, 0.01]}
  attitude: {fixed: {axes: {x: [0.4683, 1.1683, -0.7], z: [1.5, -0.8, -0.33]}}}
timing: {duration: 10}
margin: {measure: arm, value: 5}
"""
"""A line of three centimetres, which every attitude and every arm branch can follow."""
_SEARCHED = EASY + "search: {samples: 64, seed: 3}\n"
SEARCHED = {
    "easy": _SEARCHED,
    "hard": _SEARCHED.replace("value: 5", "value: 5000"),
    "far": _SEARCHED.replace("from: [1, 0, 0]", "from: [9, 0, 0]"),
}
"""The same with few samples; with a margin above all motions; beyond the reach."""
