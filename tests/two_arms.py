"""Random robots with two arms, and their motions by an integration of our own.

One arm follows a line, the other a joint curve or a line of its own. The robot is read by
Pinocchio's own URDF reader, equation (4) is solved by pseudoinverses, and SciPy integrates it.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.motion.motion import Motion
from tests.robots import Robot, pin_configuration, random_robot

DURATION = 20.0
ROWS = {"pose": slice(0, 6), "position": slice(0, 3)}


@dataclass(frozen=True)
class Case:
    """A problem with two arms, a state at its start, and what an integration needs of both.

    ``joints`` are those of the arms that follow lines, with the ends ``lines``.
    """

    robot: Robot
    problem: ff.Problem
    attitude: np.ndarray
    joints: np.ndarray
    lines: tuple[tuple[np.ndarray, np.ndarray], ...]

    @property
    def other_end(self) -> str:
        """Last link of the other arm."""
        model = self.problem.model
        return {**model.arms, **model.path_arms}["other"]

    @property
    def curve(self) -> CubicSpline:
        """Joints of the other arm, none where it follows a line."""
        if not self.problem.robot_varies:
            return CubicSpline([0.0, DURATION], np.zeros((2, 0)))
        curve = self.problem.arms.curves["other"]
        return CubicSpline(curve.times, curve.waypoints, bc_type="clamped")


def random_case(rng: np.random.Generator, *, both: bool = False) -> Case:
    """A case of a joint curve, or of two lines; 4 to 14 joints; half of the cases have momenta."""
    task = str(rng.choice(["pose", "position"]))
    count = int(rng.integers(6, 9) if task == "pose" else rng.integers(3, 7))
    other = int(rng.integers(1, min(7, 15 - count)))
    if both:
        other = int(rng.integers(6, 15 - count) if task == "pose" else rng.integers(3, 6))

    def structure(number: int) -> str:
        return "".join(rng.choice([*"RRCCP"], number))

    robot = random_robot(rng, structure(count), structure(other), on_bus=True)
    last = f"link_{robot.others[-1].removeprefix('joint_')}"
    model = robot.model(arms={"other": last})
    times = np.array([0.0, *np.sort(rng.uniform(0.2, 0.8, 2)), 1.0]) * DURATION
    curve = ff.ArmCurve(np.cumsum(rng.normal(0.0, 0.4, (4, other)), axis=0), times)
    joints, attitude = rng.uniform(-2.0, 2.0, count), Rotation.random(rng=rng).as_quat()
    curves, every = {"other": curve}, np.append(joints, curve.waypoints[0])
    if both:
        model, curves, joints = model.with_paths("other"), {}, every
    loaded = rng.random() < 0.5
    h, w, drift = rng.normal(size=(3, 3)) * [[2.0], [1.0], [0.003]] * loaded
    paths, lines = [], []
    for start in model.end_effector_poses(attitude, every):
        lines.append((start.position, start.position + rng.normal(0.0, 0.12, 3)))
        line = ff.paths.PolynomialCurve.line(*lines[-1])
        path = ff.EndEffectorPath(line, ff.paths.FixedOrientation(start.rotation))
        paths.append(ff.TimedPath(path, ff.Timing(DURATION), drift))
    path = ff.paths.PathStack.of(paths[0], {"other": paths[1]}) if both else paths[0]
    margin = ff.Margin(ff.singularity_measure(model, task, "gjm"), 0.0)
    problem = ff.Problem(model, path, task, h, margin, wheel_momentum=w, arms=curves)
    return Case(robot, problem, attitude, joints, tuple(lines))


def own_motion(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Attitude and joints of the arms that follow lines at the end."""
    problem, spline = case.problem, case.curve
    model = pin.buildModelFromXML(case.robot.text, pin.JointModelFreeFlyer())
    ends = [case.robot.end_effector, case.other_end][: len(case.lines)]
    data, frames = model.createData(), [model.getFrameId(end) for end in ends]
    every = (*case.robot.joints, *case.robot.others)
    columns = [model.joints[model.getJointId(name)].idx_v for name in every]
    own, other = columns[: len(case.joints)], columns[len(case.joints) :]
    rows = ROWS[str(problem.task)]
    h, w, drift = problem.momentum, problem.wheel_momentum, problem.path.drift

    def slopes(t, y):
        attitude, joints = y[:4] / np.linalg.norm(y[:4]), y[4:]
        q = _configuration(model, attitude, every, [*joints, *spline(t)])
        A = pin.computeCentroidalMap(model, data, q)
        J = np.vstack([
            pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)[rows]
            for frame in frames
        ])  # fmt: skip
        tau = t / DURATION
        speed = 30.0 * tau**2 * (1.0 - tau) ** 2 / DURATION
        twist = np.concatenate([
            np.append((end - start) * speed - drift, np.zeros(3))[rows] for start, end in case.lines
        ])  # fmt: skip
        R = Rotation.from_quat(attitude).as_matrix()
        prescribed = np.append(np.zeros(3), h - R @ w) - A[:, other] @ spline(t, 1)
        base = np.linalg.inv(A[:, :6])
        S = J[:, own] - J[:, :6] @ base @ A[:, own]
        rates = np.linalg.pinv(S) @ (twist - J[:, :6] @ base @ prescribed)
        omega = (base @ (prescribed - A[:, own] @ rates))[3:]
        spin = np.append(omega, 0.0)
        x, y_, z, s = attitude
        product = np.array([[s, -z, y_, x], [z, s, -x, y_], [-y_, x, s, z], [-x, -y_, -z, s]])
        return np.concatenate([product @ spin / 2.0, rates])

    state = np.concatenate([case.attitude, case.joints])
    for start, end in pairwise(spline.x):
        state = solve_ivp(
            slopes, (start, end), state, method="DOP853", rtol=1e-12, atol=1e-13
        ).y[:, -1]  # fmt: skip
    return state[:4] / np.linalg.norm(state[:4]), state[4:]


