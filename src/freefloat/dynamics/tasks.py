"""Tasks: what of the end-effector's motion is prescribed, and what that requires of a robot."""

from __future__ import annotations

from enum import StrEnum

import pinocchio as pin

from freefloat.dynamics.plane import Plane, plane_of, why_in_no_plane
from freefloat.errors import InputError, member
from freefloat.robot.model import FreeFloatingModel, require_model
from freefloat.so3 import Array


class Task(StrEnum):
    """Part of the end-effector's motion that is prescribed.

    Pointing prescribes the position and the direction of the end-effector's z axis; the rotation
    about that axis, the roll, is free. The planar tasks belong to arms that move in a plane, with
    the spacecraft rotating about its normal, see :class:`.Plane`.

    Example:
        >>> ff.Task("planar-position").rows
        [0, 1]
    """

    POSE = "pose"
    POINTING = "pointing"
    POSITION = "position"
    PLANAR_POSE = "planar-pose"
    PLANAR_POSITION = "planar-position"

    @classmethod
    def of(cls, task: Task | str) -> Task:
        """The task with a value such as ``"position"``; a task itself is returned unchanged.

        Raises:
            InputError: If there is no such task.
        """
        return member("task", cls, task)

    @property
    def rows(self) -> list[int]:
        """Rows of the end-effector twist ``[linear; angular]`` that are prescribed.

        Rows of ``pointing`` belong to the twist in the axes of the end-effector, rows of planar
        tasks to the twist in the axes of the plane.
        """
        return _ROWS[self]

    planar: bool
    """Whether the motion is confined to a plane."""
    reference_frame: pin.ReferenceFrame
    """Axes of the rows: the end-effector's axes for ``pointing``, otherwise the inertial axes."""

    def __init__(self, value: str) -> None:
        self.planar = value.startswith("planar-")
        self.reference_frame = pin.LOCAL if value == "pointing" else pin.LOCAL_WORLD_ALIGNED

    @property
    def prescribes_orientation(self) -> bool:
        """Whether the orientation of the end-effector, or of its z axis, is prescribed."""
        return self in (Task.POSE, Task.POINTING, Task.PLANAR_POSE)


_ROWS = {
    Task.POSE: [0, 1, 2, 3, 4, 5],
    Task.POINTING: [0, 1, 2, 3, 4],
    Task.POSITION: [0, 1, 2],
    Task.PLANAR_POSE: [0, 1, 5],
    Task.PLANAR_POSITION: [0, 1],
}


def prescribed_rows(model: FreeFloatingModel, task: Task) -> list[int]:
    """Rows of the twists of all end-effectors that follow paths, one after the other."""
    arms = range(len(model.end_effector_links))
    return [6 * arm + row for arm in arms for row in task.rows]


def base_rotations(model: FreeFloatingModel, task: Task) -> int:
    """Number of axes about which the spacecraft turns: 1 in the plane and on a table, otherwise 3.

    It is the last axis, the plane's normal.
    """
    return 1 if task.planar or model.on_table else 3


def task_rows(model: FreeFloatingModel, task: Task, twists: Array) -> Array:
    """The task's rows of twists in the task's reference frame, one below the other for each arm.

    Args:
        model: Robot.
        task: Task.
        twists: Shape (6 e, ...), for e end-effectors.

    Returns:
        Shape (m, ...).
    """
    if task.planar:
        twists = required_plane(model, task).rows(twists)
    return twists if task is Task.POSE else twists[prescribed_rows(model, task)]


def applicable(model: FreeFloatingModel, task: Task | str) -> Task:
    """The task, which may be given by its value; an InputError if a robot cannot have it."""
    if not isinstance(model, FreeFloatingModel):  # a call costs more than the question
        require_model(model)
    task = task if isinstance(task, Task) else Task.of(task)
    if task.planar:
        required_plane(model, task)
    return task


def required_plane(model: FreeFloatingModel, task: Task) -> Plane:
    """The plane of a planar task; an InputError if the robot does not stay in one."""
    plane = plane_of(model)
    if plane is not None and model.on_table and not plane.is_level:
        problem = f"{task}, but the arm moves in the {plane.name} and the table is the x-y plane"
        raise InputError("task", problem, accepted_tasks(model))
    if plane is None:
        raise InputError(
            "task",
            f"{task}, but this robot does not stay in a plane: {why_in_no_plane(model)}",
            accepted_tasks(model),
        )
    return plane


def require_task(model: FreeFloatingModel, task: Task | str) -> Task:
    """The applicable task; an InputError if it prescribes more rates than an arm has joints."""
    task = applicable(model, task)
    joints = min(arm.dof for arm in model.single_arms)
    if len(task.rows) > joints:
        raise InputError(
            "task",
            f"{task} prescribes {len(task.rows)} rates, the arm has {joints} joints",
            accepted_tasks(model),
        )
    return task


def accepted_tasks(model: FreeFloatingModel) -> str:
    """The tasks that a robot can have, as words of a message; what these need where it has none."""
    joints, planar = min(arm.dof for arm in model.single_arms), plane_of(model) is not None
    names = [str(task) for task in Task if len(task.rows) <= joints and task.planar is planar]
    return ", ".join(names) or _NEEDED


_NEEDED = (
    "an arm with 3 joints or more for position, 5 for pointing, 6 for pose; 2 for planar-position "
    "or 3 for planar-pose where it stays in a plane: with parallel joint axes and masses "
    "symmetric about the plane normal to them"
)
