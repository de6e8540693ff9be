"""Arguments of the Python interface: names for objects, and errors for other types."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import freefloat as ff
from freefloat.beyond.joint_space.components import singularity_components
from freefloat.dynamics.generalized_jacobian import generalized_determinant, system_matrix
from freefloat.dynamics.momentum import end_effector_jacobian, inertia_matrices, momentum_map
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.io.trajectory import Trajectory
from freefloat.planning.simulation import Simulation
from tests.errors import error_key

pytestmark = pytest.mark.usefixtures("kernels")

LINE = ff.paths.PolynomialCurve.line([1.2, 0.2, 0.0], [0.8, 0.6, 0.0])
TIMING = ff.Timing(20.0)
LOAD = partial(ff.FreeFloatingModel.from_urdf, "planar_3dof")


@pytest.fixture(scope="module")
def model() -> ff.FreeFloatingModel:
    """Three planar joints, redundant for positions."""
    return ff.FreeFloatingModel.from_urdf("planar_3dof", "end_effector")


@pytest.fixture(scope="module")
def problem(model: ff.FreeFloatingModel) -> ff.Problem:
    """A path without an orientation, and a task by name."""
    margin = ff.Margin(ff.singularity_measure(model, "planar-position", "gjm"), 0.05)
    timed = ff.TimedPath(ff.EndEffectorPath(LINE), TIMING)
    return ff.Problem(model, timed, "planar-position", [0, 0, 0.5], margin)


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    """Both elbow branches, the second chosen."""
    problem = ff.load_scenario("planar_2dof/line").problem()
    return ff.simulate(problem, [0.0, 0.0, 0.0, 1.0], branch=1, others=True)


@pytest.mark.parametrize(
    ("function", "others"),
    [
        (ff.plan, ()),
        (ff.simulate, ([0, 0, 0, 1],)),
        (ff.integrate_motion, ([0, 0, 0, 1], [0.0] * 3)),
        (FeasibilityEvaluator, ()),
        (ff.attitude_map, (64,)),
        (ff.workspace_regions, ()),
        (ff.margin_curves, ()),
        (ff.touch_points, ()),
    ],
)
def test_functions_of_problems_refuse_other_types(function, others) -> None:
    for value in (ff.load_scenario("planar_3dof/parabola"), "spatial_6dof/line"):
        assert error_key(function, value, *others) == "problem"


def test_unknown_names_are_refused(model: ff.FreeFloatingModel) -> None:
    assert error_key(ff.singularity_measure, model, "positon", "gjm") == "task"
    assert error_key(ff.Timing, 2.0, "septic") == "timing.law"
    assert error_key(ff.Search, "best") == "search.objective"


@pytest.mark.parametrize(
    "number", ["1", 1j, 10**400, np.nan, [1.0, 2.0], np.ones((2, 2)), np.array("x")]
)
def test_numbers_are_no_words_arrays_or_complex(problem: ff.Problem, number: object) -> None:
    assert error_key(lambda: ff.Redundancy(metric={"a": number})) == "redundancy.metric.a"
    assert error_key(lambda: ff.Limits(base_rate=number)) == "limits.base_rate"
    assert error_key(problem.stretched, number) == "factor"


@pytest.mark.parametrize(
    "vector", [["1", "2", "3"], [1j, 0, 0], [10**400] * 3, [[1.0], [2.0, 3.0]], np.ones(2), "1"]
)
def test_vectors_are_finite_and_real(problem: ff.Problem, vector: object) -> None:
    assert error_key(lambda: problem.replace(momentum=vector)) == "momentum"
    assert error_key(ff.paths.SplineCurve, np.eye(3), vector) == "s"
    assert error_key(lambda: ff.Payload(1.0, vector)) == "payload.inertia"


@pytest.mark.parametrize("function", [
    ff.generalized_jacobian, system_matrix, inertia_matrices, momentum_map, end_effector_jacobian,
    lambda model, q: ff.singularity_measure(model, "position", "gjm")(q),
    lambda model, q: model.end_effector_pose([0.0, 0.0, 0.0, 1.0], q),
])  # fmt: skip
def test_joints_are_as_many_finite_numbers_as_move(function) -> None:
    model = ff.FreeFloatingModel.from_urdf("spatial_6dof")
    wrong = [0.1] * 5, [0.1] * 7, [0.1] * 5 + [np.nan], ["1"] * 6, [1j] * 6, 0.3, None, {"q1": 1}
    wrong += ([[1.0], [2.0, 3.0]],)
    for joints in (*wrong, np.zeros((2, 2, 6))):
        assert error_key(function, model, joints) == "joints"
    assert system_matrix(model, np.zeros((0, 6)), "position").shape == (0, 6, 9)
    assert error_key(momentum_map, model, [0.0, 0.0, 0.0, 1.0], np.zeros(6)) == "attitude"
    assert error_key(generalized_determinant, model, np.zeros(6), "position") == "task"


def test_numbers_of_single_precision_are_numbers() -> None:
    """Comparing them with the largest double warns, which is an error in these tests."""
    assert ff.Client(np.float32(5.0), [1.0, 1.0, 1.0]).mass == 5.0


@pytest.mark.parametrize("count", [64.5, "64", True, float("nan"), [64], np.int64(0)])
def test_counts_are_whole_numbers(problem: ff.Problem, count: object) -> None:
    assert error_key(lambda: ff.Search(samples=count)) == "search.samples"
    assert error_key(lambda: ff.plan(problem, threads=count)) == "threads"


def test_robots_are_accepted_by_name(model, tmp_path, monkeypatch):
    assert model.total_mass == 471.0
    assert {ff.RobotSource("planar_3dof"): 1}[ff.RobotSource("planar_3dof")] == 1
    (tmp_path / "planar_3dof").mkdir()
    monkeypatch.chdir(tmp_path)  # a folder of that name is no robot
    assert ff.FreeFloatingModel.from_urdf("planar_3dof.urdf").dof == 3
    assert ff.FreeFloatingModel.from_urdf("example-robot-data:ur10", "tool0").dof == 6
    assert error_key(ff.FreeFloatingModel.from_urdf, "spatial_6dfo") == "urdf"


def test_position_tasks_need_no_orientation(problem: ff.Problem) -> None:
    start = problem.branches([0.0, 0.0, 0.0, 1.0])[0].joints
    motion = ff.integrate_motion(problem, [0.0, 0.0, 0.0, 1.0], start)
    assert motion.completed
    assert motion.residuals().end_effector_position < 1e-8
    assert error_key(lambda: replace(problem, task=ff.Task.PLANAR_POSE)) == "path.attitude"


def test_arguments_of_other_types_are_refused(problem: ff.Problem, simulation: Simulation) -> None:
    motion, seven = simulation.chosen.motion, ff.Limits(joint_rate=np.ones(7))
    for key, call in (
        ("limits.joint_rate", lambda: ff.plan(problem, ff.Search({"time": 1.0}), seven)),
        ("limits.joint_rate", lambda: ff.attitude_map(problem, 24, limits=seven)),
        ("measure", lambda: ff.closest_approach(motion, "arm")),
        ("search", lambda: ff.plan(problem, {"samples": 64})),
        ("result", lambda: ff.figures(problem)),
        ("study", lambda: ff.run_study("planar_3dof/grid", "results")),
        ("scale_mass.link_1", lambda: LOAD(scale_mass={"link_1": "2"})),
        ("order", lambda: TIMING.s(3.0, -1)),
        ("file", lambda: ff.export(motion, None)),
        ("found", lambda: singularity_components(None)),
        ("order", lambda: ff.ArmCurve([[0.0], [1.0]], [0.0, 1.0]).at(0.3, 3)),
        ("t", lambda: ff.Tumbling([9, 7, 4], [0.1, 0.3, 0.2]).rotation(np.array([5.0, -5.0]))),
        ("client.mass", lambda: ff.Client(-1.0, [1.0, 1.0, 1.0])),
        ("poses", lambda: ff.paths.through(3)),
        ("measure", lambda: ff.singularity_measure(problem.model, "position", ["gjm"])),
        ("factor", lambda: problem.stretched(0.0)),
        ("goal.pose.rotation", lambda: ff.Goal(ff.so3.Pose(np.ones(3), np.diag([1, 1, -1])))),
        ("goal.pose.position", lambda: ff.Goal(ff.so3.Pose([1.0, 0.0], np.eye(3)))),
        ("goal.joints", lambda: ff.Goal(joints=[[1.0], [2.0, 3.0]])),
        ("start_joints", lambda: problem.replace(start_joints=[[1.0], [2.0, 3.0]])),
        ("times", lambda: Trajectory.of(motion, [])),
        ("times", lambda: motion.sample([[1.0, 2.0]])),
        ("boundary", lambda: ff.attitude_map(problem, 24, boundary=-1)),
        ("levels", lambda: ff.margin_curves(motion.problem, np.nan)),
        ("level", lambda: ff.touch_points(motion.problem, level="5")),
        ("branch", lambda: ff.simulate(motion.problem, heading=0.0, branch=[])),
        ("mass_error", lambda: ff.track(simulation, mass_error=[0.1, 0.2])),
        ("arms.left", lambda: LOAD(arms={"left": None})),
        ("fixed_joints.q2", lambda: LOAD("end_effector", fixed_joints={"q2": "0.5"})),
    ):
        assert error_key(call) == key
