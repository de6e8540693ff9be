"""Areas of spatial arms: exact ones of elbow arms, and certified shells of any arm."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import freefloat as ff
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.singularities.planar_regions import PlanarArm, margin_curves, point_3, two_angles
from freefloat.singularities.regions import _general_workspace, exact_workspace
from freefloat.singularities.spatial_regions import elbow_arm, wrist_in_tool
from tests.errors import error_key
from tests.robots import inertial_text, joint_text, link_text, planar_robot

VARIANTS = {
    "published": ("", ""),
    "flat spacecraft": ('izz="66.67"', 'izz="20"'),
    "asymmetric tool": ('xyz="0.2 0 0"/>\n      <mass', 'xyz="0.2 0.1 -0.05"/>\n      <mass'),
    "mounted below": ('xyz="0 0 0.5"', 'xyz="0 0 -0.8"'),
    "elbow reversed": ('<origin xyz="1 0 0"/><axis xyz="0 -1 0"/>',
                          '<origin xyz="1 0 0"/><axis xyz="0 1 0"/>'),
    "elbow out of line": ('<origin xyz="1 0 0"/><axis xyz="0 -1 0"/>',
                          '<origin xyz="1 0 0.3"/><axis xyz="0 -1 0"/>'),
}  # fmt: skip


def variant(model: ff.FreeFloatingModel, name: str) -> ff.FreeFloatingModel:
    old, new = VARIANTS[name]
    assert old in model.description.text
    return ff.FreeFloatingModel.from_urdf(model.description.text.replace(old, new))


@pytest.mark.parametrize("name", VARIANTS)
def test_s_and_the_wrist_are_those_of_the_arm_in_space(
    spatial_6dof: ff.FreeFloatingModel, name: str, rng: np.random.Generator
) -> None:
    """Whatever the first joint and the wrist do: by (40) and (35)."""
    model = variant(spatial_6dof, name)
    arm, measure = elbow_arm(model), ff.singularity_measure(model, ff.Task.POSE, "arm")
    joints = rng.uniform(-4, 4, (40, 6))
    in_plane = arm.determinant(two_angles(arm, joints[:, 1:3]))
    np.testing.assert_allclose(in_plane, [measure(q) for q in joints], rtol=1e-8, atol=1e-8)
    virtual = VirtualManipulator.of(model)
    distances = [
        np.linalg.norm(pose.position + pose.rotation @ wrist_in_tool(virtual))
        for pose in (model.end_effector_pose([0, 0, 0, 1], q) for q in joints)
    ]
    np.testing.assert_allclose(np.abs(point_3(arm, joints[:, 1:3])), distances, atol=1e-12)


@pytest.mark.parametrize("level", [0.0, -5.0])
def test_margin_curves_are_those_of_the_arm_in_space(
    spatial_6dof: ff.FreeFloatingModel, level: float, rng: np.random.Generator
) -> None:
    """On each the measure has the level, whatever q1 and the wrist do."""
    measure = ff.singularity_measure(spatial_6dof, ff.Task.POSE, "arm")
    curves = margin_curves(elbow_arm(spatial_6dof), level)
    assert len(curves) >= 2
    for curve in curves:
        for pair in curve.joints[:: max(1, len(curve.joints) // 20)]:
            q1, *wrist = rng.uniform(-3, 3, 4)
            assert measure(np.array([q1, *pair, *wrist])) == pytest.approx(level, abs=1e-6)


LIGHT = planar_robot([20, 9, 6], [1.5, 0.9, 0.4], [0.7, 0.3], [0.3, 0.4, 0.5])


def problem_of(model: ff.FreeFloatingModel, task: ff.Task) -> ff.Problem:
    path = ff.load_scenario("planar_3dof/parabola_nonstop").problem().path
    return ff.Problem(
        model, path, task, [0, 0, 0], ff.Margin(ff.singularity_measure(model, task, "gjm"), 0.0)
    )


@pytest.mark.slow
def test_certified_areas_are_the_exact_ones_of_planar_arms() -> None:
    problem = problem_of(ff.FreeFloatingModel.from_urdf(LIGHT), ff.Task.PLANAR_POSITION)
    exact, general = exact_workspace(problem), _general_workspace(problem)
    assert exact is not None
    assert (general.exact, general.undecided) == (False, ())
    assert np.array(general.reach) == pytest.approx(np.array(exact.reach), abs=1e-6)
    for name in ("path_dependent", "path_independent"):
        areas = np.array(getattr(exact, name))
        assert np.array(getattr(general, name)) == pytest.approx(
            areas, abs=5.01e-3 * exact.reach[1]
        )


@pytest.mark.slow
def test_areas_of_an_arm_of_three_joints_in_space() -> None:
    """Example 2's arm to its fixed wrist: elbow and shoulder become singular."""
    text = ff.load_scenario("spatial_6dof/line").model().description.text
    stiff = text.replace('name="q4" type="continuous"', 'name="q4" type="fixed"')
    model = ff.FreeFloatingModel.from_urdf(stiff, "link_4")
    workspace = ff.workspace_regions(problem_of(model, ff.Task.POSITION))
    measure = ff.singularity_measure(model, ff.Task.POSITION, "gjm")
    rng, radii = np.random.default_rng(0), []
    axis = np.linspace(-np.pi, np.pi, 33)
    for number, q in enumerate(rng.uniform(-np.pi, np.pi, (600, 3))):
        joint = number % 3

        def along(value: float, q: np.ndarray = q, joint: int = joint) -> float:
            return measure(np.where(np.arange(3) == joint, value, q))

        values = np.array([along(value) for value in axis])
        for k in np.flatnonzero(values[1:] * values[:-1] < 0.0):
            root = np.where(np.arange(3) == joint, brentq(along, axis[k], axis[k + 1]), q)
            position = model.end_effector_pose([0.0, 0.0, 0.0, 1.0], root).position
            radii.append(np.linalg.norm(position))
    assert len(radii) > 500
    free = workspace.path_independent
    assert free is not None
    assert not any(low < radius < high for radius in radii for low, high in free)
    assert workspace.path_dependent
    for low, high in workspace.path_dependent:
        for radius in np.linspace(low, high, 50):
            assert np.abs(np.array(radii) - radius).min() < 0.02 * workspace.reach[1]


