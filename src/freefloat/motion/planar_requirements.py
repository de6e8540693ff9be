"""What a planar task requires of a robot, a path and a momentum."""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.plane import Plane
from freefloat.dynamics.system import System
from freefloat.dynamics.tasks import Task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import InputError
from freefloat.paths.timed_path import TimedPath
from freefloat.so3 import Array

_VANISHING_COMPONENT = 1e-12
"""Components of momenta and velocities that are rounding, over their magnitude."""
_LEVEL = 1e-6
"""Largest distance of a path from the plane of the end-effector [m]."""


def require_along_normal(key: str, plane: Plane, momentum: Array) -> None:
    """Raise an InputError that names a key unless momenta (..., 3) are along the plane's normal."""
    vector = _worst(plane, momentum, slice(2))
    if vector is not None:
        problem = f"{vector.tolist()} has components other than {plane.axis} in a planar task"
        raise InputError(key, problem, _vector(plane, "h", 1.0))


def require_in_plane(key: str, plane: Plane, velocity: Array) -> None:
    """Raise an InputError that names a key unless velocities (..., 3) are in the plane."""
    vector = _worst(plane, velocity, slice(2, 3))
    if vector is not None:
        problem = f"{vector.tolist()} has a component along {plane.axis} in a planar task"
        raise InputError(key, problem, _vector(plane, "v", 0.0))


def _worst(plane: Plane, vectors: Array, forbidden: slice) -> Array | None:
    """The vector with the largest of some components along the axes; None where all are zero."""
    rows = vectors.reshape(-1, 3)
    sizes = np.abs(plane.seen(rows)[:, forbidden]).max(axis=1, initial=0.0)
    allowed = _VANISHING_COMPONENT if plane.is_exact else plane.tolerance
    sizes = np.maximum(sizes - allowed * np.linalg.norm(rows, axis=1), 0.0)
    return rows[sizes.argmax()] if sizes.any() else None


def _vector(plane: Plane, letter: str, kept: float) -> str:
    """What is accepted: ``[0, 0, hz]``, or in words where the normal is no coordinate axis."""
    if not plane.is_exact:
        return f"a vector {'along' if kept else 'normal to'} {plane.axis}"
    named = zip("xyz", plane.normal, strict=True)
    return f"[{', '.join(letter + axis if entry == kept else '0' for axis, entry in named)}]"


def require_planar(plane: Plane, system: System, path: TimedPath, task: Task) -> None:
    """Raise an InputError unless the momenta and a path of a planar robot stay in its plane."""
    require_along_normal("momentum", plane, system.momentum)
    require_along_normal("wheels.momentum", plane, system.wheels)
    require_in_plane("drift", plane, system.drift)
    arms = [VirtualManipulator.of(arm) for arm in system.model.single_arms]
    keys = ["path", *(f"robot.arms.{name}.law.path" for name in path.arms)]
    for key, arm, own in zip(keys, arms, path.every, strict=True):
        _require_path_in_plane(key, plane, arm, own, task)


def _require_path_in_plane(
    key: str, plane: Plane, virtual: VirtualManipulator, path: TimedPath, task: Task
) -> None:
    """Raise an InputError that names a key unless a path stays in the plane of an arm."""
    straight, normal = virtual.pose(np.zeros(len(virtual.axes))), plane.normal
    level = round(float(normal @ straight.position), 9)
    coordinate = plane.axis if plane.is_exact else f"the coordinate along {plane.axis}"
    for s in np.linspace(0.0, 1.0, 21):
        place = path.path.curve(float(s))
        height = float(normal @ place)
        slack = 0.0 if plane.is_exact else plane.tolerance * float(np.linalg.norm(place))
        if abs(height - level) > _LEVEL + slack:
            problem = (
                f"{coordinate} = {height:.6g} m at s = {s:.2g}, out of the plane of the "
                "end-effector"
            )
            raise InputError(key, problem, f"a path with {coordinate} = {level:g} m everywhere")
    for s in np.linspace(0.0, 1.0, 21) if task.prescribes_orientation else ():
        upright = path.path.orientation.rotation(float(s)) @ straight.rotation.T @ normal
        if upright @ normal < 1.0 - 1e-9:
            own = straight.rotation.T @ normal
            axis = ", ".join(f"{entry:.4g}" for entry in own.round(9) + 0.0)
            raise InputError(
                f"{key}.attitude",
                f"the end-effector would leave the plane at s = {s:.2g}",
                f"orientations in which ({axis}) of its frame points along {plane.axis}",
            )
