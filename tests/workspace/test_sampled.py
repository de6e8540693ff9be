"""Reach and areas from samples: against exact ones, and every area has its witnesses."""

from __future__ import annotations

import re

import numpy as np
import pytest

import freefloat as ff
from freefloat.dynamics.measures import singularity_measure
from freefloat.errors import InputError
from freefloat.motion.problem import Margin, Problem
from freefloat.robot.model import FreeFloatingModel
from freefloat.workspace.margin_curves import planar_workspace
from freefloat.workspace.planar_arm import PlanarArm
from freefloat.workspace.regions import workspace_regions
from freefloat.workspace.sampled import sampled_workspace, singular_configurations
from tests.robots import inertial_text, joint_text, link_text, planar_robot

TWO = planar_robot([40, 4, 3], [6.667, 0.333, 0.25], [0.5, 0.5], [0.5, 0.5, 0.5])
LIGHT = planar_robot([20, 9, 6], [1.5, 0.9, 0.4], [0.7, 0.3], [0.3, 0.4, 0.5])


def problem_of(model: FreeFloatingModel, task: ff.Task) -> Problem:
    path = ff.load_scenario("planar_3dof/parabola_nonstop").problem().path
    return Problem(
        model, path, task, [0, 0, 0], Margin(singularity_measure(model, task, "gjm"), 0.0)
    )


@pytest.mark.parametrize("text", [TWO, LIGHT], ids=["heavy spacecraft", "light spacecraft"])
def test_samples_find_what_is_known_exactly(text: str) -> None:
    """Reach and areas of planar arms of two joints."""
    problem = problem_of(FreeFloatingModel.from_urdf(text), ff.Task.PLANAR_POSITION)
    exact, sampled = planar_workspace(problem), sampled_workspace(problem)
    assert not sampled.exact
    assert np.array(sampled.reach) == pytest.approx(np.array(exact.reach), abs=1e-6)
    for found, known in (
        (sampled.path_dependent, exact.path_dependent),
        (sampled.path_independent, exact.path_independent),
    ):
        assert np.array(found) == pytest.approx(np.array(known), abs=1e-5)


def test_an_arm_of_three_joints_in_space_has_areas() -> None:
    """Position of the wrist of Example 2's arm, its hand held still: elbow and shoulder fold.

    Every radius told to be path-dependent has a singular configuration within a hundredth of the
    reach, and none was found outside.
    """
    text = ff.load_scenario("spatial_6dof/line").model().description.text
    stiff = text.replace('name="q4" type="continuous"', 'name="q4" type="fixed"')
    model = FreeFloatingModel.from_urdf(stiff, "link_4")
    problem = problem_of(model, ff.Task.POSITION)
    workspace = workspace_regions(problem)
    of = singularity_measure(model, problem.task, "gjm")
    singular = singular_configurations(problem, of)
    assert max(abs(of(q)) for q in singular) < 1e-6 * workspace.largest_s
    radii = np.array([np.linalg.norm(model.end_effector_pose([0, 0, 0, 1], q).position)
                      for q in singular])  # fmt: skip
    assert workspace.path_dependent
    covered = np.zeros(len(radii), dtype=bool)
    for low, high in workspace.path_dependent:
        covered |= (radii > low - 1e-6) & (radii < high + 1e-6)
        for radius in np.linspace(low, high, 50):
            assert np.abs(radii - radius).min() < 0.02 * workspace.reach[1]
    assert covered.all()


def test_where_the_end_effector_is_farthest_out_the_arm_is_singular() -> None:
    """It cannot move inwards or outwards, whatever the spacecraft does: so the areas end there."""
    workspace = workspace_regions(ff.load_scenario("ur5_servicer/arc").problem())
    assert workspace.path_dependent is not None
    assert workspace.path_dependent[-1][1] == pytest.approx(workspace.reach[1], abs=1e-6)
    assert workspace.path_dependent[0][0] == pytest.approx(workspace.reach[0], abs=1e-6)
    assert (workspace.point, workspace.measure, workspace.exact) == ("end-effector", "gjm", False)


def test_of_redundant_arms_only_the_reach_is_told() -> None:
    """Their measure has no sign to change: nothing is claimed."""
    model = FreeFloatingModel.from_urdf(
        planar_robot([50, 5, 4, 3], [8, 1, 0.5, 0.3], [0.4] * 3, [0.5] * 4)
    )
    workspace = workspace_regions(problem_of(model, ff.Task.PLANAR_POSITION))
    assert workspace.path_dependent is None
    assert workspace.path_independent is None
    links = np.abs(PlanarArm.of(model).links)
    assert workspace.reach[1] == pytest.approx(links.sum(), abs=1e-6)
    assert workspace.reach[0] == pytest.approx(max(0.0, 2 * links.max() - links.sum()), abs=1e-4)


def sliding(kind: str) -> FreeFloatingModel:
    """A planar arm that turns and then slides out from 1 m to 2 m."""
    inertial = inertial_text(5.0, np.eye(3))
    text = (
        "<robot name='r'>" + link_text("bus", inertial_text(100.0, 10.0 * np.eye(3)))
        + link_text("boom", inertial) + link_text("rod", inertial)
        + joint_text("turn", "C", "bus", "boom", "0.5 0 0")
        + joint_text("slide", kind, "boom", "rod", axis="1 0 0", limits=(1.0, 2.0)) + "</robot>"
    )  # fmt: skip
    return FreeFloatingModel.from_urdf(text)


def test_a_sliding_joint_keeps_to_its_range() -> None:
    """Reach between the ends of its stroke."""
    model = sliding("P")
    workspace = workspace_regions(problem_of(model, ff.Task.PLANAR_POSITION))
    radii = [np.linalg.norm(model.end_effector_pose([0, 0, 0, 1], [turn, slide]).position)
             for turn in np.linspace(0, 6.28, 60) for slide in (1.0, 2.0)]  # fmt: skip
    assert np.array(workspace.reach) == pytest.approx([min(radii), max(radii)], abs=5e-3)


def test_a_slide_without_limits_has_no_reach() -> None:
    """It is refused by name."""
    text = sliding("P").description.text
    endless = re.sub(r'lower="1.0" upper="2.0"', 'lower="-1e9" upper="1e9"', text)
    model = FreeFloatingModel.from_urdf(endless)
    with pytest.raises(InputError) as caught:
        workspace_regions(problem_of(model, ff.Task.PLANAR_POSITION))
    assert caught.value.key == "joint slide"