def _configuration(model, attitude, names, values) -> np.ndarray:
    """Pinocchio's configuration, the spacecraft at the origin."""
    q = pin_configuration(model, dict(zip(names, values, strict=True)))
    q[3:7] = attitude
    return q


def tip_errors(case: Case, motion: Motion) -> tuple[float, float]:
    """Distances of both tips from where they belong, at 21 instants [m].

    Those of arms on lines are found by Pinocchio's own model; that of another one is seen from the
    spacecraft, with the joints of the curve.
    """
    problem, model, spline = case.problem, case.problem.model, case.curve
    names = (*case.robot.joints, *case.robot.others)
    pinocchio = pin.buildModelFromXML(case.robot.text, pin.JointModelFreeFlyer())
    data = pinocchio.createData()
    worst = [0.0, 0.0]
    for state in motion.sample(np.linspace(0.0, DURATION, 21)):
        exact = [*state.joints[: model.arm_dof], *spline(state.time)]
        q = _configuration(pinocchio, state.attitude, names, exact)
        com = pin.centerOfMass(pinocchio, data, q)
        pin.framesForwardKinematics(pinocchio, data, q)
        ends = [
            data.oMf[pinocchio.getFrameId(link)].translation - com
            for link in (case.robot.end_effector, case.other_end)
        ]
        tau = state.time / DURATION
        s = tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2)
        body, place = model.link_places[case.other_end]
        wanted = [start + s * (end - start) - state.time * problem.path.drift
                  for start, end in case.lines]  # fmt: skip
        wanted.append((model.body_poses(state.attitude, state.joints)[body] @ place).position)
        errors = (ends[0] - wanted[0], ends[1] - wanted[1])
        worst = [max(w, float(np.linalg.norm(e))) for w, e in zip(worst, errors, strict=True)]
    return worst[0], worst[1]
