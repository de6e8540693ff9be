"""Robots and the ends of a trajectory as a model of MuJoCo (MJCF)."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np

from freefloat.errors import InputError
from freefloat.io.formats.trajectory import Trajectory
from freefloat.robot.mjcf_writer import attribute, robot_mjcf, why_refused
from freefloat.rotations import rotation_matrix
from freefloat.so3 import Array


def mjcf_text(trajectory: Trajectory) -> str:
    """Text of a model with a motor for each joint, without gravity and contacts.

    The key frames ``initial`` and ``final`` are the first and the last state of the trajectory. All
    meshes are in the file; those that cannot be read are left out.

    Raises:
        InputError: If MuJoCo has no model of the robot: wheels store momentum, or an inertia
            violates the triangle inequality.
    """
    _require_representable(trajectory)
    root = robot_mjcf(trajectory.motion.problem.model)
    keys = ET.SubElement(root, "keyframe")
    for name, k in (("initial", 0), ("final", -1)):
        ET.SubElement(keys, "key", {"name": name, **_state(trajectory, k)})
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _require_representable(trajectory: Trajectory) -> None:
    problem = trajectory.motion.problem
    if problem.wheel_momentum.any():
        accepted = "for mjcf a spacecraft whose wheels store no momentum"
        raise InputError("format", "wheels store momentum", accepted)
    refused = why_refused(problem.model)
    if refused is not None:
        accepted = "for mjcf other names, and inertias that bodies of matter have"
        raise InputError("format", refused, accepted)


def _state(trajectory: Trajectory, k: int) -> dict[str, str]:
    """A state of the trajectory; rates without a bound, at a singularity, are zero."""
    attitude = trajectory.attitudes[k]
    omega = rotation_matrix(attitude).T @ trajectory.angular_velocities[k]
    place, velocity = trajectory.base_positions[k], trajectory.base_velocities[k]
    position = [place, np.roll(attitude, 1), trajectory.joints[k]]
    rates: list[Array] = [velocity, omega, trajectory.joint_rates[k]]
    problem = trajectory.motion.problem
    if problem.model.on_table:
        headings = np.unwrap([problem.plane.heading(each) for each in trajectory.attitudes])
        position = [place[:2], headings[[k]], trajectory.joints[k]]
        rates = [velocity[:2], omega[2:], trajectory.joint_rates[k]]
    return {
        "qpos": attribute(np.concatenate(position)),
        "qvel": attribute(np.nan_to_num(np.concatenate(rates))),
        "ctrl": attribute(np.nan_to_num(trajectory.joint_torques[k])),
    }
