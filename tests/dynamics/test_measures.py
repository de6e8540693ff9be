"""Singularity measures: definitions, factors, units, extremes."""

import re

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.dynamics.generalized_jacobian import system_matrix
from freefloat.dynamics.joint_space import sampled_reach
from freefloat.dynamics.momentum import inertia_matrices
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from tests.prismatic import BUS, TOOL, prismatic_robot
from tests.robots import in_units, joint_values, random_robot, robots

TOUCH_POINT = np.array([0.1, 2.0, 3.3076, -2.6104, 2.2981, 1.4288])
"""Joints at the touch point printed in the paper's Example 2."""


@pytest.mark.slow
@given(data=st.data(), robot=robots(st.text("RCP", min_size=6, max_size=6)))
def test_gjm_and_system_are_the_determinants_of_6_and_5(data: st.DataObject, robot: object) -> None:
    """det A = det D det S*, signs included; each from its matrix."""
    model = robot.model()
    q = data.draw(joint_values(6))
    S, A = ff.generalized_jacobian(model, q), system_matrix(model, q)
    D, _ = inertia_matrices(model, q)
    gjm, system = (ff.singularity_measure(model, "pose", name)(q) for name in ("gjm", "system"))
    size = np.prod(np.linalg.norm(S, axis=1))
    assert gjm == pytest.approx(np.linalg.det(S), abs=1e-12 * size)
    assert system == pytest.approx(np.linalg.det(D) * gjm, abs=1e-10 * np.linalg.det(D) * size)
    assert system == pytest.approx(np.linalg.det(A), rel=1e-6, abs=1e-10 * np.linalg.det(D) * size)


@pytest.mark.slow
@given(data=st.data(), robot=robots(st.text("RCP", min_size=7, max_size=8)))
def test_redundant_gjm_is_the_volume_of_the_ellipsoid(data: st.DataObject, robot: object) -> None:
    """sqrt(det(S* S*^T)), never negative; the system's is det D times it."""
    model = robot.model()
    q = data.draw(joint_values(model.dof))
    S = ff.generalized_jacobian(model, q)
    size = np.prod(np.linalg.norm(S, axis=1))
    volume = np.sqrt(max(np.linalg.det(S @ S.T), 0.0))
    gjm = ff.singularity_measure(model, ff.Task.POSE, "gjm")(q)
    assert gjm >= 0.0
    assert gjm**2 == pytest.approx(volume**2, rel=1e-6, abs=1e-13 * size**2)
    D, _ = inertia_matrices(model, q)
    system = ff.singularity_measure(model, ff.Task.POSE, "system")(q)
    assert system == pytest.approx(np.linalg.det(D) * gjm, rel=1e-12)


@given(data=st.data(), robot=robots(st.text("RCP", min_size=6, max_size=8)))
def test_sigma_is_the_smallest_scaled_singular_value(data: st.DataObject, robot: object) -> None:
    """Lengths in units of the reach."""
    model = robot.model()
    q = data.draw(joint_values(model.dof))
    reach = VirtualManipulator.of(model).reach
    row = np.array([1.0 / reach] * 3 + [1.0] * 3)
    column = np.array([reach if body.prismatic else 1.0 for body in model.bodies[1:]])
    S = row[:, None] * ff.generalized_jacobian(model, q) * column
    sigma = ff.singularity_measure(model, ff.Task.POSE, "sigma")(q)
    smallest = np.sqrt(max(np.linalg.eigvalsh(S @ S.T)[0], 0.0))
    assert sigma == pytest.approx(smallest, abs=1e-7 * np.abs(S).max())


@pytest.mark.parametrize("name", ["gjm", "system", "sigma"])
@pytest.mark.parametrize("structure", ["CRRCRRR", "PPRRRR"])
def test_measures_scale_by_their_units(structure: str, name: str, rng: np.random.Generator) -> None:
    """The same robot in feet and pounds: the value changes as its unit says."""
    robot = random_robot(rng, structure)
    feet, pounds = 3.28084, 2.20462
    metric = robot.model()
    text = in_units(robot.text, feet, pounds)
    imperial = ff.FreeFloatingModel.from_urdf(text, robot.end_effector)
    q = rng.uniform(-2.0, 2.0, metric.dof)
    same = q * np.where([body.prismatic for body in metric.bodies[1:]], feet, 1.0)
    measure = ff.singularity_measure(metric, ff.Task.POSE, name)
    found = re.findall(r"(m|kg)\b(?:\^(\d))?", measure.unit)
    powers = {unit: int(power or 1) for unit, power in found}
    factor = feet ** powers.get("m", 0) * pounds ** powers.get("kg", 0)
    value = ff.singularity_measure(imperial, ff.Task.POSE, name)(same)
    assert value == pytest.approx(factor * measure(q), rel=1e-9)


