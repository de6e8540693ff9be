"""Phases are checked against the problem and one another before anything is planned."""

from dataclasses import replace
from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.beyond.missions.manoeuvre import checked_phases
from freefloat.beyond.missions.path_phase import moved_to_begin_at, require_continuous
from freefloat.beyond.missions.state import SystemState
from freefloat.dynamics.plane import Plane
from freefloat.dynamics.tasks import Task
from freefloat.so3 import Pose
from tests.errors import error_key

GRAPPLE = np.array([0.5, 1.2, 0.0])
HERE, THERE, BEYOND = (GRAPPLE + k * np.array([0.2, -0.1, 0.0]) for k in range(3))
TUMBLING = ff.Tumbling([0.1, 0.1, 0.2], [0.0, 0.0, 0.02], com=[0.05, 0.0, 0.0])
BODIES = (
    ff.SceneBody("client", ff.Sphere(0.1), GRAPPLE, motion=TUMBLING),
    ff.SceneBody("payload", ff.Sphere(0.1), [3.0, 3.0, 0.0]),
    ff.SceneBody("tool", ff.Sphere(0.1), motion="target"),
)
SPINNER = ff.SceneBody(
    "spinner", ff.Sphere(0.1), [0.3, 1.0, 0.0], motion=ff.Tumbling([0.1, 0.1, 0.2], [0, 0, 0.03])
)
CAPTURE = ff.CapturePhase("client", 3.0)


def rest(*joints: float, duration: float | None = 9.0) -> ff.GoalPhase:
    return ff.GoalPhase(ff.Goal(joints=joints, duration=duration))


REST = rest(0.4, 1.2, duration=30.0)


def line(start: Any, end: Any) -> ff.EndEffectorPath:
    return ff.EndEffectorPath(ff.paths.PolynomialCurve.line(start, end))


def timed(start: Any, end: Any, law: str = "quintic") -> ff.PathPhase:
    return ff.PathPhase(ff.TimedPath(line(start, end), ff.Timing(9.0, law)))


def to(
    point: Any, kind: Any = ff.PathPhase, frame: str = "inertial", duration: float = 20.0
) -> Any:
    return kind(ff.Goal(Pose(point, np.eye(3)), frame=frame, duration=duration))


def beside(body: ff.SceneBody, place: Any, time: float) -> ff.PathPhase:
    """A path in the frame of a body that begins at a place at a time."""
    start = body.later(time, np.zeros(3)).pose.inverse() @ Pose(place, np.eye(3))
    there = line(start.position, start.position + np.array([0.1, 0.0, 0.0]))
    return ff.PathPhase(ff.paths.RelativePath(body, there, ff.Timing(9.0)))


@pytest.fixture(scope="module")
def problem() -> ff.Problem:
    """Its end-effector is named by the joint that moves it."""
    problem = ff.load_scenario("planar_2dof/line").problem()
    system = ff.System(ff.FreeFloatingModel.from_urdf("planar_2dof", "tool"))
    return replace(problem.with_system(system), scene=ff.Scene(BODIES))


@pytest.fixture(scope="module")
def state(problem: ff.Problem) -> SystemState:
    """At the end of the first path."""
    motion = ff.simulate(problem, heading=0.45).chosen.motion
    return SystemState.at_start(motion).after(motion)


@pytest.fixture
def no_planning(monkeypatch) -> None:
    def planned(*_: Any, **__: Any) -> None:
        raise AssertionError("the path was planned")

    monkeypatch.setattr("freefloat.beyond.missions.manoeuvre_planner.plan", planned)


ANY = "uniform"
"""A law of time by which a path neither begins nor ends at rest."""


