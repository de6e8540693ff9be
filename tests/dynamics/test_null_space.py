"""Motions of redundant arms: exact on the path and optimal in their metric."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import freefloat as ff
from freefloat.dynamics.momentum import end_effector_jacobian, momentum_map
from freefloat.dynamics.redundancy import Metric, Toward, range_centres
from freefloat.dynamics.resolved_rates import ResolvedRateSolver
from freefloat.io.formats.trajectory import Trajectory
from freefloat.verification.engines.mujoco_model import Engine
from tests.errors import error_key
from tests.motions import differentiated
from tests.redundant import ARMS, choices, redundant
from tests.robots import planar_robot

GOOD = [0.1562267, -0.1345817, -0.6778546, -0.7056869]
JOINTS = [0.0248, -1.7374, -1.0996, -1.4452, -1.3566, 1.0564, 0.7632]
"""An attitude from which the Panda completes its line, and about where its joints are then."""
EVERYTHING = [(*arm, k) for arm in ARMS for k in range(9)]


def panda(**changes):
    problem = ff.load_scenario("panda_servicer/line").problem()
    return replace(problem, redundancy=ff.Redundancy(**changes) if changes else None)


def panda_motion(problem):
    attitude = problem.attitude(np.array(GOOD) / np.linalg.norm(GOOD))
    joints = problem.branch_near(attitude, JOINTS, ()).joints
    motion = ff.integrate_motion(problem, attitude, joints)
    assert motion.completed
    return motion


def somewhere(start, seed=0):
    """Attitude, joints, twist and speed at some time of a problem, not on its motion."""
    rng = np.random.default_rng(seed)
    joints = start.joints + rng.uniform(-0.3, 0.3, len(start.joints))
    return start.attitude, joints, *start.problem.path.twist_and_speed(5.0)


def inertia_of(model, attitude, joints):
    """The generalized inertia of the arm with the base eliminated, by Pinocchio's mass matrix."""
    q = np.concatenate([np.zeros(3), attitude, joints])
    data = model.pin_model.createData()
    H = np.triu(pin.crba(model.pin_model, data, q))
    H = H + np.triu(H, 1).T
    return H[6:, 6:] - H[6:, :6] @ np.linalg.inv(H[:6, :6]) @ H[:6, 6:]


def metric_of(start, attitude, joints):
    model, redundancy = start.problem.model, start.problem.redundancy
    if redundancy.metric is Metric.ENERGY:
        W = inertia_of(model, attitude, joints)
    else:
        W = np.diag([redundancy.weights.get(name, 1.0) for name in model.joint_names])
    return W * (len(W) / np.trace(W))


def attraction_of(start, joints):
    """The gradient g, by differences where it is one of the manipulability."""
    problem, model = start.problem, start.problem.model
    if problem.redundancy.toward is Toward.NONE:
        return np.zeros(model.dof)
    if problem.redundancy.toward is Toward.MIDDLE:
        return np.nan_to_num(range_centres(model) - joints)

    def logarithm(q):
        S = ff.generalized_jacobian(model, q, problem.task)
        return 0.5 * np.linalg.slogdet(S @ S.T)[1]

    steps = 1e-3 * np.eye(model.dof)
    return np.array([
        (8 * (logarithm(joints + e) - logarithm(joints - e))
         - logarithm(joints + 2 * e) + logarithm(joints - 2 * e)) / 12e-3
        for e in steps
    ])  # fmt: skip


@pytest.mark.parametrize(("structure", "task", "number"), EVERYTHING)
def test_rates_are_those_of_the_optimality_conditions(structure, task, number):
    """Minimum-norm and attraction parts of the rates, by a KKT system in NumPy."""
    redundancy = choices(structure, task)[number]
    start = redundant(structure, task, redundancy)
    model, h = start.problem.model, start.problem.momentum
    attitude, joints, twist, speed = somewhere(start)
    A = momentum_map(model, joints, attitude)
    J = end_effector_jacobian(model, joints, attitude)[task.rows]
    B = np.linalg.solve(A[:, :6], np.column_stack([A[:, 6:], [0, 0, 0, *h]]))
    S, twist_rows = J[:, 6:] - J[:, :6] @ B[:, :-1], twist[task.rows] - J[:, :6] @ B[:, -1]
    W, g = metric_of(start, attitude, joints), attraction_of(start, joints)
    m, n = S.shape
    K = np.block([[W, S.T], [S, np.zeros((m, m))]])
    plain = np.linalg.solve(K, np.concatenate([np.zeros(n), twist_rows]))[:n]
    pull = redundancy.gain * np.linalg.solve(K, np.concatenate([g, np.zeros(m)]))[:n]
    pull /= np.sqrt(1.0 + (np.linalg.norm(pull) / redundancy.bound) ** 2)
    omega, rates = start.problem.resolved_rate_solver().rates(attitude, joints, twist, speed)
    scale = np.abs(rates).max()
    np.testing.assert_allclose(rates, plain + speed * pull, rtol=0, atol=1e-9 * scale)
    base = np.concatenate([np.zeros(3), omega])
    base[:3] = -np.linalg.solve(A[:3, :3], A[:3, 3:] @ np.concatenate([omega, rates]))
    v = np.concatenate([base, rates])
    np.testing.assert_allclose(A[3:] @ v, h, rtol=0, atol=1e-11 * np.abs(A).max())
    np.testing.assert_allclose(J @ v, twist[task.rows], rtol=0, atol=1e-12)


