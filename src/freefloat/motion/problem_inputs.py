"""Parts of problems: from plain values, and what they require of one another."""

from __future__ import annotations

from typing import Any

import numpy as np

from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.momentum import inertia_matrices
from freefloat.dynamics.plane import Plane
from freefloat.dynamics.summary import natural_task
from freefloat.dynamics.system import System
from freefloat.dynamics.tasks import Task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import InputError
from freefloat.motion.margin import Margin
from freefloat.paths.curves import Curve
from freefloat.paths.orientation import FreeOrientation
from freefloat.paths.path import EndEffectorPath
from freefloat.paths.timed_path import TimedPath, path_key
from freefloat.paths.timing import Timing
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array

_PATH = "TimedPath(EndEffectorPath(...), Timing(...)), or an EndEffectorPath and its duration"
_VANISHING_COMPONENT = 1e-12
"""Components of momenta and velocities that are rounding, over their magnitude."""
_LEVEL = 1e-6
"""Largest distance of a path from the plane of the end-effector [m]."""
MAX_REVOLUTIONS = 50
"""Most rotations of the system along a path: the time of an integration depends on them."""


def model_of(value: Any, end_effector: str | None) -> FreeFloatingModel:
    """A robot, or the robot of a URDF with an end-effector.

    Raises:
        InputError: If the URDF is no robot, or a robot has another end-effector already.
    """
    if not isinstance(value, FreeFloatingModel):
        return FreeFloatingModel.from_urdf(value, end_effector)
    if end_effector is not None and end_effector != value.end_effector:
        accepted = f"{value.end_effector}, which the model has, or the URDF in place of the model"
        raise InputError("end_effector", f"{end_effector} was given", accepted)
    return value


def path_of(value: Any, duration: float | None) -> TimedPath:
    """A path with its timing; a path or curve without timing is followed from rest to rest [s].

    Raises:
        InputError: If it is no path, or the duration is missing or given twice.
    """
    if isinstance(value, TimedPath):
        if duration is not None:
            raise InputError("duration", "the path has a timing", "a path without one")
        return value
    path = EndEffectorPath(value) if isinstance(value, Curve) else value
    if not isinstance(path, EndEffectorPath):
        problem = "it is missing" if value is None else f"{type(value).__name__} was given"
        raise InputError("path", problem, _PATH)
    if duration is None:
        raise InputError("duration", "it is missing", "the duration of the path [s]")
    return TimedPath(path, Timing(duration))


def task_of(model: FreeFloatingModel, path: TimedPath) -> Task:
    """The task with the most rows that an arm can do along a path, which may lack orientations."""
    task = natural_task(model)
    if isinstance(path.path.orientation, FreeOrientation):
        return Task.PLANAR_POSITION if task.planar else Task.POSITION
    return task


def margin_of(model: FreeFloatingModel, task: Task | str, value: Any) -> Margin:
    """A margin, or one of the name of a measure and the value that it must keep; by default none.

    Raises:
        InputError: If it is neither, or the robot has no such measure.
    """
    if isinstance(value, Margin):
        return value
    value = ("gjm", 0.0) if value is None else value
    if not isinstance(value, tuple | list) or len(value) != 2:
        accepted = "('gjm', 0.05), a measure and its value, or a Margin"
        raise InputError("margin", f"{value!r} was given", accepted)
    return Margin(singularity_measure(model, task, value[0]), value[1])


def require_planar_vectors(key: str, plane: Plane, vectors: Array, *, along: bool) -> None:
    """Raise an InputError that names a key unless vectors (..., 3) are normal to or in a plane.

    Momenta have to be ``along`` the normal, velocities in the plane.
    """
    rows = vectors.reshape(-1, 3)
    forbidden = plane.seen(rows)[:, slice(2) if along else slice(2, 3)]
    allowed = _VANISHING_COMPONENT if plane.is_exact else plane.tolerance
    sizes = np.abs(forbidden).max(axis=1, initial=0.0) - allowed * np.linalg.norm(rows, axis=1)
    if not (sizes > 0.0).any():
        return
    components = f"{'components other than' if along else 'a component along'} {plane.axis}"
    problem = f"{rows[sizes.argmax()].tolist()} has {components} in a planar task"
    accepted = f"a vector {'along' if along else 'normal to'} {plane.axis}"
    if plane.is_exact:  # [0, 0, hz], or [vx, vy, 0]
        named, letter = zip("xyz", plane.normal == 1.0, strict=True), "h" if along else "v"
        words = (letter + axis if normal == along else "0" for axis, normal in named)
        accepted = f"[{', '.join(words)}]"
    raise InputError(key, problem, accepted)


def require_planar_system(plane: Plane, system: System) -> None:
    """Raise an InputError unless momenta and drift of a planar robot keep it in its plane."""
    require_planar_vectors("momentum", plane, system.momentum, along=True)
    require_planar_vectors("wheels.momentum", plane, system.wheels, along=True)
    require_planar_vectors("drift", plane, system.drift, along=False)


def require_planar(plane: Plane, system: System, path: TimedPath, task: Task) -> None:
    """Raise an InputError unless a planar robot and its path stay in its plane."""
    require_planar_system(plane, system)
    arms = [VirtualManipulator.of(arm) for arm in system.model.single_arms]
    for (name, own), arm in zip(path.by_arm.items(), arms, strict=True):
        _require_path_in_plane(path_key(name), plane, arm, own, task)


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
            point = f"{coordinate} = {height:.6g} m at s = {s:.2g}"
            accepted = f"a path with {coordinate} = {level:g} m everywhere"
            raise InputError(key, f"{point}, out of the plane of the end-effector", accepted)
    for s in np.linspace(0.0, 1.0, 21) if task.prescribes_orientation else ():
        upright = path.path.orientation.rotation(float(s)) @ straight.rotation.T @ normal
        if upright @ normal < 1.0 - 1e-9:
            own = straight.rotation.T @ normal
            axis = ", ".join(f"{entry:.4g}" for entry in own.round(9) + 0.0)
            problem = f"the end-effector would leave the plane at s = {s:.2g}"
            accepted = f"orientations in which ({axis}) of its frame points along {plane.axis}"
            raise InputError(f"{key}.attitude", problem, accepted)


def require_few_revolutions(system: System, duration: float) -> None:
    """Raise an InputError if a system rotates too often in a duration [s]."""
    inertia = mean_inertia(system.model)
    turns = float(revolutions(system.momentum, system.wheels, inertia, duration))
    if turns > MAX_REVOLUTIONS:
        rotated = f"{system.momentum_bound:g} N m s rotates the system {turns:.3g} times"
        accepted = f"momentum and duration of at most {MAX_REVOLUTIONS} revolutions"
        raise InputError("momentum", f"{rotated} in {duration:g} s", accepted)


def mean_inertia(model: FreeFloatingModel) -> float:
    """Mean of the robot's principal moments of inertia at zero joints [kg m²]."""
    locked_inertia, _ = inertia_matrices(model, np.zeros(model.dof))
    return float(np.trace(locked_inertia)) / 3.0


def revolutions(
    momenta: Array, wheels: Array, inertia: Array | float, duration: Array | float
) -> Array:
    """How often systems rotate along a path, shape (...).

    Angular momenta and momenta stored in wheels [N m s] have the shape (..., 3), mean moments of
    inertia [kg m²] and durations of the path [s] the shape (...).
    """
    magnitudes = np.linalg.norm(momenta, axis=-1) + np.linalg.norm(wheels, axis=-1)
    return np.asarray(magnitudes / inertia * duration / (2.0 * np.pi))