@pytest.mark.usefixtures("no_planning")
@pytest.mark.parametrize(("phases", "key"), [
    ([rest(1.0, 2.0, 3.0)], "phases.0.goal.joints"),
    ([rest(1.0, 1e6)], "phases.0.goal.joints"),
    ([rest(1.0, 2.0, duration=1e9)], "phases.0.scene.bodies.tumbling.rate"),
    ([ff.CapturePhase("nobody", 3.0)], "phases.0.body"),
    ([ff.CapturePhase("payload", 3.0)], "phases.0.inertia"),
    ([ff.CapturePhase("payload", 3.0, [0.1, 0.1, 0.1], [0.0, 0.0, 1e-3])], "phases.0.body"),
    ([ff.CapturePhase("payload", 3.0, [0.1, 0.0, 1e-3, 0.1, 0.0, 0.1])], "phases.0.body"),
    ([replace(CAPTURE, com=[0.050002, 0.0, 0.0])], "phases.0.com"),  # a jump of its momentum
    ([replace(CAPTURE, inertia=[0.200006, 0.2, 0.4])], "phases.0.inertia"),
    ([replace(CAPTURE, com=[0.0500009, 0.0, 0.0], inertia=[0.2000001, 0.2, 0.4])], ""),
    ([CAPTURE, beside(BODIES[0], HERE, 0.0)], "phases.1.path.frame"),
    ([CAPTURE, to(HERE, ff.GoalPhase, "client")], "phases.1.goal.pose.frame"),
    ([timed(HERE, [0.9, 1.0, 0.5])], "phases.0.path"),
    ([to([1.0, 0.5, 0.5])], "phases.0.path"),
    ([to([1.0, 0.5, 0.5], ff.GoalPhase, "spacecraft")], "phases.0.goal.pose.position"),
    ([beside(BODIES[0], HERE, 0.0)], "phases.0.path"),  # the client tumbles, the arm rests
    ([replace(to(THERE), redundancy=ff.Redundancy())], "phases.0.redundancy"),
    ([replace(REST, name="a"), to(THERE), replace(REST, name="a")], "phases.2.name"),
    ([REST, "berth"], "phases.1"),
    (5, "phases"),
    ([CAPTURE, beside(SPINNER, HERE, 30.0)], ""),  # after a capture no twist is known
    ([timed(HERE, THERE), CAPTURE, beside(SPINNER, THERE, 39.0)], ""),
    ([timed(HERE, THERE), CAPTURE, beside(SPINNER, THERE, 30.0)], "phases.2.path"),
    ([to(THERE, ff.GoalPhase), timed(THERE, BEYOND)], ""),
    ([to(THERE, ff.GoalPhase), timed(THERE, BEYOND, ANY)], "phases.1.path"),
    ([to(THERE, ff.GoalPhase, "spacecraft"), timed(HERE, BEYOND, ANY)], ""),
    ([REST, timed(HERE, BEYOND, ANY)], ""),
    ([rest(0.4, 1.2, duration=None), timed(HERE, BEYOND, ANY)], ""),
    ([to(THERE), timed(THERE, BEYOND)], ""),
    ([to(THERE), timed(THERE, BEYOND, ANY)], "phases.1.path"),
    ([to(THERE, frame="end_effector"), timed(HERE, BEYOND)], ""),
    ([CAPTURE, timed(HERE, THERE, ANY), timed(THERE, BEYOND, ANY)], ""),
    ([CAPTURE, timed(HERE, THERE, ANY), timed(THERE, BEYOND)], "phases.2.path"),
])  # fmt: skip
def test_phases_follow_one_another_as_far_as_is_known_before_planning(problem, phases, key) -> None:
    """The first path takes 30 s; the centre of mass drifts."""
    path = replace(problem.path, drift=[0.003, -0.006, 0.0])
    problem = replace(problem, path=path, scene=ff.Scene((*BODIES, SPINNER)))
    if key:
        assert error_key(ff.plan_manoeuvre, problem, phases) == key
    else:
        checked_phases(problem, phases)


@pytest.mark.usefixtures("no_planning")
def test_a_reorientation_begins_at_present_joints_in_their_ranges() -> None:
    problem, level = ff.load_scenario("panda_servicer/line").problem(), [0.0, 0.0, 0.0, 1.0]
    beyond = ff.Search("nearest", level, joints=[0.0, 3.0, 0.0, -1.0, 0.0, 1.0, 0.0])
    for search, key in ((beyond, "joints"), (ff.Search("nearest", level), "joints"),
                        (ff.Search("margin"), "from_attitude")):  # fmt: skip
        refused = error_key(ff.plan_manoeuvre, problem, (), search, reorient=True)
        assert refused == f"search.{key}"


@pytest.mark.parametrize("duration", [0.0, 1e-300, 1e-9, np.inf, np.nan, "3"])
def test_durations_are_seconds_that_can_be_integrated(duration: Any) -> None:
    assert error_key(to, HERE, duration=duration) == "goal.duration"
    for key, kind, *arguments in (
        ("name", ff.GoalPhase, REST.goal, 3), ("name", ff.PathPhase, to(HERE).path, 3),
        ("timing.law", timed, HERE, THERE, "optimal"),
        ("path.duration", ff.PathPhase, replace(to(HERE).path, duration=None)),
        ("path.frame", ff.PathPhase, replace(to(HERE).path, frame="client")),
        ("path.pose", ff.PathPhase, replace(to(HERE).path, attitude=[0.0, 0.0, 0.0, 1.0])),
        ("path", ff.PathPhase, REST), ("margin", ff.PathPhase, to(HERE).path, "", -1.0),
        ("redundancy", ff.PathPhase, to(HERE).path, "", 0.0, 3), ("body", ff.CapturePhase, 3, 3.0),
    ):  # fmt: skip
        assert error_key(kind, *arguments) == key


