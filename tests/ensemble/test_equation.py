"""The ensemble's equation (4) against Pinocchio and LAPACK, robot by robot, number by number."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest

import freefloat as ff
from freefloat.dynamics.generalized_jacobian import generalized_determinant
from freefloat.dynamics.kernels.kinematics import ANGULAR, AXIS
from freefloat.dynamics.kernels.robot import JOINT_COLUMNS, S_COLUMNS
from freefloat.dynamics.momentum import inertia_matrices
from freefloat.dynamics.resolved_rates import ResolvedRateSolver
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.lockstep import lanes, reflections
from freefloat.lockstep.lanes import WIDTH
from tests.lock_step import Kernels, Table, as_lanes, measured_problem, plain_kernels
from tests.motions import bundled
from tests.robots import inertial_text, joint_text, link_text, numbers, planar_robot, random_robot

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
ROUNDING = 1e-12
"""Of sums of products, in units of what is summed."""


@pytest.fixture(autouse=True)
def plain() -> Iterator[None]:
    """The kernels as plain Python."""
    with plain_kernels():
        yield


def planar_model(rng: np.random.Generator, joints: int) -> ff.FreeFloatingModel:
    """A planar arm with bodies of any mass, whose centres lie on their lines."""
    m = np.concatenate([[rng.uniform(20, 200)], rng.uniform(1, 30, joints)])
    text = planar_robot(
        m, m * rng.uniform(0.02, 0.3, joints + 1), rng.uniform(0.1, 0.8, joints),
        rng.uniform(0.1, 0.8, joints + 1),
    )  # fmt: skip
    return ff.FreeFloatingModel.from_urdf(text, "end_effector")


def elbow_model(rng: np.random.Generator) -> ff.FreeFloatingModel:
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
    return ff.FreeFloatingModel.from_urdf(
        f'<robot name="elbow">{text}<link name="tip"/></robot>', "tip"
    )


def assert_equal_parts(model: ff.FreeFloatingModel, task: ff.Task, joints: np.ndarray) -> None:
    """Inverse and determinant of D and L of (1), S* of (7) and its determinant (6)."""
    kernels = Kernels(measured_problem(model, task))
    position, inverse, det_D = kernels.jacobian(joints)
    S, momenta = (
        table.array.reshape(-1, columns, WIDTH)
        for table, columns in (
            (kernels.work.solver.S, S_COLUMNS), (kernels.work.solver.momenta, JOINT_COLUMNS),
        )
    )  # fmt: skip
    S, determinant = S.copy(), kernels.determinant(joints)
    for k, q in enumerate(joints):
        D, Dq = inertia_matrices(model, q)
        size, condition = np.abs(D).max(), np.linalg.cond(D)
        reach = VirtualManipulator.of(model).reach + np.abs(q).sum()
        pose = VirtualManipulator.of(model).pose(q).position
        np.testing.assert_allclose(position[:, k], pose, rtol=0, atol=ROUNDING * reach)
        xx, yy, zz = inverse.diagonal[:, k]
        yz, zx, xy = inverse.products[:, k]
        np.testing.assert_allclose(
            np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]) @ D, np.eye(3),
            rtol=0, atol=ROUNDING * condition,
        )  # fmt: skip
        L = momenta[:, ANGULAR : ANGULAR + 3, k]
        revolute = np.array([not body.prismatic for body in model.bodies[1:]])
        a = momenta[:, AXIS : AXIS + 3, k] * revolute[:, None]
        np.testing.assert_allclose(L, a @ D - Dq.T, rtol=0, atol=ROUNDING * size)
        expected = ff.generalized_jacobian(model, q, task)
        if task is ff.Task.POINTING:  # the kernels keep linear rows in the spacecraft frame
            rotation = VirtualManipulator.of(model).pose(q).rotation
            expected = np.vstack([rotation @ expected[:3], expected[3:]])
        np.testing.assert_allclose(
            S[:, : len(task.rows), k].T, expected, rtol=0,
            atol=ROUNDING * max(1.0, reach) * condition,
        )  # fmt: skip
        assert det_D[k] == pytest.approx(
            D[2, 2] if task.planar else np.linalg.det(D), rel=ROUNDING * condition
        )
        volume = np.prod(np.linalg.norm(expected, axis=1))
        if len(task.rows) == model.dof:
            assert determinant[k] == pytest.approx(
                generalized_determinant(model, q, task), rel=1e-12, abs=1e-12 * volume * condition
            )
        else:  # the square of which is what is formed
            product = float(np.prod(np.linalg.svd(expected, compute_uv=False)))
            assert determinant[k] ** 2 == pytest.approx(
                product**2, rel=1e-10, abs=1e-13 * volume**2 * condition
            )


STRUCTURES = ("RPR", "CRPR", "RRRRRR", "RRPRRRR", "RRFRFPRRR")
BUNDLED = ("spatial_6dof/line", "ur5_servicer/arc", "panda_servicer/line")


@pytest.fixture(params=[*STRUCTURES, *BUNDLED, 2, 3, 5])
def arm(request: pytest.FixtureRequest, rng: np.random.Generator) -> Arm:
    """Random arms with a second, fixed arm; bundled arms; planar arms with so many joints."""
    if request.param in BUNDLED:
        model, planar = bundled(request.param).model, False
    elif isinstance(request.param, int):
        model, planar = planar_model(rng, request.param), True
    else:
        robot, planar = random_robot(rng, request.param, "RP"), False
        fixed = dict(zip(robot.others, rng.uniform(-1.0, 1.0, 2), strict=True))
        model = ff.FreeFloatingModel.from_urdf(robot.text, robot.end_effector, fixed_joints=fixed)
    tasks = [task for task in ff.Task if task.planar is planar and len(task.rows) <= model.dof]
    return Arm(model, tasks, rng.uniform(-2.0, 2.0, (WIDTH, model.dof)))


@dataclass
class Arm:
    """A robot with all its tasks and some joint values."""

    model: ff.FreeFloatingModel
    tasks: list[ff.Task]
    joints: np.ndarray


def test_matrices_agree_with_pinocchio(arm: Arm) -> None:
    for task in arm.tasks:
        assert_equal_parts(arm.model, task, arm.joints)


@pytest.mark.parametrize("kinds", ["RRRRRR", "PRRPPR"])
@pytest.mark.parametrize("tilt", [0.0, 3e-9, 3e-7, 4e-6, 1e-3])
def test_axes_may_be_nearly_parallel(tilt: float, kinds: str, rng: np.random.Generator) -> None:
    """As in files with pi to five digits; sliding joints lie on one line but for rounding."""
    text = link_text("bus", inertial_text(100.0, 10.0 * np.eye(3), "0.1 0.2 0.3"))
    for k, kind in enumerate(kinds):
        turns = [np.pi * (k % 2), 0.0, 0.7] + tilt * rng.uniform(-1.0, 1.0, 3)
        place = [0.0 if kind == "P" else rng.uniform(0.2, 0.5), 0.0, 0.3]
        parent, link = f"l{k}" if k else "bus", f"l{k + 1}"
        text += joint_text(f"q{k}", kind, parent, link, numbers(place), numbers(turns))
        text += link_text(link, inertial_text(3.0, 0.05 * np.eye(3), "0.1 0.02 0.1"))
    model = ff.FreeFloatingModel.from_urdf(f'<robot name="flat">{text}</robot>')
    assert_equal_parts(model, ff.Task.POSITION, rng.uniform(-2.0, 2.0, (WIDTH, model.dof)))


def assert_same_rates(
    model: ff.FreeFloatingModel, task: ff.Task, joints: np.ndarray, rng: np.random.Generator
) -> None:
    """Angular velocity and joint rates, to rounding times the condition number of S*."""
    twist = rng.normal(size=(WIDTH, 6))
    h = np.tile(rng.normal(size=3) * model.total_mass / 100.0, (WIDTH, 1))
    if task.planar:
        twist[:, 2:5], h[:, :2] = 0.0, 0.0
    turns, rates, determinant = Kernels(measured_problem(model, task)).rates(
        joints, twist[:, :3], twist[:, 3:], h
    )
    solver = ResolvedRateSolver(ff.System(model, h[0]), task)
    for k, q in enumerate(joints):
        omega, expected = solver.rates(IDENTITY, q, twist[k])
        S = ff.generalized_jacobian(model, q, task)
        condition = np.linalg.cond(S) ** (1 if len(S) == len(S.T) else 2)  # S S^T is formed
        tolerance = 1e-12 * condition * max(1.0, np.abs(expected).max(), np.abs(omega).max())
        np.testing.assert_allclose(rates[k], expected, rtol=0, atol=tolerance)
        np.testing.assert_allclose(turns[k], omega, rtol=0, atol=tolerance)
    np.testing.assert_array_equal(
        determinant, Kernels(measured_problem(model, task)).determinant(joints)
    )


def test_rates_solve_equation_4(arm: Arm, rng: np.random.Generator) -> None:
    """With momentum: the unique rates, or those of minimum norm."""
    for task in arm.tasks:
        assert_same_rates(arm.model, task, arm.joints, rng)


@pytest.mark.parametrize(("m", "n"), [(2, 2), (3, 3), (6, 6), (2, 4), (3, 8), (6, 7), (6, 8)])
def test_reflections_give_determinant_and_solution_of_least_norm(
    m: int, n: int, rng: np.random.Generator
) -> None:
    """Also where the diagonal vanishes."""
    S, right = rng.normal(size=(WIDTH, m, n)), rng.normal(size=(WIDTH, m))
    S[::2, np.arange(m), np.arange(m)] = 0.0
    A = Table(S.transpose(2, 1, 0).reshape(n * m, WIDTH).copy(), m)
    scales, x = (Table(np.zeros((size, WIDTH)), 1) for size in (m, n))
    determinant = reflections.factorize(m, n, A, scales)
    reflections.solve_least_norm(m, n, A, scales, Kernels.column(right), x)
    for k, matrix in enumerate(S):
        expected = np.linalg.det(matrix) if m == n else np.prod(np.linalg.svd(matrix)[1])
        assert determinant[k] == pytest.approx(expected, rel=1e-10)
        np.testing.assert_allclose(x.array[:, k], np.linalg.pinv(matrix) @ right[k], rtol=1e-8)


def test_the_determinant_of_a_redundant_arm_is_never_negative() -> None:
    """Two parallel rows, but for rounding."""
    generator = np.random.default_rng(3)
    for _ in range(25):
        row, other = generator.normal(size=(2, 7, WIDTH))
        A = np.stack([row, generator.normal(size=WIDTH) * row, other], axis=1)
        determinant = reflections.factorize(
            3, 7, Table(A.reshape(21, WIDTH), 3), Table(np.zeros((3, WIDTH)), 1)
        )
        assert (determinant >= 0.0).all()
        assert (determinant < 1e-5).all()


def test_sine_and_cosine_to_rounding(rng: np.random.Generator) -> None:
    for size in (1.0, 10.0, 1e5):
        x = as_lanes(rng.uniform(-size, size, WIDTH))
        sine, cosine = lanes.sine_cosine(x)
        np.testing.assert_allclose(sine, np.sin(x), rtol=0, atol=3e-16)
        np.testing.assert_allclose(cosine, np.cos(x), rtol=0, atol=3e-16)


def assert_same_measure(
    model: ff.FreeFloatingModel, task: ff.Task, name: str, q: np.ndarray, value: float
) -> None:
    S = ff.generalized_jacobian(model, q, task)
    square = len(task.rows) == model.dof
    volume = float(np.prod(np.linalg.norm(S, axis=1)))
    D_, _ = inertia_matrices(model, q)
    if name == "system":
        volume *= float(D_[2, 2] if task.planar else np.linalg.det(D_))
    elif name == "sigma":
        volume = float(np.abs(S).max())
    expected = ff.singularity_measure(model, task, name)(q)
    condition = np.linalg.cond(D_)
    if square or name == "sigma":
        assert value == pytest.approx(expected, rel=1e-12, abs=1e-12 * volume * condition)
    else:
        assert value**2 == pytest.approx(expected**2, rel=1e-10, abs=1e-13 * volume**2 * condition)


@pytest.mark.parametrize("name", ["gjm", "system", "sigma"])
def test_measures(arm: Arm, name: str) -> None:
    for task in arm.tasks:
        values = Kernels(measured_problem(arm.model, task, name)).measure(arm.joints)
        for q, value in zip(arm.joints, values, strict=True):
            assert_same_measure(arm.model, task, name, q, value)


@pytest.mark.slow
def test_in_plane_factor_of_elbow_arms(rng: np.random.Generator) -> None:
    """At any q1 and wrist angles: they do not matter."""
    for model in (bundled("spatial_6dof/line").model, *(elbow_model(rng) for _ in range(8))):
        joints = rng.uniform(-np.pi, np.pi, (WIDTH, 6))
        values = Kernels(measured_problem(model, ff.Task.POSE, "arm")).measure(joints)
        measure = ff.singularity_measure(model, ff.Task.POSE, "arm")
        expected = np.array([measure(q) for q in joints])
        np.testing.assert_allclose(values, expected, rtol=0, atol=1e-11 * np.abs(expected).max())