@pytest.mark.parametrize(("structure", "task"), ARMS)
def test_the_energy_metric_minimizes_the_kinetic_energy(structure, task):
    """Pinocchio's kinetic energy of the whole robot, against any other rates that do the same."""
    start = redundant(structure, task, ff.Redundancy(Metric.ENERGY))
    model = start.problem.model
    attitude, joints, twist, _ = somewhere(start)
    _, best = start.problem.resolved_rate_solver().rates(attitude, joints, twist)
    A, h = momentum_map(model, joints, attitude), start.problem.momentum
    J = end_effector_jacobian(model, joints, attitude)[task.rows]

    def energy(rates):
        base = np.linalg.solve(A[:, :6], np.array([0, 0, 0, *h]) - A[:, 6:] @ rates)
        v = np.concatenate([base, rates])
        np.testing.assert_allclose(J @ v, twist[task.rows], rtol=0, atol=1e-11)
        q = np.concatenate([np.zeros(3), attitude, joints])
        return pin.computeKineticEnergy(model.pin_model, model.scratch, q, v)

    S = J[:, 6:] - J[:, :6] @ np.linalg.solve(A[:, :6], A[:, 6:])
    lowest, size = energy(best), np.linalg.norm(best)
    for direction in np.linalg.svd(S)[2][len(S) :]:
        for step in (-0.1, 0.1):
            assert energy(best + step * size * direction) > lowest
        slope = (energy(best + 1e-3 * direction) - energy(best - 1e-3 * direction)) / 2e-3
        curvature = energy(best + direction) + energy(best - direction) - 2.0 * lowest
        assert abs(slope) < 1e-8 * curvature * max(size, 1.0)
    start = replace(start, problem=replace(start.problem, redundancy=None))
    _, plain = start.problem.resolved_rate_solver().rates(attitude, joints, twist)
    assert energy(plain) > lowest * (1.0 + 1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("structure", "task", "number"), EVERYTHING[::7])
def test_motions_are_exact(structure, task, number):
    """Path and momentum are conserved with every metric and objective."""
    start = redundant(structure, task, choices(structure, task, 1)[number], 1)
    motion = ff.integrate_motion(start.problem, start.attitude, start.joints, tolerance=1e-13)
    assert motion.completed
    residuals = motion.residuals()
    assert residuals.end_effector_position < 1e-8
    assert (residuals.end_effector_orientation or 0.0) < 1e-8
    assert residuals.momentum < 1e-8 * max(1.0, np.linalg.norm(start.problem.momentum))


