"""What a planar task requires of a robot, a path and a momentum."""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.system import System
from freefloat.dynamics.tasks import Task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import InputError
from freefloat.paths.timing import TimedPath
from freefloat.so3 import Array


def require_in_plane(key: str, momentum: Array) -> None:
    """Raise an InputError that names a key unless a momentum (3,) is along z."""
    if momentum[0] != 0.0 or momentum[1] != 0.0:
        problem = f"{momentum.tolist()} has components other than z in a planar task"
        raise InputError(key, problem, "[0, 0, hz]")


def require_level(key: str, velocity: Array) -> None:
    """Raise an InputError that names a key unless a velocity (3,) has no component along z."""
    if velocity[2] != 0.0:
        problem = f"{velocity.tolist()} has a component along z in a planar task"
        raise InputError(key, problem, "[vx, vy, 0]")


def require_planar(system: System, path: TimedPath, task: Task) -> None:
    """Raise an InputError unless the momenta and a path of a planar robot stay in the x-y plane."""
    require_in_plane("momentum", system.momentum)
    require_in_plane("wheels.momentum", system.wheels)
    require_level("drift", system.drift)
    arms = [VirtualManipulator.of(arm) for arm in system.model.single_arms]
    keys = ["path", *(f"robot.arms.{name}.law.path" for name in path.arms)]
    for key, arm, own in zip(keys, arms, path.every, strict=True):
        _require_level_path(key, arm, own, task)


def _require_level_path(key: str, virtual: VirtualManipulator, path: TimedPath, task: Task) -> None:
    """Raise an InputError that names a key unless a path stays in the plane of an arm."""
    straight = virtual.pose(np.zeros(len(virtual.axes)))
    level = round(float(straight.position[2]), 9)
    for s in np.linspace(0.0, 1.0, 21):
        height = float(path.path.curve(float(s))[2])
        if abs(height - level) > 1e-6:
            problem = f"z = {height:.6g} m at s = {s:.2g}, out of the plane of the end-effector"
            raise InputError(key, problem, f"a path with z = {level:g} m everywhere")
    for s in np.linspace(0.0, 1.0, 21) if task.prescribes_orientation else ():
        upright = path.path.orientation.rotation(float(s)) @ straight.rotation.T
        if upright[2, 2] < 1.0 - 1e-9:
            axis = ", ".join(f"{entry:.4g}" for entry in straight.rotation[2].round(9) + 0.0)
            raise InputError(
                f"{key}.attitude",
                f"the end-effector would leave the plane at s = {s:.2g}",
                f"orientations in which ({axis}) of its frame points along z",
            )
