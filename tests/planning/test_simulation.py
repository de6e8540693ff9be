"""Simulations of one attitude: the motion of every arm branch, and the choice of one."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.motion.extrema import joint_extents
from freefloat.motion.motion import Ending
from freefloat.paths import PolynomialCurve, SlerpOrientation
from freefloat.so3 import heading_quaternion
from tests.motions import BAD, GOOD, bundled

assert_close = partial(np.testing.assert_allclose, rtol=0)


@pytest.fixture(scope="module")
def good(spatial):
    return ff.simulate(spatial, GOOD)


def test_every_branch_starts_at_its_joints(spatial, good):
    """Eight branches, each with its closest approach."""
    assert [entry.branch.index for entry in good.branches] == list(range(8))
    for entry in good.branches:
        assert (entry.motion.initial.joints == entry.branch.joints).all()
        assert_close(entry.motion.initial.attitude, spatial.attitude(GOOD), atol=1e-15)
        assert entry.closest_approach == ff.closest_approach(entry.motion, spatial.margin.measure)


@pytest.mark.slow
def test_a_feasible_branch_that_keeps_the_limits_comes_first(planar):
    """From 230 degrees the branch with the smaller margin turns the spacecraft less."""
    start = heading_quaternion(np.deg2rad(230.0))
    free = ff.simulate(planar, start)
    (other,) = (entry for entry in free.branches if entry is not free.chosen)
    fast, slow = (
        ff.check_limits(entry.motion, ff.Limits(base_rate=1.0))[0].worst
        for entry in (free.chosen, other)
    )
    chosen = ff.simulate(planar, start, limits=ff.Limits(base_rate=(fast + slow) / 2.0))
    assert (chosen.chosen.branch.index, chosen.limit_results[0].kept) == (other.branch.index, True)
    names = {branch: verdict.name for branch, verdict in chosen.verdicts.items()}
    assert names == {other.branch.index: "", free.chosen.branch.index: "base_rate"}
    for base_rate in (0.9 * slow, 1.1 * fast):  # kept by none, by both
        same = ff.simulate(planar, start, limits=ff.Limits(base_rate=base_rate))
        assert same.chosen.branch.index == free.chosen.branch.index


@pytest.mark.slow
def test_a_branch_that_completes_comes_before_one_that_does_not(planar):
    """At 140 degrees one branch is singular: the other is chosen, however small its margin."""
    simulation = ff.simulate(planar, heading_quaternion(np.deg2rad(140.0)))
    endings = {entry.branch.label: entry.motion.ending for entry in simulation.branches}
    assert endings == {"elbow+": Ending.SINGULAR, "elbow-": Ending.COMPLETED}
    assert simulation.chosen.branch.label == "elbow-"
    wide = replace(planar, margin=ff.Margin(planar.margin.measure, 20.0))
    stopped = ff.simulate(wide, heading_quaternion(np.deg2rad(140.0)), stop_at_margin=True)
    assert {entry.motion.ending for entry in stopped.branches} == {Ending.MARGIN}
    assert stopped.chosen in stopped.branches


def test_completing_counts_more_than_any_margin(spatial):
    """Pitched in the plane of the arm, four wrists straighten where the arm's own factor is larger.

    S(q2, q3) does not see the wrist: those four have the larger margin and yet do not complete.
    """
    joints = [0.0, 0.6, -1.3, 0.0, 0.3, 0.0]
    pose = spatial.model.end_effector_pose([0, 0, 0, 1], joints)
    line = PolynomialCurve.line(pose.position, pose.position + np.array([-0.3, 0.0, 0.3]))
    pitched = Rotation.from_rotvec([0.0, -2.0, 0.0]).as_matrix() @ pose.rotation
    path = ff.EndEffectorPath(line, SlerpOrientation(pose.rotation, pitched))
    problem = replace(spatial, path=ff.TimedPath(path, ff.Timing(20.0)), momentum=[0.0, 0.2, 0.0])
    simulation = ff.simulate(problem, [0, 0, 0, 1])
    failed = [entry for entry in simulation.branches if entry.motion.ending is Ending.SINGULAR]
    assert len(failed) == 4
    assert simulation.chosen.motion.completed
    assert all(
        entry.closest_approach.value > simulation.chosen.closest_approach.value for entry in failed
    )


@pytest.mark.parametrize("heading", [80.0, 120.0])
def test_where_none_completes_the_longest_motion_is_chosen(planar, heading):
    simulation = ff.simulate(planar, heading_quaternion(np.deg2rad(heading)))
    assert {branch.motion.ending for branch in simulation.branches} == {Ending.SINGULAR}
    assert {branch.minimum_margin for branch in simulation.branches} == {0.0}
    times = [branch.motion.final.time for branch in simulation.branches]
    assert simulation.chosen.motion.final.time == max(times) > min(times) + 1.0


@pytest.mark.parametrize("branch", [0, 7])
def test_a_branch_can_be_chosen_by_number(spatial, branch):
    """The requested one is chosen, whatever its margin; the others are integrated if asked for."""
    simulation = ff.simulate(spatial, BAD, branch=branch)
    assert simulation.branches == (simulation.chosen,)
    assert simulation.chosen.branch.index == branch
    compared = ff.simulate(spatial, BAD, branch=branch, others=True)
    assert [entry.branch.index for entry in compared.branches] == list(range(8))
    assert compared.chosen is compared.branches[branch]
    assert compared.chosen.minimum_margin == simulation.chosen.minimum_margin


def test_motions_end_at_the_margin_when_asked_to(spatial):
    """Every motion that would pass S0 = 8 ends there, the others complete."""
    problem = replace(spatial, margin=ff.Margin(spatial.margin.measure, 8.0))
    simulation = ff.simulate(problem, GOOD, stop_at_margin=True)
    for entry in simulation.branches:
        if entry.motion.ending is Ending.MARGIN:
            assert entry.closest_approach.value == pytest.approx(8.0, rel=1e-9)
        else:
            assert entry.motion.completed
            assert entry.closest_approach.value > 8.0
    endings = [entry.motion.ending for entry in simulation.branches]
    assert endings.count(Ending.MARGIN) == 4
    assert simulation.chosen.motion.completed


@pytest.mark.slow
def test_a_redundant_arm_starts_from_a_set_of_configurations_and_requested_joints(spatial):
    """Six joints, three coordinates: a spread of configurations, and one more when asked for."""
    near = ff.EndEffectorPath(
        PolynomialCurve.line([1, 0, 0], [0.85, 0.08, 0.033]), spatial.path.path.orientation
    )
    problem = replace(
        spatial, task=ff.Task.POSITION,
        margin=ff.Margin(ff.singularity_measure(spatial.model, ff.Task.POSITION, "gjm"), 0.0),
        path=ff.TimedPath(near, ff.Timing(10.0)),
    )  # fmt: skip
    joints = spatial.branches(spatial.attitude(GOOD))[3].joints
    simulation = ff.simulate(problem, GOOD, joints=joints, others=True)
    assert simulation.chosen.branch.label == "given"
    assert len(simulation.branches) == len(problem.branches(spatial.attitude(GOOD))) + 1
    assert len({entry.branch.index for entry in simulation.branches}) == len(simulation.branches)
    assert_close(simulation.chosen.motion.initial.joints, joints, atol=1e-6)
    for entry in simulation.branches:
        assert entry.motion.residuals().end_effector_position < 1e-7


@pytest.mark.slow
def test_joints_are_shifted_into_their_ranges():
    """The start of one branch fits its range, the motion from there only a full rotation lower."""
    whole = bundled("ur5_servicer/arc")
    robot = ET.fromstring(whole.model.description.text)
    limit = robot.find("joint[@name='shoulder_pan_joint']/limit")
    limit.set("lower", "-7.0")
    limit.set("upper", "0.5")
    model = ff.FreeFloatingModel.from_urdf(ET.tostring(robot, encoding="unicode"), "tool0")
    margin = ff.Margin(ff.singularity_measure(model, whole.task, "gjm"), 0.0)
    problem = replace(whole, model=model, margin=margin)
    (free,), (shifted,) = (
        [entry for entry in ff.simulate(case, [0, 0, 0, 1]).branches if entry.branch.index == 7]
        for case in (whole, problem)
    )
    span = joint_extents(free.motion)
    assert span.low[0] > -0.3
    assert span.high[0] > 0.6
    assert_close(shifted.branch.joints - free.branch.joints, [-2 * np.pi, 0, 0, 0, 0, 0], atol=1e-6)
    assert_close(shifted.motion.initial.joints, shifted.branch.joints, atol=0)
    assert joint_extents(shifted.motion).high[0] < 0.5
    chosen = ff.simulate(problem, [0, 0, 0, 1], joints=free.branch.joints).chosen
    assert chosen.branch.index == 7
