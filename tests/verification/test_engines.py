"""MuJoCo repeats motions, also with gravity gradient."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.dynamics.momentum import inertia_matrices
from freefloat.motion.motion import Motion
from freefloat.robot.bundled import find_robot
from freefloat.rotations import rotation_matrix
from freefloat.verification.engine_runs import engine_runs
from freefloat.verification.gravity import CircularOrbit
from tests.commands import document, error, run
from tests.robots import inertial_text, joint_text, link_text

LEO = CircularOrbit(6.778e6)
STILL = {
    "robot": {"urdf": "planar_2dof", "end_effector": "tool"},
    "task": "planar-position",
    "path": {"line": {"from": [1.5, 0, 0], "to": [1.5000001, 0, 0]}},
    "timing": {"duration": 100},
    "margin": {"fraction": 0.01},
}
"""A system that practically rests; its end-effector is named by the joint that moves it."""
SPATIAL = {
    "robot": {"urdf": "ets_vii", "end_effector": "end_effector"},
    "task": "position",
    "momentum": [3, -2, 3.5],
    "drift": [0.002, 0.0, -0.001],
    "path": {"line": {"from": [0.6, 0.5, 2.1], "to": [0.8, 0.3, 2.1]}},
    "timing": {"duration": 60},
    "margin": {"measure": "gjm", "value": 0.01},
}
"""A redundant arm on a drifting system with momentum."""


@pytest.fixture(scope="module")
def still(tmp_path_factory) -> Motion:
    """With an antenna whose inertia MuJoCo refuses, but not that of the spacecraft with it."""
    file = tmp_path_factory.mktemp("still") / "robot.urdf"
    inertia = 1e-12 * np.array([[2.0, 6.0, 0.0], [6.0, 2.0, 0.0], [0.0, 0.0, 3.0]])
    antenna = link_text("antenna", inertial_text(1e-9, inertia))
    antenna += joint_text("mount", "F", "spacecraft", "antenna")
    text = find_robot("planar_2dof", file.parent).read_text()
    file.write_text(text.replace("</robot>", f"{antenna}</robot>"))
    scenario = {**STILL, "robot": {"urdf": str(file), "end_effector": "tool"}}
    return ff.simulate(ff.load_scenario(scenario).problem(), heading=0.6).chosen.motion


def test_torques_about_the_common_centre_of_mass_are_those_of_the_whole_system() -> None:
    model = ff.FreeFloatingModel.from_urdf("spatial_6dof", "end_effector")
    attitude, joints, t = Rotation.random(rng=3).as_quat(), np.linspace(-1.0, 1.5, 6), 700.0
    poses = model.body_poses(attitude, joints)
    masses = np.array([body.mass for body in model.bodies])
    centres = np.array([
        pose.position + pose.rotation @ body.centre
        for pose, body in zip(poses, model.bodies, strict=True)
    ])  # fmt: skip
    inertias = np.array([
        pose.rotation @ body.inertia @ pose.rotation.T
        for pose, body in zip(poses, model.bodies, strict=True)
    ])  # fmt: skip
    forces = LEO.forces(t, masses, centres + np.array([3.0, -2.0, 1.0]))
    np.testing.assert_allclose(forces.sum(axis=0), 0.0, atol=1e-12)
    about_centre = np.cross(centres, forces).sum(axis=0) + LEO.torque(t, inertias).sum(axis=0)
    R0 = rotation_matrix(attitude)
    whole = R0 @ inertia_matrices(model, joints)[0] @ R0.T
    np.testing.assert_allclose(about_centre, LEO.torque(t, whole), rtol=1e-6, atol=1e-15)
    assert np.pi / LEO.rate == pytest.approx(5553.6 / 2.0, abs=1.0), "half a period"


@pytest.mark.slow
def test_a_resting_system_turns_as_the_integrated_torque_says(still) -> None:
    effect = engine_runs(still, LEO).gravity
    D, _ = inertia_matrices(still.problem.model, still.initial.joints)
    R0, end, inertia = rotation_matrix(still.initial.attitude), still.final.time, D[2, 2]
    whole = R0 @ D @ R0.T
    angle, _ = quad(lambda t: (end - t) * LEO.torque(t, whole)[2] / inertia, 0.0, end)
    momentum, _ = quad(lambda t: LEO.torque(t, whole)[2], 0.0, end)
    assert abs(angle) > 1e-3
    assert effect.attitude == pytest.approx(abs(angle), rel=0.02)
    assert effect.momentum == pytest.approx(abs(momentum), rel=0.02)


@pytest.mark.slow
def test_the_command_reports_gravity(tmp_path: Path) -> None:
    file = tmp_path / "motion.h5"
    run("simulate", "planar_2dof/line", "--heading", 0, "-o", file)
    report = document("check", file, "--engine", "mujoco", "--gravity", 6778)["engine"]
    assert report["name"] == "mujoco"
    assert report["gravity"]["radius"] == 6778000.0
    assert document("check", file)["engine"] is None
    assert error("check", file, "--gravity", 6778)["key"] == "gravity"
    assert error("check", file, "--engine", "mujoco", "--gravity", 6)["key"] == "gravity"
