"""A problem as the arrays that the ensemble's kernels read."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from freefloat.dynamics.arm_factor import ArmPlane
from freefloat.dynamics.denavit_hartenberg import LinkFrames, frames_at_zero, in_frame, link_frames
from freefloat.dynamics.kernels.robot import REACH, FurtherArms, Robot
from freefloat.dynamics.measures import KEYS, unit_of_length
from freefloat.dynamics.redundancy import Metric, Toward, joint_weights, range_centres
from freefloat.dynamics.robot_arrays import KernelAxes, kernel_robot, spacecraft_moments
from freefloat.dynamics.tasks import Task
from freefloat.ensemble.kernels.cones import AXIS, ORIGIN, TARGET
from freefloat.ensemble.kernels.dormand_prince import TABLEAU
from freefloat.ensemble.kernels.null_space import ENERGY, MIDDLE_OF_RANGE, SIGMA, WEIGHTED
from freefloat.ensemble.kernels.records import (
    CONE_COLUMNS,
    Cones,
    Course,
    Measure,
    NullSpace,
    ProblemTables,
)
from freefloat.errors import InputError
from freefloat.motion.pointing import AttitudeLimits, Keep
from freefloat.motion.problem import Problem
from freefloat.paths.path import EndEffectorPath
from freefloat.paths.timed_path import TimedPath
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import UPRIGHT, Array

_ARM_CELLS, _MOMENT_ERROR = (64, 256, 1024), 1e-10
"""Numbers of cubics that approximate the moments over the duration, and their relative error."""
NODES = np.array([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0, 0.5])
"""Fractions of a cell: four nodes of a cubic, and a place where its error is known."""
_THROUGH_NODES = np.linalg.inv(np.vander(NODES[:4], increasing=True))
"""Maps values at the first four nodes to the cubic's coefficients, lowest power first."""
_CELLS, _TANGENT_ERROR = (1, 4, 32, 256), 1e-11
"""Numbers of cubics that approximate the path's tangent, and their relative error."""
_ROUGH = 1e-8
"""Relative error from which a path is refused: it has breaks that it does not name."""
_ERROR = 100.0
"""Error of the angles of compiled motions [rad], by the tolerance of their steps."""


def kernel_arms(problem: Problem, frames: LinkFrames) -> FurtherArms:
    """Moments of the spacecraft with the further arms of a problem, which move along joint curves.

    Seen from the spacecraft, these arms change its first moment and inertia, and have a linear and
    an angular momentum of their own; equation (4) knows nothing else of them.

    Args:
        problem: Robot and joint curves.
        frames: Link frames of the robot whose further arms are fixed.
    """
    axes, origin = frames.base[:3], frames.base[3]
    for number in _ARM_CELLS:
        times = (np.arange(number)[:, None] + NODES) * (problem.path.duration / number)
        joints, rates = (problem.arms.at(times, order) for order in (0, 1))
        rows, momenta = spacecraft_moments(problem.model, joints, rates)
        momenta = KernelAxes.of(problem.model, problem.task).plane.seen(momenta)
        rows = in_frame(rows, axes, -axes @ origin)
        values = np.concatenate([rows[..., 1:4], momenta, rows[..., 4:]], axis=-1)
        cubics, error = cubics_through(values)
        size = np.abs(values).max(axis=(0, 1)) + np.abs(values[..., 3:]).max()
        if (error.max(axis=0) <= _MOMENT_ERROR * size).all():
            break
    return FurtherArms(number, number / problem.path.duration, cubics)


def cubics_through(values: Array) -> tuple[Array, Array]:
    """Cubics through values at ``NODES`` of cells, shape (cells, 5, m).

    Returns:
        Coefficients, highest power first, shape (cells, m, 4), and errors at the last of the nodes,
        shape (cells, m).
    """
    cubics = np.einsum("pk,nki->nip", _THROUGH_NODES, values[:, :4])[..., ::-1]
    error = np.abs(values[:, 4] - cubics @ (0.5 ** np.arange(3, -1, -1)))
    return np.ascontiguousarray(cubics), error


@lru_cache(maxsize=8)
def kernel_problem(problem: Problem, limits: AttitudeLimits | None = None) -> ProblemTables:
    """The arrays that the kernels read of a problem and of limits of attitude."""
    model, path, limits = problem.model_at(), problem.path, limits or AttitudeLimits()
    if len(path.by_arm) > 1:
        _require_two_paths(problem, limits)
    frames = link_frames(model.single_arms[0])
    robot, measure = kernel_measure(model, problem.task, problem.margin.measure.name, frames)
    if problem.robot_varies:
        properties = robot.properties.copy()
        properties[REACH] = unit_of_length(problem.model, problem.task)
        robot = robot._replace(properties=properties, further=kernel_arms(problem, frames))
    _require_own_bodies(problem.model, limits)
    cones = _cones(model.single_arms[0], frames, limits, path.duration)
    course = _course([*path.by_arm.values()], path.breaks)
    return ProblemTables(robot, course, measure, _null_space(problem), TABLEAU, cones)