def test_the_reach_of_prismatic_joints_ends_at_their_limits() -> None:
    """The spacecraft recoils: the centre of mass stays, the joints' box shrinks by bus / total."""
    model = ff.FreeFloatingModel.from_urdf(prismatic_robot(), "hand")
    corner = np.linalg.norm(np.abs(model.joint_ranges).max(axis=0))
    farthest = corner * BUS / (BUS + TOOL)
    assert sampled_reach(model, ff.Task.POSITION) == pytest.approx((0.0, farthest), abs=1e-7)


def factors(model: ff.FreeFloatingModel, q: np.ndarray) -> tuple[float, float, float]:
    """In-plane and other block of (39), and the other's inertia, at constant orientation.

    Written in the plane's axes: x' along the arm's azimuth q1, y' across, z.
    """
    A = system_matrix(model, q)
    wrist = -np.linalg.solve(A[6:, 6:], A[6:, :6])
    R = A[:6, :6] + A[:6, 6:] @ wrist
    azimuth = Rotation.from_euler("z", q[0]).as_matrix()
    R = np.vstack([azimuth.T @ R[:3], azimuth.T @ R[3:]])
    R[:, :3] = R[:, :3] @ azimuth
    h_v, w_q = [1, 3, 5], [1, 4, 5]
    others, more = [0, 2, 4], [0, 2, 3]
    assert np.abs(R[np.ix_(h_v, more)]).max() < 1e-9 * np.abs(R).max()
    blocks = R[np.ix_(h_v, w_q)], R[np.ix_(others, more)], R[np.ix_([0, 2], [0, 2])]
    return tuple(float(np.linalg.det(block)) for block in blocks)


def test_published_touch_point_of_example_two(spatial_6dof: ff.FreeFloatingModel) -> None:
    """Printed: S = -5 at the touch point; the shoulder's factor, per inertia, is 0.20 there."""
    arm = ff.singularity_measure(spatial_6dof, ff.Task.POSE, "arm")
    assert arm(TOUCH_POINT) == pytest.approx(-5.0003, abs=5e-5)
    in_plane, other, inertia = factors(spatial_6dof, TOUCH_POINT)
    assert in_plane == pytest.approx(arm(TOUCH_POINT), rel=1e-9)
    assert other / inertia == pytest.approx(0.20, abs=5e-3)


@pytest.mark.slow
@given(q=joint_values(6))
def test_arm_times_shoulder_times_wrist_is_the_system(spatial_6dof, q):
    """det A = arm x other block x sin q5, everywhere with one sign."""
    if abs(np.sin(q[4])) < 0.01:
        q = q + np.array([0, 0, 0, 0, 0.5, 0])
    in_plane, other, _ = factors(spatial_6dof, q)
    arm = ff.singularity_measure(spatial_6dof, ff.Task.POSE, "arm")(q)
    system = ff.singularity_measure(spatial_6dof, ff.Task.POSE, "system")(q)
    assert arm == pytest.approx(in_plane, abs=1e-8)
    assert system == pytest.approx(in_plane * other * np.sin(q[4]), rel=1e-8, abs=1e-4)


SPACECRAFT = 'ixx="66.67" ixy="0" ixz="0" iyy="66.67" iyz="0" izz="66.67"'
LINK_2 = '<origin xyz="0.5 0 0"/>\n      <mass value="40"/>'


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (SPACECRAFT, SPACECRAFT.replace('iyy="66.67"', 'iyy="90"')),
        ('xyz="0 0 0.5"', 'xyz="0.3 0 0.5"'),
        (LINK_2, LINK_2.replace("0.5 0 0", "0.5 0.1 0")),
        ('<child link="link_2"/>\n', '<child link="link_2"/><origin rpy="0.3 0 0"/>'),
        ('<child link="link_6"/>\n', '<child link="link_6"/><origin xyz="0 0 0.05"/>'),
    ],
    ids=[
        "asymmetric spacecraft", "mounted off centre", "asymmetric link", "tilted shoulder",
        "no spherical wrist",
    ],
)  # fmt: skip
def test_arms_with_coupled_plane_raise(spatial_6dof, old, new):
    text = spatial_6dof.description.text
    assert old in text
    model = ff.FreeFloatingModel.from_urdf(text.replace(old, new))
    with pytest.raises(ff.InputError):
        ff.singularity_measure(model, ff.Task.POSE, "arm")


def test_names_and_keys_of_measures_mean_the_same(spatial_6dof: ff.FreeFloatingModel) -> None:
    """Scenarios may say what a measure is, or its key."""
    for name, key in (("det S*", "gjm"), ("det A", "system"), ("in-plane factor", "arm")):
        named, keyed = (ff.singularity_measure(spatial_6dof, "pose", x) for x in (name, key))
        assert named(TOUCH_POINT) == keyed(TOUCH_POINT)
        assert (named.name, named.title) == (key, name)
    document = yaml.safe_load(ff.load_scenario("spatial_6dof/line").text)
    document["margin"]["measure"] = "in-plane factor"
    assert ff.load_scenario(document).problem().margin.measure.name == "arm"
