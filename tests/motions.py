"""Problems and motions that several tests share."""

from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin
from numpy.polynomial import chebyshev
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.attitude_grids import attitude_grid
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.ensemble.endings import STEP_TOLERANCE
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.ensemble.result import EnsembleResult
from freefloat.motion.motion import Motion
from freefloat.paths import FixedOrientation, PolynomialCurve, SlerpOrientation
from freefloat.so3 import heading_quaternion, rotation_vector_between
from tests.robots import inertial_text, joint_text, link_text, numbers

GOOD = [0.46008, 0.09337, 0.73519, -0.48898]
"""Example 2: attitude from which every branch completes the path."""
BAD = [0.1, 0.5, 0.2, -0.8367]
"""Example 2: attitude from which four of eight branches become singular."""


@cache
def bundled(name: str) -> ff.Problem:
    """The problem of a bundled scenario."""
    return ff.load_scenario(name).problem()


def heading(degrees: float) -> np.ndarray:
    """Quaternion of a planar heading."""
    return heading_quaternion(np.deg2rad(degrees))


def simulated(problem: ff.Problem, attitude: object, branch: int, **options: object) -> Motion:
    """The motion of an arm branch."""
    attitude = problem.attitude(attitude)
    return ff.integrate_motion(
        problem, attitude, problem.branches(attitude)[branch].joints, **options
    )


@cache
def first_motion(problem: ff.Problem) -> Motion:
    """That of the first branch that completes the path, from one of some attitudes."""
    for attitude in (*heading_quaternion(np.linspace(0.0, 6.0, 13)), *attitude_grid(64)):
        for branch in problem.branches(attitude):
            motion = ff.integrate_motion(problem, attitude, branch.joints)
            if motion.completed:
                return motion
    raise AssertionError("none completes the path")


def compiled_motion(motion: Motion, tolerance: float = STEP_TOLERANCE) -> EnsembleResult:
    """The same motion by the compiled kernels."""
    first, integrator = motion.initial, EnsembleIntegrator(motion.problem, 1, tolerance=tolerance)
    return integrator.integrate(first.attitude[None], first.joints[None])


def lasting(problem: ff.Problem, duration: float, momentum: object = None) -> ff.Problem:
    """The same path by the quintic law in another time [s], and with another momentum."""
    path = ff.TimedPath(problem.path.path, ff.Timing(duration))
    return replace(problem, path=path, momentum=problem.momentum if momentum is None else momentum)


def along(
    model: ff.FreeFloatingModel,
    task: ff.Task,
    start: object,
    end: object,
    axes: np.ndarray,
    duration: float = 100.0,
    momentum: object = (0.0, 0.0, 0.0),
) -> ff.Problem:
    """A line at constant orientation; the margin is zero, of det A."""
    path = ff.EndEffectorPath(PolynomialCurve.line(start, end), FixedOrientation(axes))
    margin = ff.Margin(ff.singularity_measure(model, task, "system"), 0.0)
    return ff.Problem(model, ff.TimedPath(path, ff.Timing(duration)), task, momentum, margin)