def test_unnamed_phases_have_distinct_names() -> None:
    text = yaml.safe_load(ff.load_scenario("planar_2dof/line").text)
    resting, there = {"joints": [0.4, 1.2], "duration": 9.0}, {"position": [1.0, 0.5, 0.0]}
    given = [resting, {"to": there, "duration": 9.0}, resting, {**resting, "name": "goal"}]
    names = [phase.name for phase in ff.load_scenario({**text, "phases": given}).phases()]
    assert names == ["goal 2", "to", "goal 3", "goal"]


def test_a_path_that_begins_within_rounding_is_moved_there(state: SystemState) -> None:
    rounded = line(GRAPPLE + np.array([4e-7, -3e-7, 0.0]), [0.9, 1.0, 0.0])
    path = ff.PathPhase(ff.TimedPath(rounded, ff.Timing(10.0))).setting_at(state).path
    np.testing.assert_allclose(path.pose(0.0).position, state.pose.position, atol=1e-14)
    np.testing.assert_allclose(path.pose(10.0).position, [0.9, 1.0, 0.0], atol=1e-6)


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.48, 0.6, 0.64)])
@pytest.mark.parametrize("task", Task)
def test_jumps_count_in_what_a_task_prescribes(task, normal):
    """Of place and twist, not those within rounding; an axis that points may turn about itself."""
    pose = Pose(HERE, Rotation.from_rotvec([0.4, -0.7, 0.2]).as_matrix())
    plane = Plane.of_normal(np.array(normal))
    problem: Any = SimpleNamespace(task=task, plane=plane)
    axes = pose.rotation if task is Task.POINTING else np.eye(3)
    axes = plane.axes if task.planar else axes
    for component, size in product(range(6), (0.9e-6, 1.8e-6)):
        jump = (size * np.eye(6)[component].reshape(2, 3) @ axes.T).ravel()
        turn = Rotation.from_rotvec(jump[3:]).as_matrix()
        for shift, twist in ((jump, np.zeros(6)), (np.zeros(6), jump)):
            rotation = turn @ pose.rotation if shift.any() else pose.rotation
            there = line(HERE + shift[:3], THERE + shift[:3]).curve
            fixed = ff.paths.FixedOrientation(rotation)
            path = ff.TimedPath(ff.EndEffectorPath(there, fixed), ff.Timing(9.0))
            if size > 1e-6 and component in np.arange(6)[task.rows]:
                assert error_key(require_continuous, path, pose, twist, problem) == "path"
            else:
                require_continuous(path, pose, twist, problem)
            if task is Task.POSE:
                moved = moved_to_begin_at(path, pose, problem).pose(0.0)
                np.testing.assert_allclose(moved.position, HERE, atol=1e-15)
                np.testing.assert_allclose(moved.rotation, pose.rotation, atol=1e-14)


@pytest.mark.slow
def test_joint_rates_of_a_redundant_arm_do_not_jump() -> None:
    """The end-effector may go on as before while the arm would have to change its rates at once."""
    posed = ff.load_scenario("planar_3dof/parabola").problem()
    problem, attitude = posed.replace(task="planar-position"), posed.attitude(heading=2.4)
    motion = ff.integrate_motion(problem, attitude, posed.branches(attitude)[1].joints)
    state = SystemState.at_start(motion).after(motion)
    back = ff.PathPhase(
        ff.Goal(Pose([-0.05, 0.0, 0.0], np.eye(3)), frame="end_effector", duration=20.0)
    )
    assert back.run(state, ff.Limits()).feasible
    moving = replace(state, joint_rates=state.joint_rates + np.array([0.0, 0.01, -0.01]))
    found = back.run(moving, ff.Limits())
    assert not found.feasible
    assert "joint rates" in found.reason


def test_a_corridor_remains_after_a_capture_unless_it_is_that_of_the_captured_body(problem) -> None:
    for body, remains in ((None, True), ("payload", True), ("client", False)):
        corridor = ff.Corridor([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], radius=9.0, body=body)
        scene = ff.Scene(BODIES, corridor)
        motion = ff.simulate(replace(problem, scene=scene), heading=0.45).chosen.motion
        before = SystemState.at_start(motion).after(motion)
        result = CAPTURE.run(before, ff.Limits())
        state = CAPTURE.end(before, result)
        assert (state.problem.scene.corridor is not None) is remains
        state.problem.scene.require_applicable(state.problem.model, 1.0)
        grasped = state.problem.scene.bodies[-1]
        assert (grasped.touch_links, grasped.motion) == (("end_effector",), "target")
        assert grasped.payload in {*result.model.description.links_by_name}
        held, there = state.pose @ state.problem.scene.bodies[-1].pose, before.scene.bodies[0].pose
        np.testing.assert_allclose(held.position + result.centre_of_mass, there.position, atol=1e-9)
        np.testing.assert_allclose(held.rotation, there.rotation, atol=1e-9)
