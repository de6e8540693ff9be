"""A problem as the arrays that the ensemble's kernels read."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from freefloat.dynamics.arm_factor import ArmPlane
from freefloat.dynamics.link_frames import (
    LinkFrames,
    frames_at_zero,
    in_frame,
    inertial_row,
    link_frames,
)
from freefloat.dynamics.measures import KEYS, unit_of_length
from freefloat.dynamics.redundancy import (
    DAMPED_BELOW,
    Metric,
    Toward,
    joint_weights,
    range_centres,
    singular_speed,
)
from freefloat.dynamics.tasks import Task, prescribed_rows
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.ensemble.arm_moments import NO_ARMS, kernel_arms
from freefloat.ensemble.kernel_axes import KernelAxes
from freefloat.ensemble.kernels.cones import AXIS, ORIGIN, TARGET
from freefloat.ensemble.kernels.null_space import (
    BASE_RATE,
    ENERGY,
    MIDDLE_OF_RANGE,
    SIGMA,
    WEIGHTED,
)
from freefloat.ensemble.kernels.records import (
    CONE_COLUMNS,
    REACH,
    Cones,
    Course,
    Measure,
    NullSpace,
    Robot,
    SecondArm,
)
from freefloat.ensemble.kernels.records import Problem as KernelProblem
from freefloat.ensemble.kernels.steps import TABLEAU
from freefloat.ensemble.robots import robot_properties
from freefloat.errors import InputError
from freefloat.motion.pointing import AttitudeLimits, Keep
from freefloat.motion.problem import Problem
from freefloat.paths.path import EndEffectorPath
from freefloat.paths.timing import TimedPath
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import UPRIGHT, Array

_CELLS, _TANGENT_ERROR = (1, 4, 32, 256), 1e-11
"""Numbers of cubics that approximate the path's tangent, and their relative error."""
_ERROR = 100.0
"""Error of the angles of compiled motions [rad], by the tolerance of their steps."""
_NODES = np.array([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0, 0.5])
_THROUGH_NODES = np.linalg.inv(np.vander(_NODES[:4], increasing=True))
"""Maps values at the first four nodes to the cubic's coefficients, lowest power first."""


@lru_cache(maxsize=8)
def kernel_problem(problem: Problem, limits: AttitudeLimits | None = None) -> KernelProblem:
    """The arrays that the kernels read of a problem and of limits of attitude."""
    model, path = problem.chain().single_arms[0], problem.path
    frames = link_frames(model)
    robot, measure = kernel_robot(model, problem.task, problem.margin.measure.name, frames)
    limits = limits or AttitudeLimits()
    if path.arms:
        _require_two_paths(problem, limits)
        robot = _with_second_arm(problem, robot, frames)
    elif problem.arms:
        robot = _with_arms(problem, robot, frames)
    _require_own_bodies(problem.model, limits)
    cones = _cones(model, frames, limits, path.duration)
    course = _course(path.every[0], path.breaks)
    return KernelProblem(robot, course, measure, _null_space(problem), TABLEAU, cones)


def kernel_robot(
    model: FreeFloatingModel, task: Task, name: str, frames: LinkFrames
) -> tuple[Robot, Measure]:
    """The arrays of a robot, whose frames are given, of its task and of a measure by its name."""
    pointing, reach = task is Task.POINTING, VirtualManipulator.of(model).reach
    axes, (multiples, coefficients) = KernelAxes.of(model, task), np.zeros((2, 0, 2))
    if name == "arm":
        plane = ArmPlane.of(frames)
        multiples, coefficients = plane.multiples, plane.coefficients(frames.bodies)
    robot = Robot(
        frames.joints, robot_properties(axes.seen(frames.base), frames.bodies, reach, coefficients),
        frames.tool, np.array(task.rows, dtype=float), model.dof, len(task.rows), task.planar,
        pointing, singular_speed(task), frames.across, NO_ARMS, None,
    )  # fmt: skip
    return robot, Measure(KEYS.index(name), len(multiples), multiples)


