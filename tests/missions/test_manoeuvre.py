"""Manoeuvres: every phase begins with the state at which the one before ends."""

from dataclasses import replace

import numpy as np
import pytest

import freefloat as ff
from freefloat.beyond.missions.manoeuvre import Manoeuvre
from freefloat.beyond.missions.state import SystemState
from freefloat.certificate.certificate import certify
from freefloat.paths.timing import TimeLaw
from freefloat.rotations import rotation_matrix
from freefloat.so3 import Pose, angle_between

GRAPPLE = np.array([0.5, 1.2, 0.0])
SPIN = np.array([0.0, 0.0, 0.02])
CLIENT = ff.SceneBody(
    "client", ff.Sphere(0.1), position=GRAPPLE, motion=ff.Tumbling([0.1, 0.1, 0.1], SPIN)
)
BACK = ff.Goal(Pose(np.array([0.1, 0.1, 0.0]), np.eye(3)), frame="end_effector", duration=20.0)
PHASES = [
    ff.CapturePhase("client", 3.0),
    ff.GoalPhase(ff.Goal(joints=[0.4, 1.2], duration=25.0), "berth"),
    ff.PathPhase(BACK, "back"),
]
SEARCH = ff.Search("nearest", [0.0, 0.0, 0.0, 1.0], joints=[0.5, 0.8])
LIMITS = ff.Limits(joint_rate=[0.5, 0.5])


@pytest.fixture(scope="module")
def problem() -> ff.Problem:
    problem = ff.load_scenario("planar_2dof/line").problem()
    return replace(problem, scene=ff.Scene((CLIENT,)))


@pytest.fixture(scope="module")
def state(problem: ff.Problem) -> SystemState:
    """At the end of the first path."""
    motion = ff.simulate(problem, heading=0.45).chosen.motion
    return SystemState.at_start(motion).after(motion)


@pytest.fixture(scope="module")
def progress() -> list[float]:
    """The fractions that were reported while the manoeuvre was planned."""
    return []


@pytest.fixture(scope="module")
def manoeuvre(problem: ff.Problem, progress: list[float]) -> Manoeuvre:
    report = progress.append
    return ff.plan_manoeuvre(problem, PHASES, SEARCH, LIMITS, reorient=True, progress=report)


def test_a_manoeuvre_leads_from_the_present_state_through_all_phases(manoeuvre, progress) -> None:
    assert manoeuvre.feasible
    assert progress == sorted(progress)
    assert 0.5 <= progress[0] < progress[-1] < 0.9
    names = ["reorientation", "path", "capture", "berth", "back"]
    assert [phase.name for phase in manoeuvre.phases] == names
    first, last = manoeuvre.phases[0].motion, manoeuvre.phases[-1].motion
    np.testing.assert_allclose(first.initial.attitude, [0.0, 0.0, 0.0, 1.0], atol=1e-6)
    np.testing.assert_allclose(first.initial.joints, [0.5, 0.8], atol=1e-12)
    ends = [phase.start + phase.duration for phase in manoeuvre.phases]
    starts = [phase.start for phase in manoeuvre.phases]
    np.testing.assert_allclose(ends[:-1], starts[1:], atol=1e-9)
    before = manoeuvre.phases[-2].motion
    there = before.model.end_effector_pose(before.final.attitude, before.final.joints)
    goal = there @ BACK.pose
    model, final = last.model, last.final
    reached = model.end_effector_pose(final.attitude, final.joints).position
    np.testing.assert_allclose(reached, goal.position, atol=1e-8)


def test_a_captured_body_brings_its_momentum_along(manoeuvre) -> None:
    """Conservation: the robot at rest, the client of 3 kg on its circle, about the new centre."""
    path, capture = manoeuvre.path.chosen.motion, manoeuvre.phases[2].result
    np.testing.assert_allclose(path.problem.momentum, 0.0)
    client, robot = 3.0, path.problem.model.total_mass
    centre = client / (client + robot) * GRAPPLE
    np.testing.assert_allclose(capture.centre_of_mass, centre, atol=1e-9)
    np.testing.assert_allclose(capture.momentum, 0.1 * SPIN, atol=1e-12)  # its centre is at rest


@pytest.mark.parametrize("frame", ["inertial", "spacecraft", "base", "end_effector"])
def test_a_pose_goal_is_reached_in_its_frame(problem, state: SystemState, frame: str) -> None:
    model, R = problem.model, rotation_matrix(state.attitude)
    axes = np.eye(3) if frame == "inertial" else R
    origin = np.zeros(3) if frame == "inertial" else model.base_position(
        state.attitude, state.joints)  # fmt: skip
    if frame == "end_effector":
        origin, axes = state.pose.position, state.pose.rotation
    point = axes.T @ (state.pose.position - origin + np.array([0.05, -0.02, 0.0]))
    goal = ff.Goal(Pose(point, axes.T), frame=frame, duration=10.0)
    path = ff.PathPhase(goal).setting_at(state).path
    np.testing.assert_allclose(path.pose(10.0).position, origin + axes @ point, atol=1e-12)
    np.testing.assert_allclose(path.twist(10.0), 0.0, atol=1e-12)


def test_a_margin_is_required_of_later_paths(state: SystemState) -> None:
    limits = replace(LIMITS, clearance="off")  # the second link passes through the spacecraft
    found = ff.PathPhase(BACK).run(state, limits)
    assert found.limit_results == ff.check_limits(found.chosen.motion, limits)
    assert found.certificate.to_dict() == certify(found.chosen.motion).to_dict()
    margin = found.chosen.minimum_margin
    for factor, feasible in ((0.99, True), (1.01, False)):
        back = ff.PathPhase(BACK, "back", margin=factor * margin)
        assert back.run(state, limits).feasible is feasible


@pytest.mark.slow
def test_the_motion_before_a_path_arrives_with_its_state(problem: ff.Problem) -> None:
    """With momentum and joint rates: the path does not begin at rest."""
    timing = replace(problem.path.timing, law=TimeLaw.UNIFORM)
    drifting = problem.replace(
        momentum=[0.0, 0.0, 0.02], path=replace(problem.path, timing=timing)
    )  # fmt: skip
    found = ff.plan_manoeuvre(drifting, (), SEARCH, LIMITS, reorient=True)
    assert found.feasible, found.reason
    arrived, path = found.phases[0], found.path.chosen.motion
    assert angle_between(arrived.motion.final.attitude, path.initial.attitude) < 1e-9
    rates = path.law.rates(0.0, path.initial.attitude, path.initial.joints).joints
    assert np.abs(rates).max() > 0.01
    np.testing.assert_allclose(arrived.result.goal.joint_rates, rates, atol=1e-12)
    assert arrived.result.error < 1e-9
    report = ff.check(found)
    assert report.passed, report.discrepancies
