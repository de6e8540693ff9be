"""An elbow arm in its plane: the same S, the same distance of the wrist, in complex numbers."""

from __future__ import annotations

import numpy as np
import pytest

from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.momentum import Task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import InputError
from freefloat.robot.model import FreeFloatingModel
from freefloat.workspace.elbow_arm import elbow_arm, wrist_distances, wrist_in_tool
from freefloat.workspace.margin_curves import margin_curves, point_3, two_angles

VARIANTS = {
    "published": ("", ""),
    "flat spacecraft": ('izz="66.67"', 'izz="20"'),
    "lopsided hand": ('xyz="0.2 0 0"/>\n      <mass', 'xyz="0.2 0.1 -0.05"/>\n      <mass'),
    "mounted below": ('xyz="0 0 0.5"', 'xyz="0 0 -0.8"'),
    "elbow turned over": ('<origin xyz="1 0 0"/><axis xyz="0 -1 0"/>',
                          '<origin xyz="1 0 0"/><axis xyz="0 1 0"/>'),
    "elbow out of line": ('<origin xyz="1 0 0"/><axis xyz="0 -1 0"/>',
                          '<origin xyz="1 0 0.3"/><axis xyz="0 -1 0"/>'),
}  # fmt: skip


def variant(model: FreeFloatingModel, name: str) -> FreeFloatingModel:
    old, new = VARIANTS[name]
    assert old in model.description.text
    return FreeFloatingModel.from_urdf(model.description.text.replace(old, new))


@pytest.mark.parametrize("name", VARIANTS)
def test_s_and_the_wrist_are_those_of_the_arm_in_space(
    spatial_6dof: FreeFloatingModel, name: str, rng: np.random.Generator
) -> None:
    """Whatever the first joint and the wrist do: by (40) and (35)."""
    model = variant(spatial_6dof, name)
    arm, of = elbow_arm(model), singularity_measure(model, Task.POSE, "arm")
    joints = rng.uniform(-4, 4, (40, 6))
    in_plane = arm.determinant(two_angles(arm, joints[:, 1:3]))
    np.testing.assert_allclose(in_plane, [of(q) for q in joints], rtol=1e-8, atol=1e-8)
    virtual = VirtualManipulator.of(model)
    distances = [
        np.linalg.norm(pose.position + pose.rotation @ wrist_in_tool(virtual))
        for pose in (model.end_effector_pose([0, 0, 0, 1], q) for q in joints)
    ]
    np.testing.assert_allclose(np.abs(point_3(arm, joints[:, 1:3])), distances, atol=1e-12)
    np.testing.assert_allclose(wrist_distances(virtual, joints), distances, atol=1e-12)


@pytest.mark.parametrize("level", [0.0, -5.0])
def test_margin_curves_are_those_of_the_arm_in_space(
    spatial_6dof: FreeFloatingModel, level: float, rng: np.random.Generator
) -> None:
    """On each the measure has the level, whatever q1 and the wrist do."""
    of = singularity_measure(spatial_6dof, Task.POSE, "arm")
    curves = margin_curves(elbow_arm(spatial_6dof), level)
    assert len(curves) >= 2
    for curve in curves:
        for pair in curve.joints[:: max(1, len(curve.joints) // 20)]:
            q1, *wrist = rng.uniform(-3, 3, 4)
            assert of(np.array([q1, *pair, *wrist])) == pytest.approx(level, abs=1e-6)


@pytest.mark.parametrize("change", [
    ('iyy="66.67"', 'iyy="90"'), ('xyz="0 0 0.5"', 'xyz="0.3 0 0.5"'),
])  # fmt: skip
def test_arms_without_the_measure_are_refused(
    spatial_6dof: FreeFloatingModel, ur5: FreeFloatingModel, change: tuple[str, str]
) -> None:
    """No symmetry about the first axis, or no spherical wrist."""
    text = spatial_6dof.description.text.replace(*change, 1)
    for model in (FreeFloatingModel.from_urdf(text), ur5):
        with pytest.raises(InputError, match="in-plane factor"):
            elbow_arm(model)
    with pytest.raises(InputError, match="not spherical"):
        wrist_in_tool(VirtualManipulator.of(ur5))
