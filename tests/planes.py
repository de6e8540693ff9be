"""Planar arms about any direction, and the same arms about z."""

import numpy as np
from scipy.spatial.transform import Rotation

import freefloat as ff
from tests.robots import inertial_text, joint_text, link_text, numbers

DIRECTIONS = {
    "x": (1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
    "oblique": (0.6, -0.48, 0.64),
}


def turn_to(direction: str, about: float = 0.4) -> np.ndarray:
    """A rotation (3, 3) that takes z to a direction, with an angle about z before."""
    goal = np.array(DIRECTIONS[direction])
    turn, _ = Rotation.align_vectors([goal], [[0.0, 0.0, 1.0]])
    exact = turn.as_matrix().round(15) if direction != "oblique" else turn.as_matrix()
    return exact @ Rotation.from_euler("z", about).as_matrix()


def planar_arm(seed: int, joints: str, turn: np.ndarray) -> str:
    """A random arm in the plane normal to z, seen from a spacecraft whose axes are turned.

    Args:
        seed: Of lengths, masses and inertias.
        joints: A letter for each: ``+`` and ``-`` turn about z and against it, ``p`` slides in
            the plane.
        turn: Rotation (3, 3) from the axes of the arm to those of the spacecraft.
    """
    rng = np.random.default_rng(seed)
    rpy = numbers(Rotation.from_matrix(turn).as_euler("xyz"))
    moments = np.diag(rng.uniform(4.0, 8.0, 3))
    centre = [*rng.uniform(-0.1, 0.1, 2), 0.0]
    text = link_text("bus", inertial_text(60.0, moments, numbers(turn @ centre), rpy))
    parent = "bus"
    for number, kind in enumerate(joints, start=1):
        place = np.array([*rng.uniform((0.5, -0.2), (0.9, 0.2)), 0.0])
        angle, axis = rng.uniform(-1.0, 1.0), {"+": "0 0 1", "-": "0 0 -1", "p": "1 0 0"}[kind]
        frame = Rotation.from_euler("z", angle).as_matrix()
        if parent == "bus":
            place, frame = turn @ place, turn @ frame
        origin = numbers(place), numbers(Rotation.from_matrix(frame).as_euler("xyz"))
        name, shape = f"link_{number}", "P" if kind == "p" else "C"
        text += joint_text(f"q{number}", shape, parent, name, *origin, axis, (-0.6, 0.6))
        moments = np.diag(rng.uniform(0.2, 0.4, 3))
        own = numbers([*rng.uniform((0.2, -0.1), (0.5, 0.1)), 0.0])
        text += link_text(name, inertial_text(rng.uniform(3.0, 6.0), moments, own))
        parent = name
    tool = "0.5 0.1 0", f"0.3 0 {rng.uniform(-1.0, 1.0)!r}"
    text += joint_text("tool_joint", "F", parent, "tool", *tool) + link_text("tool")
    return f'<robot name="arm">{text}</robot>'


def planar_problem(
    seed: int, joints: str, turn: np.ndarray, task: str, measure: str, momentum: float = 0.3
) -> ff.Problem:
    """A short path of :func:`planar_arm` from heading 0.5, with a small margin."""
    model = ff.FreeFloatingModel.from_urdf(planar_arm(seed, joints, turn), "tool")
    level = ff.FreeFloatingModel.from_urdf(planar_arm(seed, joints, np.eye(3)), "tool")
    q = np.array([0.3 if kind == "p" else 0.8 for kind in joints])
    pose = level.end_effector_pose([0.0, 0.0, np.sin(0.25), np.cos(0.25)], q)
    step = np.array([0.15, -0.25, 0.0])
    line = ff.paths.PolynomialCurve.line(turn @ pose.position, turn @ (pose.position + step))
    held = ff.paths.FixedOrientation(turn @ pose.rotation @ turn.T @ turn)
    path = ff.TimedPath(ff.EndEffectorPath(line, held), ff.Timing(20.0))
    value = ff.singularity_measure(level, task, measure)
    margin = ff.Margin(ff.singularity_measure(model, task, measure), 0.3 * abs(value(q)))
    return ff.Problem(model, path, task, turn @ [0.0, 0.0, momentum], margin)