def _with_arms(problem: Problem, robot: Robot, frames: LinkFrames) -> Robot:
    """The arrays of a robot with its further arms."""
    properties = robot.properties.copy()
    properties[REACH] = unit_of_length(problem.model)
    return robot._replace(properties=properties, arms=kernel_arms(problem, frames))


def _require_two_paths(problem: Problem, limits: AttitudeLimits) -> None:
    """Raise an InputError for what kernels of two arms on paths do not know."""
    key, accepted = "robot.arms", "two arms, each on a path; simulate also takes others"
    if problem.arms or len(problem.path.arms) > 1:
        moving = [*problem.path.arms, *problem.arms.curves]
        raise InputError(key, f"{', '.join(moving)} move beside the first arm", accepted)
    if limits.pointing:
        problem_text = "it was given, but two arms follow paths"
        raise InputError("limits.pointing", problem_text, "no such limit, or simulate")
    if problem.redundancy is not None and not problem.redundancy.minimum_norm:
        problem_text = "another than minimum norm was given, but two arms follow paths"
        raise InputError("redundancy", problem_text, "no such key, or simulate")


def _with_second_arm(problem: Problem, robot: Robot, frames: LinkFrames) -> Robot:
    """The arrays of a robot with a second arm that follows a path."""
    model, path = problem.chain(), problem.path.every[1]
    first, second = model.single_arms
    axes = KernelAxes.of(model, problem.task)
    behind, body = link_frames(second), model.bodies[0]
    turn = np.eye(3) if axes.plane is None else axes.plane.axes.T
    root = inertial_row(body.mass, body.centre, body.inertia)
    own, other = (
        in_frame(root, entry.base[:3], -entry.base[:3] @ entry.base[3])
        for entry in (frames, behind)
    )
    bodies = np.vstack([own, frames.bodies[1:], behind.bodies[1:]])
    reach = robot.properties[REACH]
    rows = prescribed_rows(model, problem.task)
    masses = [float(entry.bodies[1:, 0].sum()) for entry in (frames, behind)]
    return robot._replace(
        joints=np.vstack([frames.joints, behind.joints]),
        properties=robot_properties(axes.seen(frames.base), bodies, reach, np.zeros((0, 2))),
        rows=np.array(rows, dtype=float), n=model.dof, m=len(rows),
        second=SecondArm(
            first.dof, np.array(masses), in_frame(root, turn, np.zeros(3))[None], other[None],
            axes.seen(behind.base), behind.tool, behind.across, _course(path, problem.path.breaks),
        ),
    )  # fmt: skip


def _require_own_bodies(model: FreeFloatingModel, limits: AttitudeLimits) -> None:
    """Raise an InputError if limits of attitude are those of bodies of further arms."""
    for number, limit in enumerate(limits.pointing):
        if model.link_places[limit.body][0] > model.arm_dof:
            problem = f"{limit.body} is part of an arm that moves along a joint curve"
            accepted = "a link of the spacecraft or of the arm that follows the path"
            raise InputError(f"limits.pointing.{number}.body", problem, accepted)


def _cones(
    model: FreeFloatingModel, frames: LinkFrames, limits: AttitudeLimits, duration: float
) -> Cones:
    """Limits of attitude as the rows that the kernels read."""
    zero = np.zeros(model.dof)
    at_zero, base = frames_at_zero(frames), model.base_position(UPRIGHT, zero)
    poses = model.body_poses(UPRIGHT, zero)
    rows = np.zeros((len(limits.pointing), CONE_COLUMNS))
    for row, limit in zip(rows, limits.pointing, strict=True):
        number, place = model.link_places[limit.body]
        frame, pose = at_zero[number], poses[number]
        side = 1.0 if limit.keep is Keep.INSIDE else -1.0
        target = limit.direction if limit.point is None else limit.point
        origin = pose.position + pose.rotation @ place.position - base
        row[:AXIS] = number, limit.point is not None, side, np.cos(limit.angle)
        row[AXIS:ORIGIN] = frame[:3] @ pose.rotation @ place.rotation @ limit.axis
        row[ORIGIN:TARGET] = frame[:3] @ (origin - frame[3])
        row[TARGET:] = target
    if limits.base_turn is not None:
        turn = np.zeros(CONE_COLUMNS)
        turn[:AXIS] = -1.0, 0.0, 1.0, np.cos(limits.base_turn / 2.0)
        rows = np.vstack([rows, turn])
    return Cones(len(rows), duration, rows)


