"""Joints that mimic others: where they are held, and what is refused."""

import numpy as np
import pinocchio as pin
import pytest

import freefloat as ff
from freefloat.errors import ModelError
from tests.robots import inertial_text, joint_text, link_text

BODY = inertial_text(5.0, np.diag([0.2, 0.3, 0.4]), "0.1 0.05 0.02")
LINKS = ("bus", "upper", "lower", "hand", "left", "right", "tip")


def robot(lower: str = "", upper: str = "") -> str:
    """An arm of three joints with a gripper: right follows left, its tip follows right."""
    mimics = {"q1": upper, "q2": lower, "right": 'joint="left" multiplier="-2" offset="0.3"',
              "tip": 'joint="right" offset="0.1"'}  # fmt: skip
    table = (
        ("q1", "R", "bus", "upper"), ("q2", "R", "upper", "lower"), ("q3", "R", "lower", "hand"),
        ("left", "P", "hand", "left"), ("right", "P", "hand", "right"),
        ("tip", "R", "right", "tip"),
    )  # fmt: skip
    joints = ""
    for name, kind, *ends in table:
        text = joint_text(name, kind, *ends, "0.5 0 0.1", axis="0 0.6 0.8")
        mimic = f"<mimic {mimics[name]}/>" if mimics.get(name) else ""
        joints += text.replace("</joint>", f"{mimic}</joint>")
    links = "".join(link_text(name, BODY) for name in LINKS)
    return f'<robot name="r">{links}{joints}</robot>'


@pytest.mark.parametrize("left", [0.0, -0.25])
def test_a_held_gripper_follows_its_driver(left: float) -> None:
    model = ff.FreeFloatingModel.from_urdf(robot(), "hand", fixed_joints={"left": left})
    q = np.array([0.3, -0.7, 0.5])
    reference = pin.buildModelFromXML(robot(), pin.JointModelFreeFlyer())
    data, values = reference.createData(), pin.neutral(reference)
    right = -2.0 * left + 0.3
    held = {"left": left, "right": right, "tip": right + 0.1}
    for name, value in (held | dict(zip(model.joint_names, q, strict=True))).items():
        values[reference.joints[reference.getJointId(name)].idx_q] = value
    A = pin.computeCentroidalMap(reference, data, values)
    frame = reference.getFrameId("hand", pin.BODY)
    J = pin.computeFrameJacobian(reference, data, values, frame, pin.LOCAL_WORLD_ALIGNED)
    S = J[:, 6:9] - J[:, :6] @ np.linalg.solve(A[:, :6], A[:, 6:9])
    np.testing.assert_allclose(ff.generalized_jacobian(model, q), S, rtol=0.0, atol=1e-12)
    assert not [entry for entry in model.not_read if "mimic" in entry.element]


def test_followers_out_of_their_ranges_are_reported() -> None:
    """Not the tip, which has a value by name; all ranges end at 4."""
    model = ff.FreeFloatingModel.from_urdf(robot(), "hand", fixed_joints={"left": -2, "tip": 0})
    (warning,) = (entry for entry in model.warnings if "out of its range" in entry.problem)
    assert (warning.element, "fixed at 4.3" in warning.problem) == ("joint right", True)


def test_a_value_by_name_decouples() -> None:
    model = ff.FreeFloatingModel.from_urdf(robot(), "hand", fixed_joints={"right": 0.05})
    (_, place), (_, tip) = model.link_places["right"], model.link_places["tip"]
    np.testing.assert_allclose(place.position, [0.5, 0.03, 0.14])
    turn = pin.log3(place.rotation.T @ tip.rotation)
    np.testing.assert_allclose(turn, [0.0, 0.09, 0.12], rtol=0.0, atol=1e-15)


@pytest.mark.parametrize(
    ("text", "joint", "leader"),
    [
        (robot(lower='joint="q1"'), "q2", "q1"),
        (robot(upper='joint="q3" multiplier="-1"'), "q1", "q3"),
        (robot().replace('joint="left" multi', 'joint="q2" multi'), "right", "q2"),
    ],
)
def test_joints_that_follow_moving_ones_are_refused(text: str, joint: str, leader: str) -> None:
    with pytest.raises(ModelError, match=f"joint {joint}: it mimics {leader}, which moves"):
        ff.FreeFloatingModel.from_urdf(text, "hand")
    fixed = {leader: 0.2}
    model = ff.FreeFloatingModel.from_urdf(text, "hand", fixed_joints=fixed)
    assert {joint, leader}.isdisjoint(model.joint_names)
    assert (
        leader
        in ff.FreeFloatingModel.from_urdf(text, "hand", fixed_joints={joint: 0.1}).joint_names
    )
