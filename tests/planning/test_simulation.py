"""Simulations of one attitude: the motions of arm branches, their choice; paths beyond reach."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import freefloat as ff
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import UnreachableError
from freefloat.io.scenario.loading import parse_scenario
from freefloat.motion.extrema import joint_extents
from freefloat.motion.motion import Ending
from freefloat.paths.curves import PolynomialCurve
from freefloat.planning.reasons import light_spacecraft_hint, out_of_reach, reach_message
from freefloat.so3 import heading_quaternion
from tests.motions import bundled
from tests.scenarios import EASY

assert_close = partial(np.testing.assert_allclose, rtol=0)


@pytest.mark.slow
def test_a_feasible_branch_that_keeps_the_limits_comes_first(planar):
    """From 230 degrees the branch with the smaller margin turns the spacecraft less."""
    start = heading_quaternion(np.deg2rad(230.0))
    free = ff.simulate(planar, start)
    (other,) = (entry for entry in free.branches if entry is not free.chosen)
    limits = ff.Limits(base_rate=1.0, base_turn=3.0)
    (fast, far), (slow, near) = (
        [result.worst for result in ff.check_limits(entry.motion, limits)]
        for entry in (free.chosen, other)
    )
    limits = ff.Limits(base_rate=(fast + slow) / 2.0, base_turn=(far + near) / 2.0)
    chosen = ff.simulate(planar, start, limits=limits)
    assert (chosen.chosen.branch.index, chosen.limit_results[0].kept) == (other.branch.index, True)
    names = {branch: verdict.name for branch, verdict in chosen.verdicts.items()}
    assert names == {other.branch.index: "", free.chosen.branch.index: "base_rate and base_turn"}
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


@pytest.mark.parametrize("heading", [80.0, 120.0])
def test_where_none_completes_the_longest_motion_is_chosen(planar, heading):
    simulation = ff.simulate(planar, heading_quaternion(np.deg2rad(heading)))
    assert {branch.motion.ending for branch in simulation.branches} == {Ending.SINGULAR}
    assert {branch.minimum_margin for branch in simulation.branches} == {0.0}
    times = [branch.motion.final.time for branch in simulation.branches]
    assert simulation.chosen.motion.final.time == max(times) > min(times) + 1.0


@pytest.mark.slow
def test_joints_are_shifted_into_their_ranges():
    """The start of one branch fits its range, the motion from there only a full rotation lower."""
    whole = bundled("ur5_servicer/arc")
    robot = ET.fromstring(whole.model.description.text)
    limit = robot.find("joint[@name='shoulder_pan_joint']/limit")
    limit.attrib.update(lower="-7.0", upper="0.5")
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


def along(start: list[float], end: list[float]) -> ff.Problem:
    line = ff.load_scenario("spatial_6dof/line").problem()
    path = ff.EndEffectorPath(
        PolynomialCurve.line(np.array(start), np.array(end)), line.path.path.orientation
    )
    return replace(line, path=ff.TimedPath(path, line.path.timing))


def test_the_place_where_a_path_leaves_the_reach_lies_on_the_reach() -> None:
    problem = along([1.0, 0.0, 0.0], [-5.0, 8.0, 0.33])
    s = out_of_reach(problem)
    assert s is not None
    reach = VirtualManipulator.of(problem.model).reach
    position = problem.path.path.curve(s)
    assert np.linalg.norm(position) == pytest.approx(reach, rel=1e-9)
    assert f"s = {s:.3g}" in str(reach_message(problem))


def test_simulations_of_paths_out_of_reach() -> None:
    with pytest.raises(UnreachableError):
        ff.simulate(along([1000.0, 0.0, 0.0], [1.0, 0.0, 0.0]), [0.0, 0.0, 0.0, 1.0])
    leaving = ff.simulate(along([1.0, 0.0, 0.0], [-5.0, 8.0, 0.33]), [0.0, 0.0, 0.0, 1.0])
    assert leaving.to_dict()["out_of_reach"]


def test_a_spacecraft_lighter_than_its_arm_is_reported() -> None:
    """The UR5's base link alone, 4 kg, carries the arm."""
    bare = "urdf: 'example-robot-data:ur5', end_effector: tool0"
    text = EASY.replace("urdf: spatial_6dof, end_effector: end_effector", bare)
    text = text.replace("measure: arm", "measure: gjm")
    light = parse_scenario(text, Path("bare.yaml")).problem()
    assert "robot.spacecraft" in light_spacecraft_hint(light)
    assert light_spacecraft_hint(ff.load_scenario("spatial_6dof/line").problem()) == ""


def test_a_start_whose_motion_cannot_be_integrated_is_left_out(monkeypatch, caplog):
    with monkeypatch.context() as patch:  # the motions of four branches take more steps
        patch.setattr("freefloat.motion.integration._MAX_STEPS", 25)
        simulation = ff.simulate(bundled("spatial_6dof/line"), [0.1, 0.5, 0.2, -0.8367])
    assert [entry.branch.index for entry in simulation.branches] == [2, 3, 4, 5]
    assert len(caplog.records) == 4
    assert not ff.check(simulation).passed  # with all steps they can be integrated
