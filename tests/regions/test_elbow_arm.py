"""Areas of spatial arms: exact ones of elbow arms, and certified shells of any arm."""

import numpy as np
import pytest

import freefloat as ff
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.regions.planar_regions import elbow_arm, point_3, two_angles, wrist_in_tool
from freefloat.regions.workspace import _general_workspace, exact_workspace
from tests.motions import X, Z, chain
from tests.regions.test_workspace import problem_of
from tests.robots import planar_robot

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
def test_s_and_the_wrist_are_those_of_the_arm_in_space(spatial_6dof, name, rng):
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


LIGHT = planar_robot([20, 9, 6], [1.5, 0.9, 0.4], [0.7, 0.3], [0.3, 0.4, 0.5])


@pytest.mark.slow
def test_certified_areas_are_the_exact_ones_of_planar_arms() -> None:
    problem = problem_of(ff.FreeFloatingModel.from_urdf(LIGHT))
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
def test_a_prismatic_joint_keeps_its_range() -> None:
    """Of a planar arm of a revolute and a prismatic joint."""
    body = 5.0, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    joints = ("continuous", Z, (0.5, 0.0, 0.0), *body), ("prismatic", X, (0.0, 0.0, 0.0), *body)
    text = chain(*joints, tool=(0.0, 0.0, 0.0))
    text = text.replace('lower="-3.0" upper="3.0"', 'lower="1" upper="2"')
    problem = problem_of(ff.FreeFloatingModel.from_urdf(text, "tool"))
    workspace = ff.workspace_regions(problem)
    radii = [np.linalg.norm(problem.model.end_effector_pose([0, 0, 0, 1], [q1, q2]).position)
             for q1 in np.linspace(0, 6.28, 60) for q2 in (1.0, 2.0)]  # fmt: skip
    assert np.array(workspace.reach) == pytest.approx([min(radii), max(radii)], abs=5e-3)
