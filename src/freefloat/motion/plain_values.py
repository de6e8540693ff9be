"""Parts of problems from plain values: a URDF, a path and its duration, the name of a measure."""

from __future__ import annotations

from typing import Any

from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.summary import natural_task
from freefloat.dynamics.tasks import Task
from freefloat.errors import InputError
from freefloat.motion.arm_curves import ArmCurves
from freefloat.motion.margin import Margin
from freefloat.paths.curves import Curve
from freefloat.paths.orientation import FreeOrientation
from freefloat.paths.path import EndEffectorPath
from freefloat.paths.timed_path import TimedPath
from freefloat.paths.timing import Timing
from freefloat.robot.model import FreeFloatingModel

_PATH = "TimedPath(EndEffectorPath(...), Timing(...)), or an EndEffectorPath and its duration"


def model_of(value: Any, end_effector: str | None) -> FreeFloatingModel:
    """A robot, or the one of a URDF with an end-effector.

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
    """A path with its timing, or one of a path or curve that is followed from rest to rest [s].

    Raises:
        InputError: If it is no path, or the duration is missing or given twice.
    """
    if isinstance(value, TimedPath):
        if duration is not None:
            raise InputError("duration", "the path has a timing", "a path without one")
        return value
    path = EndEffectorPath(value) if isinstance(value, Curve) else value
    if not isinstance(path, EndEffectorPath):
        given = "it is missing" if value is None else f"{type(value).__name__} was given"
        raise InputError("path", given, _PATH)
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
    if value is None:
        value = "gjm", 0.0
    if not isinstance(value, tuple | list) or len(value) != 2:
        accepted = "('gjm', 0.05), a measure and its value, or a Margin"
        raise InputError("margin", f"{value!r} was given", accepted)
    return Margin(singularity_measure(model, task, value[0]), value[1])


def arms_of(value: Any) -> ArmCurves:
    """Joint curves of further arms, or those of a mapping from names of arms to curves."""
    return value if isinstance(value, ArmCurves) else ArmCurves(value or {})
