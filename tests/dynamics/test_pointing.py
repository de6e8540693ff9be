"""Task ``pointing``: position and z axis of the end-effector, its roll free."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.dynamics.generalized_jacobian import system_matrix, system_matrix_derivative
from freefloat.ensemble.endings import SINGULAR
from freefloat.motion.motion import Ending
from freefloat.paths.orientation import OrientationSpline
from freefloat.so3 import angle_between, without_jumps
from tests.ensembles import both
from tests.errors import error_key
from tests.redundant import redundant
from tests.robots import random_robot

ARMS = ["RRRRR", "RRRRRR", "RRRRRRR", "RRPRRR"]


def found_orientation(motion, count=401):
    """The orientation of the end-effector along a motion, roll included, as a spline."""
    timing, model = motion.problem.path.timing, motion.problem.model
    ends = motion.initial.time, motion.final.time
    s = np.linspace(*(timing.s(t) for t in ends), count)
    times = [ends[0], *(brentq(lambda t, a=a: timing.s(t) - a, *ends) for a in s[1:-1]), ends[1]]
    rotations = [model.end_effector_pose(state.attitude, state.joints).rotation
                 for state in motion.sample(times)]  # fmt: skip
    return OrientationSpline(without_jumps(Rotation.from_matrix(rotations).as_quat()), s)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("structure", "seed", "momentum"), [("RRRRRR", 0, False), ("RRPRRR", 1, True)]
)
def test_prescribing_the_roll_that_was_found_gives_the_same_motion(structure, seed, momentum):
    """The joint rates of least norm of a six-joint arm, then those of its pose task."""
    start = redundant(structure, ff.Task.POINTING, None, seed, momentum=momentum)
    window = {"start": 2.0, "end": 8.0, "tolerance": 1e-13}
    begin = ff.integrate_motion(start.problem, start.attitude, start.joints, end=2.0).final
    free = ff.integrate_motion(start.problem, begin.attitude, begin.joints, **window)
    path = start.problem.path
    found = found_orientation(free)
    posed = start.problem.replace(
        task=ff.Task.POSE, path=replace(path, path=ff.EndEffectorPath(path.path.curve, found))
    )
    same = ff.integrate_motion(posed, begin.attitude, begin.joints, **window)
    assert free.completed
    assert same.completed
    s = path.timing.s(8.0)
    rolled = Rotation.from_matrix(path.path.orientation.rotation(s).T @ found.rotation(s))
    assert abs(rolled.as_rotvec()[2]) > 0.01
    for t in np.linspace(2.0, 8.0, 7):
        (one,), (other,) = free.sample(t), same.sample(t)
        np.testing.assert_allclose(one.joints, other.joints, rtol=0, atol=1e-8)
        assert angle_between(one.attitude, other.attitude) < 1e-8


@pytest.mark.parametrize("structure", ARMS)
def test_rows_are_those_of_the_end_effector(structure):
    """The twist without its last row, and the derivative of the system matrix by differences."""
    rng = np.random.default_rng(len(structure))
    model = random_robot(rng, structure).model()
    q, v = rng.uniform(-1.0, 1.0, (2, model.dof))
    A = system_matrix(model, q, ff.Task.POINTING)
    R = np.kron(np.eye(2), model.end_effector_pose([0, 0, 0, 1], q).rotation.T)
    whole = R @ system_matrix(model, q, ff.Task.POSE)[3:] if model.dof > 5 else A[3:]
    np.testing.assert_allclose(A[3:], whole[:5], rtol=0, atol=1e-12)
    difference = (
        system_matrix(model, q + 1e-6 * v, ff.Task.POINTING)
        - system_matrix(model, q - 1e-6 * v, ff.Task.POINTING)
    ) / 2e-6
    slope = system_matrix_derivative(model, q, v, ff.Task.POINTING)
    np.testing.assert_allclose(slope, difference, rtol=0, atol=1e-7 * np.abs(A).max())


@pytest.mark.parametrize(("seed", "structure"), list(enumerate(ARMS)))
def test_configurations_point(seed, structure):
    """Starts have the position and the z axis of the path; of redundant arms many rolls."""
    start = redundant(structure, ff.Task.POINTING, None, seed)
    branches = start.problem.branches(start.attitude)
    pose = start.problem.path.pose(0.0)
    rolls = []
    for branch in branches:
        found = start.problem.model.end_effector_pose(start.attitude, branch.joints)
        np.testing.assert_allclose(found.position, pose.position, rtol=0, atol=1e-8)
        np.testing.assert_allclose(found.rotation[:, 2], pose.rotation[:, 2], rtol=0, atol=1e-8)
        across = pose.rotation.T @ found.rotation[:, 0]
        rolls.append(np.arctan2(across[1], across[0]))
    assert len(branches) >= (8 if len(structure) > 5 else 1)
    if len(structure) > 5:
        assert np.ptp(rolls) > 1.0
    if len(structure) == 5:  # the configuration at which the path was made is among them
        near = [start.problem.model.joint_distance(b.joints, start.joints) for b in branches]
        assert min(near) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("structure", ARMS)
def test_ensembles_agree(structure):
    start = redundant(structure, ff.Task.POINTING, None, 1)
    (case,) = both(start.problem, start.attitude[None], start.joints[None])
    case.assert_same()


@pytest.mark.slow
def test_an_arm_that_spins_its_last_joint_is_singular():
    """A UR5 rolls about its last axis: its motion ends, in an ensemble and precisely."""
    problem = ff.load_scenario("ur5_servicer/inspect").problem().replace(task="pointing")
    attitude = np.array([0.87425374, -0.15937048, -0.17901087, -0.42218073])
    joints = [2.78216059, -2.87964745, -0.12794249, 1.34412274, 1.11930785, -3.10945249]
    start = problem.branch_near(attitude, joints, ()).joints
    (case,) = both(problem, attitude[None], start[None])
    assert case.motion.ending is Ending.SINGULAR
    assert case.motion.final.time == pytest.approx(3.306, abs=1e-3)
    for result in (case.coarse, case.fine):
        assert result.endings[0] == SINGULAR
        assert result.ended_at[0] == pytest.approx(case.motion.final.time, abs=1e-3)


def test_a_path_without_orientation_raises():
    """The z axis needs a direction; so does a task for which the arm has too few joints."""
    start = redundant("RRRRRR", ff.Task.POSITION, None)
    path = start.problem.path
    free = replace(path, path=ff.EndEffectorPath(path.path.curve))
    assert error_key(start.problem.replace, path=free, task="pointing") == "path.attitude"
    four = redundant("RRRR", ff.Task.POSITION, None).problem
    assert error_key(four.replace, task="pointing") == "task"
