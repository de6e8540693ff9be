"""Random problems: arms of many kinds, short paths from a random state, measures and margins."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.dynamics.measures import singularity_measure
from freefloat.motion.problem import Problem
from freefloat.paths.curves import PolynomialCurve
from freefloat.paths.orientation import FixedOrientation
from freefloat.robot.named_files import find_robot
from freefloat.robot.parts import Attachment, Mount
from freefloat.so3 import heading_quaternion

sys.path.append(str(Path(__file__).resolve().parents[2]))
from tests.robots import planar_robot, random_robot

ARMS = {
    **{(f"planar {n}", task): n for n in (2, 3, 4, 5) for task in ("planar-position",)},
    **{(f"planar {n}", task): n for n in (3, 4, 5) for task in ("planar-pose",)},
    ("RRR", "position"): 3, ("RRRR", "position"): 4, ("RPRR", "position"): 4,
    ("elbow", "pose"): 6, ("RRRRRR", "pose"): 6, ("RRRRRRR", "pose"): 7,
}  # fmt: skip
"""Kinds of arms and tasks, and their numbers of joints."""


def random_model(rng: np.random.Generator, kind: str) -> ff.FreeFloatingModel:
    """A random arm: planar, with an elbow and a spherical wrist, or of a structure."""
    if kind == "elbow":
        return ff.load_scenario("spatial_6dof/line").problem().model
    if not kind.startswith("planar"):
        robot = random_robot(rng, kind)
        return ff.FreeFloatingModel.from_urdf(robot.text, robot.end_effector)
    n = int(kind.split()[1])
    lengths = np.concatenate([[rng.uniform(0.2, 0.8)], rng.uniform(0.3, 1.5, n)])
    masses = np.concatenate([[rng.uniform(30, 300)], rng.uniform(2, 40, n)])
    moments = masses * np.maximum(lengths, 0.3) ** 2 * rng.uniform(0.08, 0.3, n + 1)
    half = 0.5 * lengths[1:]
    urdf = planar_robot(masses, moments, before=half, after=[lengths[0], *half])
    return ff.FreeFloatingModel.from_urdf(urdf, "end_effector")


LAWS = ("held", "curve", "path")
"""What moves the second of two arms."""


def random_two_arms(rng: np.random.Generator) -> tuple[str, Problem, ff.Search]:
    """A problem of two arms, the second of which is held, on a joint curve, or on a line."""
    planar, law = bool(rng.integers(2)), str(rng.choice(LAWS))
    if planar:
        mount = Mount([-0.3, 0.0, 0.0], [0.0, 0.0, np.pi])
        attached = [Attachment(find_robot("planar_2dof", Path()), None, mount, "other_")]
        scale = {link: float(rng.uniform(0.5, 4.0)) for link in ("link_1", "other_link_2")}
        model = ff.FreeFloatingModel.from_urdf(
            "planar_2dof", "end_effector", arms={"other": "other_end_effector"},
            attached=attached, scale_mass=scale,
        )  # fmt: skip
    else:
        robot = random_robot(rng, "RRRF", "RRRF", on_bus=True)
        arms = {"other": re.findall(r'<link name="(\w+)"', robot.text)[-1]}
        model = ff.FreeFloatingModel.from_urdf(robot.text, robot.end_effector, arms=arms)
    joints, duration = rng.uniform(-2.0, 2.0, model.dof), float(rng.uniform(20.0, 100.0))
    end = joints[model.arm_dof :]
    curves = {"other": ff.ArmCurve.evenly([end, end + rng.normal(0, 0.6, len(end))], duration)}
    if law == "held":
        model, joints, curves = model.with_arms_at(end), joints[: model.arm_dof], {}
    if law == "path":
        model, curves = model.with_paths("other"), {}
    task = ff.Task("planar-position" if planar else "position")
    h = rng.choice([0.0, 1.0]) * rng.normal(size=3) * ([0, 0, 1] if planar else 0.3)
    attitude = Rotation.random(rng=rng).as_quat()
    if planar:
        attitude = heading_quaternion(float(rng.uniform(0, 6)))
    timing, paths = ff.Timing(duration), []
    for pose in model.end_effector_poses(attitude, joints):
        way = rng.normal(size=3) * (np.array([0.3, 0.3, 0.0]) if planar else 0.15)
        line = PolynomialCurve.line(pose.position, pose.position + way)
        paths.append(ff.TimedPath(ff.EndEffectorPath(line), timing))
    path = ff.paths.PathStack.of(paths[0], {"other": paths[1]}) if paths[1:] else paths[0]
    measure = singularity_measure(model, task, str(rng.choice(["gjm", "sigma", "system"])))
    margin = ff.Margin(measure, float(rng.uniform(0.02, 0.25) * abs(measure(joints))))
    problem = Problem(model, path, task, h, margin, arms=curves)
    objective = str(rng.choice(["margin", "robust"]))
    text = f"{law} {task} {measure.name} {objective}" + (" h" if h.any() else "")
    if planar:
        return text, problem, ff.Search(objective, samples=90)
    return text, problem, ff.Search(objective, attitude, samples=128, within=0.5)


def random_problem(rng: np.random.Generator) -> tuple[str, Problem, ff.Search]:
    """A line or parabola from a random state, with momentum or not, a measure and a margin."""
    (kind, name), n = list(ARMS.items())[rng.integers(len(ARMS))]
    model, task = random_model(rng, kind), ff.Task(name)
    h = rng.choice([0.0, 1.0]) * 0.5 * rng.normal(size=3)
    way = rng.normal(size=3) * rng.uniform(0.1, 0.8)
    attitude = Rotation.random(rng=rng).as_quat()
    if task.planar:
        attitude, h, way = (
            heading_quaternion(float(rng.uniform(0, 6))),
            h * [0, 0, 4],
            way * [1, 1, 0],
        )
    names = ["gjm", "sigma", "system", *(["arm"] * 2 if kind == "elbow" else [])]
    measure = singularity_measure(model, task, str(rng.choice(names)))
    joints = rng.uniform(-2.5, 2.5, n)
    pose = model.end_effector_pose(attitude, joints)
    curve = PolynomialCurve(np.array([pose.position, way, 0.5 * rng.normal() * way[[1, 0, 2]]]))
    path = ff.EndEffectorPath(curve, FixedOrientation(pose.rotation))
    margin = ff.Margin(measure, float(rng.uniform(0.03, 0.5) * abs(measure(joints))))
    timed = ff.TimedPath(path, ff.Timing(float(rng.uniform(20.0, 150.0))))
    problem = Problem(model, timed, task, h, margin)
    objective = str(rng.choice(["margin", "robust"]))
    samples = int(rng.choice([24, 90, 360])) if task.planar else 256
    text = f"{kind} {name} {measure.name} {objective} {samples}" + (" h" if h.any() else "")
    return text, problem, ff.Search(objective, samples=samples)