def kernel_measure(
    model: FreeFloatingModel, task: Task, name: str, frames: LinkFrames
) -> tuple[Robot, Measure]:
    """The arrays of a robot, whose frames are given, with its task, and of a measure."""
    multiples, coefficients = np.zeros((2, 0, 2))
    if name == "arm":
        plane = ArmPlane.of(frames)
        multiples, coefficients = plane.multiples, plane.coefficients(frames.bodies)
    robot = kernel_robot(model, task, coefficients)
    return robot, Measure(KEYS.index(name), len(multiples), multiples)


def _require_two_paths(problem: Problem, limits: AttitudeLimits) -> None:
    """Raise an InputError for what kernels of two arms on paths do not know."""
    key, accepted = "robot.arms", "two arms, each on a path; simulate also takes others"
    if len(further := problem.model.further_arms) > 1:
        raise InputError(key, f"{', '.join(further)} move beside the first arm", accepted)
    if limits.pointing:
        problem_text = "it was given, but two arms follow paths"
        raise InputError("limits.pointing", problem_text, "no such limit, or simulate")
    if problem.redundancy is not None and not problem.redundancy.minimum_norm:
        problem_text = "another than minimum norm was given, but two arms follow paths"
        raise InputError("redundancy", problem_text, "no such key, or simulate")


def _require_own_bodies(model: FreeFloatingModel, limits: AttitudeLimits) -> None:
    """Raise an InputError if limits of attitude concern bodies of further arms."""
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
        turn[:AXIS] = -1.0, 0.0, 1.0, limits.turn_cosine
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
    centres = range_centres(problem.model_at())
    metric = ENERGY if redundancy.metric is Metric.ENERGY else WEIGHTED
    toward = {Toward.NONE: 0, Toward.MANIPULABILITY: SIGMA, Toward.MIDDLE: MIDDLE_OF_RANGE}
    return NullSpace(
        metric, toward[redundancy.toward],
        float(redundancy.gain), float(redundancy.bound),
        np.array(joint_weights(problem.model_at(), redundancy), dtype=float),
        np.nan_to_num(centres), np.isfinite(centres).astype(float),
    )  # fmt: skip


def _course(paths: Sequence[TimedPath], breaks: Array) -> Course:
    """Paths and their timing as arrays, with segments between some breaks [s]."""
    duration = paths[0].duration
    ends = np.append(breaks, duration)
    starts = np.append(0.0, ends[:-1])
    segments = [
        (path, path.timing.segments[path.timing.segment_at(t)], *span)
        for path in paths
        for t, *span in zip((starts + ends) / 2.0, starts.tolist(), ends.tolist(), strict=True)
    ]
    degree = max(len(segment.orders[0]) for _, segment, *_ in segments) - 1
    rows: list[list[float]] = []
    cells: list[Array] = []
    for path, segment, start, end in segments:
        low, high = segment(start, 0), segment(end, 0)
        pieces = _tangents(path.path, low, high)
        density = len(pieces) / (high - low)
        law = [[0.0] * (degree + 1 - len(order)) + list(order) for order in segment.orders[:2]]
        counts = (float(sum(len(entry) for entry in cells)), float(len(pieces)))
        place = (end, segment.origin, 1.0 / segment.span, low, density)
        rows.append([*place, *counts, *law[0], *law[1]])
        cells.append(pieces)
    stacked = np.concatenate(cells)
    return Course(duration, np.array(rows), len(starts), degree, stacked, len(stacked) == 1)


def _tangents(path: EndEffectorPath, low: float, high: float) -> Array:
    """A path's tangent between two values of s as cubics of the fraction of equal intervals.

    Returns:
        Coefficients, highest power first, shape (cells, 6, 4).
    """
    tangent = path.tangent_within(low, high)
    for number in _CELLS:
        width = (high - low) / number
        nodes = low + width * (np.arange(number)[:, None] + NODES)
        values = tangent(nodes.ravel()).reshape(number, 5, 6)
        cubics, error = cubics_through(values)
        deviation = float(error.max() / np.abs(values).max())
        if deviation <= _TANGENT_ERROR:
            break
    if deviation > _ROUGH:
        problem = f"its tangent between s = {low:.4g} and {high:.4g} is no smooth function of s"
        accepted = "a curve and an orientation with breaks: where third derivatives jump"
        raise InputError("path", problem, accepted)
    return cubics
