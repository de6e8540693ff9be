"""Problems of redundant arms: random robots and random paths from their configuration."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.dynamics.redundancy import Metric, Toward
from freefloat.paths.curves import PolynomialCurve
from freefloat.paths.orientation import SlerpOrientation
from freefloat.paths.timing import Stop
from freefloat.so3 import heading_quaternion
from tests.robots import planar_robot, random_robot

ARMS = [
    ("RRRRRRR", ff.Task.POSE), ("RRRPRRRR", ff.Task.POSE), ("RRRRRR", ff.Task.POSITION),
    ("RPRR", ff.Task.POSITION), ("PRFRPRR", ff.Task.POSITION), ("3", ff.Task.PLANAR_POSITION),
    ("5", ff.Task.PLANAR_POSITION), ("4", ff.Task.PLANAR_POSE),
]  # fmt: skip
"""Structures, or the number of planar joints, and tasks for which they are redundant."""

RANGE = '<limit lower="-1" upper="2.5" effort="9" velocity="9"/>'
"""Range of the second joint of planar arms; the others are continuous."""


@dataclass(frozen=True)
class Start:
    """A problem and a state at which its path begins."""

    problem: ff.Problem
    attitude: np.ndarray
    joints: np.ndarray


def redundant(
    structure: str,
    task: ff.Task,
    redundancy: ff.Redundancy | None,
    seed: int = 0,
    *,
    momentum: bool = True,
    timing: ff.Timing | None = None,
) -> Start:
    """A random robot whose end-effector follows a short line with a rotation."""
    rng = np.random.default_rng([seed, *structure.encode()])
    if task.planar:
        m = [60.0, 9.0, 7.0, 5.0, 3.0, *[2.0] * int(structure)][: int(structure) + 1]
        size = [0.4] * len(m)
        text = planar_robot(m, [0.2 * mass for mass in m], size[1:], size)
        text = text.replace('"q2" type="continuous"', '"q2" type="revolute"')
        child = '<child link="link_2"/>'
        text = text.replace(child, child + RANGE)
        model = ff.FreeFloatingModel.from_urdf(text, "end_effector")
        attitude = heading_quaternion(float(rng.uniform(0.0, 6.0)))
        across = np.array([1.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    else:
        model = random_robot(rng, structure).model()
        attitude, across = Rotation.random(rng=rng).as_quat(), (np.ones(3), np.ones(3))
    joints = rng.uniform(-1.5, 1.5, model.dof)
    pose = model.end_effector_pose(attitude, joints)
    p, R = np.array(pose.position), np.array(pose.rotation)
    line = PolynomialCurve.line(p, p + across[0] * rng.uniform(-0.15, 0.15, 3))
    rotation = Rotation.from_rotvec(across[1] * rng.uniform(-0.2, 0.2, 3)).as_matrix()
    path = ff.EndEffectorPath(line, SlerpOrientation(R, rotation @ R))
    h = across[1] * rng.normal(size=3) * model.total_mass / 500.0 * momentum
    timed = ff.TimedPath(path, timing or ff.Timing(20.0, stops=(Stop(0.4, 9.0),)))
    margin = ff.Margin(ff.singularity_measure(model, task, "gjm"), 0.0)
    return Start(ff.Problem(model, timed, task, h, margin, redundancy), attitude, joints)


def choices(structure: str, task: ff.Task, seed: int = 0) -> list[ff.Redundancy]:
    """All metrics with all objectives for an arm of this structure."""
    names = redundant(structure, task, None, seed).problem.model.joint_names
    heavy = {names[0]: 5.0, names[-1]: 0.2}
    metrics = (Metric.JOINTS, Metric.ENERGY, heavy)
    return [ff.Redundancy(metric, toward, 0.8, 2.0) for metric in metrics for toward in Toward]