def spare_slacks(limits: AttitudeLimits, tolerance: float) -> Array:
    """Slacks of limits of attitude above which precise motions keep them, too, shape (L,)."""
    angles, error = np.array([limit.angle for limit in limits.pointing]), _ERROR * tolerance
    spares: Array = error * np.sin(angles)
    if limits.base_turn is None:
        return spares
    half = limits.base_turn / 2.0
    spare = np.cos(max(half - error / 2.0, 0.0)) - np.cos(half)
    return np.append(spares, spare if limits.base_turn < np.pi else -np.inf)


def _null_space(problem: Problem) -> NullSpace | None:
    redundancy = problem.redundancy
    if redundancy is None or redundancy.minimum_norm:
        return None
    centres = range_centres(problem.chain())
    codes = ((Metric.ENERGY, ENERGY), (Metric.BASE, BASE_RATE))
    metric = next((code for kind, code in codes if redundancy.metric is kind), WEIGHTED)
    toward = {Toward.NONE: 0, Toward.MANIPULABILITY: SIGMA, Toward.MIDDLE: MIDDLE_OF_RANGE}
    return NullSpace(
        metric, toward[redundancy.toward],
        float(redundancy.gain), float(redundancy.bound),
        np.array(joint_weights(problem.chain(), redundancy), dtype=float),
        np.nan_to_num(centres), np.isfinite(centres).astype(float), DAMPED_BELOW,
    )  # fmt: skip


def _course(path: TimedPath, breaks: Array) -> Course:
    """Path and timing as arrays, with segments between some breaks [s]."""
    ends = np.append(breaks, path.duration)
    starts = np.append(0.0, ends[:-1])
    segments = [
        path.timing.segments[path.timing.segment_at(t)] for t in ((starts + ends) / 2.0).tolist()
    ]
    degree = max(len(segment.orders[0]) for segment in segments) - 1
    rows: list[list[float]] = []
    cells: list[Array] = []
    for segment, start, end in zip(segments, starts.tolist(), ends.tolist(), strict=True):
        low, high = segment(start, 0), segment(end, 0)
        pieces = _tangents(path.path, low, high)
        density = len(pieces) / (high - low)
        law = [[0.0] * (degree + 1 - len(order)) + list(order) for order in segment.orders[:2]]
        counts = (float(sum(len(entry) for entry in cells)), float(len(pieces)))
        place = (end, segment.origin, 1.0 / segment.span, low, density)
        rows.append([*place, *counts, *law[0], *law[1]])
        cells.append(pieces)
    stacked = np.concatenate(cells)
    return Course(path.duration, np.array(rows), len(rows), degree, stacked, len(stacked) == 1)


def _tangents(path: EndEffectorPath, low: float, high: float) -> Array:
    """A path's tangent between two values of s as cubics of the fraction of equal intervals.

    Returns:
        Coefficients, highest power first, shape (cells, 6, 4).
    """
    tangent = path.tangent_within(low, high)
    for number in _CELLS:
        width = (high - low) / number
        nodes = low + width * (np.arange(number)[:, None] + _NODES)
        values = tangent(nodes.ravel()).reshape(number, 5, 6)
        cubics = np.einsum("pk,nki->nip", _THROUGH_NODES, values[:, :4])[..., ::-1]
        error = values[:, 4] - cubics @ (0.5 ** np.arange(3, -1, -1))
        if np.abs(error).max() <= _TANGENT_ERROR * np.abs(values).max():
            break
    return np.ascontiguousarray(cubics)
