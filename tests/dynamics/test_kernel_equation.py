"""The compiled equation (4) against Pinocchio and LAPACK, robot by robot, number by number."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from freefloat.dynamics.kernels.elimination import eliminate
from freefloat.dynamics.kernels.equation import (
    DQ,
    JAC,
    OMEGA,
    TIP,
    WORK_COLUMNS,
    D,
    configure,
    form_jacobian,
    solve_rates,
)
from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.momentum import (
    Task,
    generalized_determinant,
    generalized_jacobian,
    inertia_matrices,
    system_matrix,
)
from freefloat.dynamics.resolved_rates import ResolvedRateSolver
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.ensemble.kernels.steps import measure_at
from freefloat.motion.margin import Margin
from freefloat.motion.problem import Problem
from freefloat.paths.curves import PolynomialCurve
from freefloat.paths.orientation import FixedOrientation
from freefloat.paths.path import EndEffectorPath
from freefloat.paths.timing import TimedPath, Timing
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import rotation_matrix
from tests.motions import bundled
from tests.robots import (
    Robot,
    inertial_text,
    joint_text,
    joint_values,
    link_text,
    planar_robot,
    random_robot,
    robots,
)

ROUNDING = 1e-12
"""Of sums of products, in units of what is summed."""


def measured_problem(model: FreeFloatingModel, task: Task, name: str) -> Problem:
    """A problem whose path does not matter."""
    pose = VirtualManipulator.of(model).pose(np.zeros(model.dof))
    line = PolynomialCurve.line(pose.position, pose.position + np.array([0.1, 0.0, 0.0]))
    path = TimedPath(EndEffectorPath(line, FixedOrientation(pose.rotation)), Timing(10.0))
    return Problem(
        model, path, task, np.zeros(3), Margin(singularity_measure(model, task, name), 0.0)
    )


@dataclass
class Kernels:
    """The kernels' numbers for a robot and a task, and buffers."""

    model: FreeFloatingModel
    task: Task
    name: str = "gjm"

    def __post_init__(self) -> None:
        robot = EnsembleIntegrator(measured_problem(self.model, self.task, self.name), 1)._robot
        m, n = len(self.task.rows), self.model.dof
        self.bodies, self.facts, self.rows = robot.bodies, robot.facts, robot.rows
        self.code = robot.measure
        self.w, self.S = np.zeros((n + 1, WORK_COLUMNS)), np.zeros((m, n))
        self.L = np.zeros((m, m + 1))

    def configure(self, q: np.ndarray) -> Kernels:
        """Everything at joint values; returns itself."""
        configure(self.bodies, self.facts, q, self.w)
        self.det_D = form_jacobian(self.facts, self.rows, self.w, self.S)
        return self

    def inertia(self) -> tuple[np.ndarray, np.ndarray]:
        """D and Dq."""
        xx, yy, zz, xy, xz, yz = self.w[0, D : D + 6]
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), self.w[1:, DQ : DQ + 3].T

    def rates(
        self, q: np.ndarray, attitude: np.ndarray, twist: np.ndarray, h: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """Angular velocity, joint rates and det S."""
        R0 = rotation_matrix(attitude)
        demand = np.concatenate([twist[:3] @ R0, twist[3:] @ R0, h @ R0])
        rates = np.zeros(self.model.dof)
        configure(self.bodies, self.facts, q, self.w)
        determinant = solve_rates(self.facts, self.rows, demand, self.w, self.S, self.L, rates)
        return self.w[0, OMEGA : OMEGA + 3].copy(), rates, determinant

    def measure(self, q: np.ndarray) -> float:
        """The measure at joint values."""
        return float(
            measure_at(self.bodies, self.facts, self.rows, self.code, q, self.w, self.S, self.L,
                       np.zeros(self.model.dof))
        )  # fmt: skip


def planar_model(rng: np.random.Generator, joints: int) -> FreeFloatingModel:
    """A planar arm with bodies of any mass, whose centres lie on their lines."""
    m = np.concatenate([[rng.uniform(20, 200)], rng.uniform(1, 30, joints)])
    text = planar_robot(
        m, m * rng.uniform(0.02, 0.3, joints + 1), rng.uniform(0.1, 0.8, joints),
        rng.uniform(0.1, 0.8, joints + 1),
    )  # fmt: skip
    return FreeFloatingModel.from_urdf(text, "end_effector")


def elbow_model(rng: np.random.Generator) -> FreeFloatingModel:
    """An elbow arm with a spherical wrist, spacecraft and first link symmetric about its axis."""

    def symmetric(mass: float, z: float) -> str:
        a, c = mass * rng.uniform(0.1, 0.3, 2)
        return inertial_text(mass, np.diag([a, a, min(c, 1.9 * a)]), f"0 0 {z!r}")

    def level(mass: float, x: float) -> str:
        moments = mass * rng.uniform(0.05, 0.09, 3)
        return inertial_text(mass, np.diag(moments), f"{x!r} 0 0")

    a, b, c = (float(x) for x in rng.uniform(0.5, 1.5, 3))
    tool = float(rng.uniform(0.1, 0.4))
    # masses behind the wrist's first two joints would couple the blocks
    light = inertial_text(1e-6, 1e-9 * np.eye(3))
    parts = [
        ("q1", "bus", "l1", f"0 0 {a!r}", "0 0 1", symmetric(12.0, 0.1)),
        ("q2", "l1", "l2", "0 0 0.3", "0 -1 0", level(float(rng.uniform(5, 20)), b / 2)),
        ("q3", "l2", "l3", f"{b!r} 0 0", "0 -1 0", level(float(rng.uniform(5, 20)), c / 3)),
        ("q4", "l3", "l4", f"{c!r} 0 0", "1 0 0", light),
        ("q5", "l4", "l5", "0 0 0", "0 1 0", light),
        ("q6", "l5", "l6", "0 0 0", "1 0 0", inertial_text(3.0, 0.02 * np.eye(3), f"{tool!r} 0 0")),
    ]
    text = link_text("bus", symmetric(float(rng.uniform(50, 500)), -0.2))
    for joint, parent, link, place, axis, inertial in parts:
        text += joint_text(joint, "C", parent, link, place, axis=axis) + link_text(link, inertial)
    text += joint_text("tool", "F", "l6", "tip", f"{2 * tool!r} 0 0")
    return FreeFloatingModel.from_urdf(
        f'<robot name="elbow">{text}<link name="tip"/></robot>', "tip"
    )


def assert_equal_parts(model: FreeFloatingModel, task: Task, q: np.ndarray) -> None:
    """D, Dq, the end-effector position and J of (1) and (5), S* of (7) and its determinant."""
    kernels = Kernels(model, task).configure(q)
    D_, Dq = inertia_matrices(model, q)
    inertia, inertia_q = kernels.inertia()
    size = np.abs(D_).max()
    np.testing.assert_allclose(inertia, D_, rtol=0, atol=ROUNDING * size)
    np.testing.assert_allclose(inertia_q, Dq, rtol=0, atol=ROUNDING * size)
    reach = VirtualManipulator.of(model).reach + np.abs(q).sum()
    position = VirtualManipulator.of(model).pose(q).position
    np.testing.assert_allclose(kernels.w[0, TIP : TIP + 3], position, rtol=0, atol=ROUNDING * reach)
    k = 1 if task.planar else 3
    J = system_matrix(model, q, task)[k:, k:]
    size = max(1.0, reach)
    jacobian = kernels.w[1:, JAC : JAC + 6].T[task.rows]
    np.testing.assert_allclose(jacobian, J, rtol=0, atol=ROUNDING * size)
    S = generalized_jacobian(model, q, task)
    condition = np.linalg.cond(D_)
    np.testing.assert_allclose(kernels.S, S, rtol=0, atol=ROUNDING * size * condition)
    det_D = D_[2, 2] if task.planar else np.linalg.det(D_)
    assert kernels.det_D == pytest.approx(det_D, rel=ROUNDING * condition)
    determinant = eliminate(kernels.S, kernels.L)
    volume = np.prod(np.linalg.norm(S, axis=1))
    if len(task.rows) == model.dof:
        expected = generalized_determinant(model, q, task)
        assert determinant == pytest.approx(expected, rel=1e-12, abs=1e-12 * volume * condition)
    else:  # the square of which is what is formed
        expected = float(np.prod(np.linalg.svd(S, compute_uv=False)))
        assert determinant**2 == pytest.approx(
            expected**2, rel=1e-10, abs=1e-13 * volume**2 * condition
        )


arms = st.one_of(
    st.text("RCP", min_size=3, max_size=8),
    st.text("RCPF", min_size=5, max_size=9).filter(
        lambda word: 3 <= len(word.replace("F", "")) <= 8
    ),
)


@given(data=st.data(), robot=robots(arms))
def test_matrices_of_random_robots_agree_with_pinocchio(data: st.DataObject, robot: Robot) -> None:
    """Revolute and prismatic joints, fixed joints merged; awkward joint values."""
    fixed = {name: data.draw(st.floats(-2.0, 2.0)) for name in robot.others}
    model = FreeFloatingModel.from_urdf(robot.text, robot.end_effector, fixed_joints=fixed)
    q = data.draw(joint_values(model.dof))
    task = Task.POSE if model.dof >= 6 and data.draw(st.booleans()) else Task.POSITION
    assert_equal_parts(model, task, q)


STRUCTURES = ("RPR", "CRPR", "RRRRRR", "RPRCRR", "RRPRRRR", "CRRRRRRR", "RRFRFPRRR")
BUNDLED = ("spatial_6dof/line", "ur5_servicer/arc", "panda_servicer/line")


@pytest.fixture(params=[*STRUCTURES, *BUNDLED, 2, 3, 5, 8])
def arm(request: pytest.FixtureRequest, rng: np.random.Generator) -> Arm:
    """Random arms with a second, fixed arm; bundled arms; planar arms with so many joints."""
    if request.param in BUNDLED:
        model, planar = bundled(request.param).model, False
    elif isinstance(request.param, int):
        model, planar = planar_model(rng, request.param), True
    else:
        robot, planar = random_robot(rng, request.param, "RP"), False
        fixed = dict(zip(robot.others, rng.uniform(-1.0, 1.0, 2), strict=True))
        model = FreeFloatingModel.from_urdf(robot.text, robot.end_effector, fixed_joints=fixed)
    tasks = [task for task in Task if task.planar is planar and len(task.rows) <= model.dof]
    return Arm(model, tasks, rng.uniform(-2.0, 2.0, (8, model.dof)))


@dataclass
class Arm:
    """A robot with all its tasks and some joint values."""

    model: FreeFloatingModel
    tasks: list[Task]
    joints: np.ndarray


def test_matrices_agree_with_pinocchio(arm: Arm) -> None:
    for q in arm.joints:
        for task in arm.tasks:
            assert_equal_parts(arm.model, task, q)


# ------------------------------------------------------------------------------ equation (4)


def assert_same_rates(
    model: FreeFloatingModel, task: Task, q: np.ndarray, rng: np.random.Generator
) -> None:
    """Angular velocity and joint rates, to rounding times the condition number of S*."""
    twist, h = rng.normal(size=6), rng.normal(size=3) * model.total_mass / 100.0
    attitude = Rotation.random(rng=rng).as_quat()
    if task.planar:
        twist[2:5], h[:2] = 0.0, 0.0
        attitude = np.array([0.0, 0.0, *Rotation.random(rng=rng).as_quat()[2:]])
        attitude /= np.linalg.norm(attitude)
    omega, rates = ResolvedRateSolver(model, task, h).rates(attitude, q, twist)
    kernels = Kernels(model, task)
    compiled_omega, compiled_rates, determinant = kernels.rates(q, attitude, twist, h)
    S = generalized_jacobian(model, q, task)
    condition = np.linalg.cond(S) ** (1 if len(S) == len(S.T) else 2)  # S S^T is formed
    size = max(1.0, np.abs(rates).max(), np.abs(omega).max())
    tolerance = 1e-12 * condition * size
    np.testing.assert_allclose(compiled_rates, rates, rtol=0, atol=tolerance)
    np.testing.assert_allclose(compiled_omega, omega, rtol=0, atol=tolerance)
    kernels.configure(q)
    assert determinant == eliminate(kernels.S, kernels.L)


def test_rates_solve_equation_4(arm: Arm, rng: np.random.Generator) -> None:
    """With momentum: the unique rates, or those of minimum norm."""
    for q in arm.joints:
        for task in arm.tasks:
            assert_same_rates(arm.model, task, q, rng)


def test_rates_conserve_momentum_and_give_the_end_effector_twist(rng: np.random.Generator) -> None:
    """From D, Dq and S alone, without any other solver: h and the twist come out."""
    model = bundled("panda_servicer/line").model
    kernels = Kernels(model, Task.POSE)
    for q in rng.uniform(-np.pi, np.pi, (20, model.dof)):
        twist, h = rng.normal(size=6), rng.normal(size=3)
        identity = np.array([0.0, 0.0, 0.0, 1.0])
        omega, rates, _ = kernels.rates(q, identity, twist, h)
        D_, Dq = inertia_matrices(model, q)
        size = 1e-11 * (1.0 + np.abs(rates).max())
        np.testing.assert_allclose(D_ @ omega + Dq @ rates, h, rtol=0, atol=size * np.abs(D_).max())
        A = system_matrix(model, q)
        np.testing.assert_allclose(A[3:] @ [*omega, *rates], twist, rtol=0, atol=10 * size)


# ------------------------------------------------------------------------------- elimination


@pytest.mark.parametrize(("m", "n"), [(2, 2), (3, 3), (6, 6), (2, 4), (3, 8), (6, 7), (6, 8)])
def test_elimination_finds_determinant_and_solution(
    m: int, n: int, rng: np.random.Generator
) -> None:
    """Also where the first pivots vanish: exchanged rows change the sign."""
    for trial in range(10):
        S, right = rng.normal(size=(m, n)), rng.normal(size=m)
        if trial % 2 and m == n:
            S[np.arange(m), np.arange(m)] = 0.0
        L = np.zeros((m, m + 1))
        L[:, m] = right
        determinant = eliminate(S, L)
        matrix = S if m == n else S @ S.T
        expected = np.linalg.det(matrix)
        expected = expected if m == n else np.sqrt(expected)
        assert determinant == pytest.approx(expected, rel=1e-10)
        upper = np.triu(L[:, :m])
        np.testing.assert_allclose(
            np.linalg.solve(upper, L[:, m]), np.linalg.solve(matrix, right), rtol=1e-8
        )


def test_the_determinant_of_a_redundant_arm_is_never_negative() -> None:
    """Rounding leaves S S^T of two parallel rows with a determinant on either side of zero."""
    generator = np.random.default_rng(3)
    for _ in range(200):
        row = generator.normal(size=7)
        S = np.array([row, generator.normal() * row, generator.normal(size=7)])
        assert 0.0 <= eliminate(S, np.zeros((3, 4))) < 1e-5


# ---------------------------------------------------------------------------------- measures


def assert_same_measure(model: FreeFloatingModel, task: Task, name: str, q: np.ndarray) -> None:
    S = generalized_jacobian(model, q, task)
    square = len(task.rows) == model.dof
    volume = float(np.prod(np.linalg.norm(S, axis=1)))
    D_, _ = inertia_matrices(model, q)
    if name == "system":
        volume *= float(D_[2, 2] if task.planar else np.linalg.det(D_))
    elif name == "sigma":
        volume = float(np.abs(S).max())
    value = Kernels(model, task, name).measure(q)
    expected = singularity_measure(model, task, name)(q)
    condition = np.linalg.cond(D_)
    if square or name == "sigma":
        assert value == pytest.approx(expected, rel=1e-12, abs=1e-12 * volume * condition)
    else:
        assert value**2 == pytest.approx(expected**2, rel=1e-10, abs=1e-13 * volume**2 * condition)


@pytest.mark.parametrize("name", ["gjm", "system", "sigma"])
def test_measures(arm: Arm, name: str) -> None:
    for q in arm.joints:
        for task in arm.tasks:
            assert_same_measure(arm.model, task, name, q)


def test_in_plane_factor_of_elbow_arms(rng: np.random.Generator) -> None:
    """The wrist eliminated by Cramer's rule, at any q1 and wrist angles: they do not matter."""
    for model in (bundled("spatial_6dof/line").model, *(elbow_model(rng) for _ in range(8))):
        kernels = Kernels(model, Task.POSE, "arm")
        measure = singularity_measure(model, Task.POSE, "arm")
        joints = rng.uniform(-np.pi, np.pi, (10, 6))
        values, expected = (np.array([f(q) for q in joints]) for f in (kernels.measure, measure))
        np.testing.assert_allclose(values, expected, rtol=0, atol=1e-11 * np.abs(expected).max())