@pytest.mark.slow
def test_nowhere_is_an_arm_without_spherical_wrist_free_of_singularities() -> None:
    workspace = ff.workspace_regions(ff.load_scenario("ur5_servicer/arc").problem())
    assert workspace.path_dependent is not None
    assert workspace.path_independent == ()
    areas = sorted((*workspace.path_dependent, *workspace.undecided))
    assert (areas[0][0], areas[-1][1]) == pytest.approx(workspace.reach)
    assert sum(high - low for low, high in workspace.undecided) < 0.05 * workspace.reach[1]
    assert (workspace.point, workspace.measure, workspace.exact) == ("end-effector", "gjm", False)


@pytest.mark.slow
def test_areas_of_redundant_arms_are_unknown() -> None:
    """Their measure has no sign; the reach follows from the lengths."""
    model = ff.FreeFloatingModel.from_urdf(
        planar_robot([50, 5, 4, 3], [8, 1, 0.5, 0.3], [0.4] * 3, [0.5] * 4)
    )
    workspace = ff.workspace_regions(problem_of(model, ff.Task.PLANAR_POSITION))
    assert workspace.path_dependent is workspace.path_independent is None
    links = np.abs(PlanarArm.of(model).links)
    assert workspace.reach[1] == pytest.approx(links.sum(), abs=1e-6)
    assert workspace.reach[0] == pytest.approx(max(0.0, 2 * links.max() - links.sum()), abs=1e-4)


def prismatic(limits: tuple[float, float]) -> ff.Problem:
    """A planar arm of a revolute and a prismatic joint."""
    inertial = inertial_text(5.0, np.eye(3))
    text = (
        "<robot name='r'>" + link_text("bus", inertial_text(100.0, 10.0 * np.eye(3)))
        + link_text("boom", inertial) + link_text("rod", inertial)
        + joint_text("revolute", "C", "bus", "boom", "0.5 0 0")
        + joint_text("prismatic", "P", "boom", "rod", axis="1 0 0", limits=limits)
        + "</robot>"
    )  # fmt: skip
    return problem_of(ff.FreeFloatingModel.from_urdf(text), ff.Task.PLANAR_POSITION)


@pytest.mark.slow
def test_a_prismatic_joint_keeps_its_range() -> None:
    problem = prismatic((1.0, 2.0))
    workspace = ff.workspace_regions(problem)
    radii = [np.linalg.norm(problem.model.end_effector_pose([0, 0, 0, 1], [q1, q2]).position)
             for q1 in np.linspace(0, 6.28, 60) for q2 in (1.0, 2.0)]  # fmt: skip
    assert np.array(workspace.reach) == pytest.approx([min(radii), max(radii)], abs=5e-3)


def test_a_prismatic_joint_needs_limits() -> None:
    assert error_key(ff.workspace_regions, prismatic((-1e9, 1e9))) == "joint prismatic"