def gaps(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Largest joint differences, modulo 2 pi."""
    return np.abs((a - b + np.pi) % (2.0 * np.pi) - np.pi).max(axis=-1)


def virtual_jacobian(virtual: VirtualManipulator, joints: np.ndarray) -> np.ndarray:
    """End-effector twist [linear; angular] per joint rate of the virtual arm, shape (K, 6, n)."""
    p, _, points, axes = virtual.kinematics(joints)
    columns = []
    for i, (point, axis) in enumerate(zip(points, axes, strict=True)):
        if virtual.prismatic[i]:
            columns.append(np.hstack([virtual.strokes[i] * axis, np.zeros_like(axis)]))
        else:
            columns.append(np.hstack([np.cross(axis, p - point), axis]))
    return np.stack(columns, axis=2)


def relative(actual: np.ndarray, expected: np.ndarray) -> float:
    """Largest difference relative to the largest expected entry."""
    return float(np.abs(actual - expected).max() / np.abs(expected).max())


def chain(*joints, base=(400.0, 66.67, 0.0), tool=(0.4, 0.0, 0.0)):
    """URDF text of a spacecraft with an arm.

    A joint is (type, axis, position in the previous body, mass, centre of mass, moments).
    """
    mass, moment, shift = base
    moments = np.diag([moment, 1.2 * moment, 0.9 * moment])
    text = link_text("link_0", inertial_text(mass, moments, numbers((shift, 0, 0))))
    for k, (kind, axis, place, mass, centre, moments) in enumerate(joints, start=1):
        ends = f"link_{k - 1}", f"link_{k}"
        letter = {"continuous": "C", "prismatic": "P"}[kind]
        options = {"axis": numbers(axis), "limits": (-3.0, 3.0)}
        text += joint_text(f"q{k}", letter, *ends, numbers(place), **options)
        text += link_text(ends[1], inertial_text(mass, np.diag(moments), numbers(centre)))
    text += joint_text("t", "F", f"link_{len(joints)}", "tool", numbers(tool)) + link_text("tool")
    return f'<robot name="chain">{text}</robot>'


X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)


SEVEN = chain(
    ("continuous", Z, (0.3, 0.1, 0.5), 9.0, (0.0, 0.1, 0.1), (0.3, 0.2, 0.3)),
    ("continuous", Y, (0.0, 0.0, 0.3), 8.0, (0.1, 0.0, 0.0), (0.2, 0.3, 0.3)),
    ("continuous", X, (0.2, 0.0, 0.0), 22.0, (0.6, 0.05, 0.0), (0.3, 2.5, 2.4)),
    ("continuous", Y, (1.2, 0.1, 0.0), 18.0, (0.5, -0.05, 0.0), (0.2, 1.9, 2.0)),
    ("continuous", X, (1.1, 0.0, 0.0), 6.0, (0.1, 0.0, 0.05), (0.1, 0.1, 0.15)),
    ("continuous", Y, (0.2, 0.0, 0.0), 5.0, (0.1, 0.0, 0.0), (0.1, 0.1, 0.1)),
    ("continuous", Z, (0.2, 0.0, 0.0), 4.0, (0.15, 0.0, 0.0), (0.05, 0.1, 0.1)),
    base=(300.0, 60.0, 0.05),
)


PRISMATIC_ARM = chain(
    ("continuous", Z, (0.2, 0.1, 0.5), 10.0, (0.0, 0.0, 0.1), (0.3, 0.3, 0.2)),
    ("continuous", (0, -1, 0), (0.1, 0.0, 0.2), 20.0, (0.5, 0.0, 0.0), (0.2, 1.5, 1.5)),
    ("prismatic", X, (0.8, 0.0, 0.0), 15.0, (0.3, 0.0, 0.05), (0.1, 0.9, 0.9)),
)


def two(aside):
    """The 40/4/3 arm, links of 1 m, its end-effector to the side of the second link."""
    return chain(
        ("continuous", Z, (0.5, 0, 0), 4.0, (0.5, 0, 0), (0.01, 0.333, 0.333)),
        ("continuous", Z, (1.0, 0, 0), 3.0, (0.5, 0, 0), (0.01, 0.25, 0.25)),
        base=(40.0, 6.667 / 0.9, 0.0), tool=(1.0, aside, 0),
    )  # fmt: skip


def problem_with(model, task, momentum, curve, attitude, timing):
    """A problem without a margin."""
    path = ff.TimedPath(ff.EndEffectorPath(curve, attitude), timing)
    return ff.Problem(
        model, path, task, momentum, ff.Margin(ff.singularity_measure(model, task, "gjm"), 0.0)
    )


def from_here(model, task, momentum, attitude, joints, step, vector, timing):
    """A problem whose path, a line with a slerp, begins where the end-effector is."""
    pose = model.end_effector_pose(attitude, joints)
    line = PolynomialCurve.line(pose.position, pose.position + step)
    end = Rotation.from_rotvec(vector).as_matrix() @ pose.rotation
    return problem_with(model, task, momentum, line, SlerpOrientation(pose.rotation, end), timing)


def tracking(motion, times):
    """Largest distance and angle between end-effector and path at given times, by Pinocchio."""
    model, worst = motion.problem.model.pin_model, np.zeros(2)
    data, tool = model.createData(), motion.problem.model.frame_id
    rows = [row for row in motion.problem.task.rows if row < 3]
    for state in motion.sample(times):
        q = np.concatenate([state.base_position, state.attitude, state.joints])
        pin.framesForwardKinematics(model, data, q)
        pose = motion.problem.path.pose(state.time)
        offset = (data.oMf[tool].translation - pose.position)[rows]
        angle = np.linalg.norm(rotation_vector_between(data.oMf[tool].rotation, pose.rotation))
        worst = np.maximum(worst, [np.linalg.norm(offset), angle])
    return worst


def on_side(problem, degrees, sign):
    """The motion of the branch whose S begins with a sign."""
    attitude = heading(degrees)
    for branch in problem.branches(attitude):
        if problem.margin.measure(branch.joints) * sign > 0:
            return ff.integrate_motion(problem, attitude, branch.joints)
    raise AssertionError("no branch of that sign")


def seven(task, momentum):
    model = ff.FreeFloatingModel.from_urdf(SEVEN, "tool")
    attitude = Rotation.from_rotvec([0.4, -0.3, 0.9]).as_quat()
    joints = np.array([0.3, -0.9, 0.4, 1.5, -0.3, 0.8, 0.5])
    step, vector = [-0.4, 0.3, -0.3], [0.2, -0.3, 0.4]
    problem = from_here(model, task, momentum, attitude, joints, step, vector, ff.Timing(40.0))
    return problem, attitude, joints


WINDOW = 0.5
"""Half the time over which a motion is differentiated [s]."""


def differentiated(motion, t):
    """State at a time and its first two derivatives: Chebyshev fit of samples of the motion."""
    places = chebyshev.chebpts1(15)
    states = motion.sample(t + WINDOW * places)
    rows = [np.concatenate([s.base_position, s.attitude, s.joints]) for s in states]
    fit = chebyshev.chebfit(places, np.array(rows), 6)
    return [chebyshev.chebval(0.0, chebyshev.chebder(fit, k)) / WINDOW**k for k in range(3)]