@pytest.mark.slow
def test_large_weights_reduce_joint_motion():
    """A joint of large weight hardly moves; scaling all weights changes nothing."""
    plain = panda_motion(panda())
    heavy = panda_motion(panda(metric={"panda_joint1": 1e4}))
    assert np.ptp(heavy.joints[:, 0]) < 0.05 * np.ptp(plain.joints[:, 0])
    names = heavy.problem.model.joint_names
    tenfold = {name: 1e5 if name == "panda_joint1" else 10.0 for name in names}
    same = panda_motion(panda(metric=tenfold))
    np.testing.assert_allclose(same.final.joints, heavy.final.joints, rtol=0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("metric", [Metric.JOINTS, Metric.ENERGY])
@pytest.mark.parametrize("seed", [2, 3])
def test_toward_sigma_ends_farther_from_singularities(metric, seed):
    """The smallest singular value of S* and the manipulability are larger at the end."""
    motions = []
    for toward in (Toward.NONE, Toward.MANIPULABILITY):
        start = redundant("RRRRRR", ff.Task.POSITION, ff.Redundancy(metric, toward, 2.0), seed)
        motions.append(ff.integrate_motion(start.problem, start.attitude, start.joints))
        assert motions[-1].completed
    for name in ("gjm", "sigma"):
        of = ff.singularity_measure(start.problem.model, ff.Task.POSITION, name)
        without, drawn = (of(motion.final.joints) for motion in motions)
        assert drawn > 1.02 * without
        assert ff.closest_approach(motions[1], of).value >= ff.closest_approach(
            motions[0], of
        ).value * (1.0 - 1e-6)


@pytest.mark.slow
def test_toward_middle_approaches_the_range_centres():
    """The distance to the range centres decreases with the gain."""
    problems = panda(), *(panda(toward="middle", gain=gain) for gain in (0.5, 2.0))
    middle = range_centres(panda().model)
    distances = [
        np.linalg.norm(panda_motion(problem).final.joints - middle) for problem in problems
    ]
    assert (np.diff(distances) < 0.0).all()
    assert distances[1] < distances[0] - 0.3


def test_unlimited_joints_are_not_attracted():
    """Of the planar arm the second joint alone has a range."""
    start = redundant("5", ff.Task.PLANAR_POSITION, ff.Redundancy(toward=Toward.MIDDLE))
    np.testing.assert_array_equal(np.isfinite(range_centres(start.problem.model)), [0, 1, 0, 0, 0])
    assert range_centres(start.problem.model)[1] == 0.75
    motion = ff.integrate_motion(start.problem, start.attitude, start.joints)
    plain = replace(start.problem, redundancy=None)
    without = ff.integrate_motion(plain, start.attitude, start.joints)
    ends = [abs(record.final.joints[1] - 0.75) for record in (motion, without)]
    assert ends[0] < ends[1] - 0.05


@pytest.mark.parametrize("toward", [Toward.MANIPULABILITY, Toward.MIDDLE])
def test_the_null_space_motion_is_bounded(toward):
    """For any gain it is shorter than the bound and vanishes where the path stops."""
    start = redundant("RRRRRRR", ff.Task.POSE, ff.Redundancy(toward=toward, gain=1e5, bound=0.7))
    attitude, joints, twist, speed = somewhere(start)
    solver = start.problem.resolved_rate_solver()
    (_, rest), (_, moving) = (solver.rates(attitude, joints, twist, s) for s in (0.0, speed))
    length = np.linalg.norm(moving - rest) / speed
    assert 0.69 < length < 0.7
    plain = replace(start.problem, redundancy=None).resolved_rate_solver()
    np.testing.assert_allclose(rest, plain.rates(attitude, joints, twist)[1], rtol=0, atol=1e-12)


@pytest.mark.parametrize("toward", [Toward.MANIPULABILITY, Toward.MIDDLE])
def test_rates_vanish_where_the_path_stops(toward):
    """Without momentum every joint rate vanishes at both ends and at a stop on the way."""
    start = redundant(
        "RRRRRRR", ff.Task.POSE, ff.Redundancy(toward=toward, gain=2.0), momentum=False
    )
    motion = ff.integrate_motion(start.problem, start.attitude, start.joints)
    assert motion.completed
    rates = np.abs(Trajectory.of(motion, [0.0, 4.0, 9.0, 15.0, 20.0]).joint_rates).max(axis=1)
    assert rates[[0, 2, 4]].max() < 1e-9
    assert rates[[1, 3]].min() > 1e-2


@pytest.mark.slow
def test_mujoco_needs_no_wrench_on_the_base():
    """Inverse dynamics of a motion with attraction and momentum: no force on the spacecraft."""
    choice = ff.Redundancy(Metric.ENERGY, Toward.MIDDLE)
    start = redundant("RRRRRRR", ff.Task.POSE, choice, 1, timing=ff.Timing(20.0))
    motion = ff.integrate_motion(start.problem, start.attitude, start.joints)
    assert motion.completed
    engine = Engine(start.problem.system)
    results = [engine.inverse(*differentiated(motion, t)) for t in np.linspace(1.0, 19.0, 19)]
    wrenches, torques = (np.array(values) for values in zip(*results, strict=True))
    assert np.abs(torques).max() > 1e-2
    assert np.abs(wrenches).max() < 1e-4 * np.abs(torques).max()


def test_rates_are_infinite_where_the_arm_is_singular():
    """A stretched planar arm has infinite rates and raises no exception."""
    text = planar_robot([5, 1, 1, 1], [1] * 4, [1] * 3, [0] * 4)
    model = ff.FreeFloatingModel.from_urdf(text)
    redundancy = ff.Redundancy(Metric.ENERGY, Toward.MANIPULABILITY)
    solver = ResolvedRateSolver(ff.System(model), ff.Task.PLANAR_POSITION, redundancy)
    _, rates = solver.rates(np.array([0.0, 0, 0, 1]), np.zeros(3), np.eye(6)[0], 1.0)
    assert not np.isfinite(rates).all()


@pytest.mark.parametrize("limits", ["", 'lower="0" upper="0"', 'lower="-1e30" upper="1"'])
def test_a_joint_without_two_limits_has_no_centre(limits):
    text = planar_robot([50, 5, 4, 3], [8, 1, 0.5, 0.3], [0.4] * 3, [0.5] * 4)
    text = text.replace('"q2" type="continuous"', '"q2" type="revolute"')
    child = '<child link="link_2"/>'
    text = text.replace(child, f'{child}<limit {limits} effort="9" velocity="9"/>')
    assert np.isnan(range_centres(ff.FreeFloatingModel.from_urdf(text))).all()


def test_toward_middle_without_joint_ranges_raises():
    """Continuous joints have no range centre."""
    text = planar_robot([50, 5, 4, 3], [8, 1, 0.5, 0.3], [0.4] * 3, [0.5] * 4)
    model = ff.FreeFloatingModel.from_urdf(text)
    assert (
        error_key(
            ResolvedRateSolver,
            ff.System(model),
            ff.Task.PLANAR_POSITION,
            ff.Redundancy(toward=Toward.MIDDLE),
        )
        == "redundancy.toward"
    )
