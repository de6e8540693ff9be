"""SPART as a second opinion of the generalized Jacobian."""

import os
import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from tests.motions import relative
from tests.robots import Robot, random_robot
from tests.validation.comparisons import assert_agrees

assert_close = partial(np.testing.assert_allclose, rtol=0)


def spart_generalized_jacobian(
    path: Path, robot: Robot, joints: np.ndarray, fixed: dict[str, float]
) -> np.ndarray:
    """S* of the end-effector's centre of mass from SPART's kinematics, linear rows first."""
    from SPARTpy import SPART
    from SPARTpy.urdf2robot import urdf2robot

    path.write_text(robot.text)
    spart, keys = SPART(str(path)), urdf2robot(str(path))[1]
    body, n = spart.robot, spart.robot.n_links_joints
    column = {name: number - 1 for name, number in keys["q_id"].items()}
    q = np.zeros(body.n_q)
    for name, value in {**dict(zip(robot.joints, joints, strict=True)), **fixed}.items():
        q[column[name]] = value
    _, RL, _, rL, e, g = spart.kinematics(np.eye(3), np.zeros(3), q)
    Bij, Bi0, P0, pm = spart.diff_kinematics(np.eye(3), np.zeros(3), rL, e, g)
    I0, Im = spart.i_i(np.eye(3), RL)
    M, M0 = np.zeros((n, 6, 6)), np.zeros((6, 6))
    M[:, :3, :3], M0[:3, :3] = Im, I0
    M[:, 3:, 3:] = np.array([link.mass for link in body.links])[:, None, None] * np.eye(3)
    M0[3:, 3:] = body.base_link_mass * np.eye(3)
    A0, Am = Bi0 @ P0, np.zeros((n, 6, body.n_q))
    for j, joint in enumerate(body.joints):
        if joint.q_id > 0:
            Am[:, :, int(joint.q_id) - 1] = Bij[:, j] @ pm[:, j]
    H0 = P0.T @ M0 @ P0 + np.einsum("iab,iac,icd->bd", A0, M, A0, optimize=True)
    H0m = np.einsum("iab,iac,icd->bd", A0, M, Am, optimize=True)
    i = keys["link_id"][robot.end_effector] - 1
    S = Am[i] - A0[i] @ np.linalg.solve(H0, H0m)
    return S[[3, 4, 5, 0, 1, 2]][:, [column[name] for name in robot.joints]]


@pytest.mark.slow
@pytest.mark.skipif(
    shutil.which("gcc") is None and "CI" not in os.environ,
    reason="SPART compiles itself when first used and there is no gcc",
)
def test_spart_finds_the_same_generalized_jacobian(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    """SPART uses centres of mass and the spacecraft's inertial axes; S* is the same."""
    # one test, so that one worker only meets SPART, which compiles itself when first used
    structures = [("RRRRRR", "")] * 6 + [("RRRRRR", "RR"), ("RFCPRR", "PR"), ("CRPF", "FR")] * 3
    for number, (chain, branch) in enumerate(structures):
        robot = random_robot(rng, chain, branch)
        fixed = dict(zip(robot.others, rng.uniform(-2.0, 2.0, len(robot.others)), strict=True))
        marked = robot.with_frame("centre", robot.end_effector_centre[0], "0 0 0")
        model = ff.FreeFloatingModel.from_urdf(marked.text, marked.end_effector, fixed_joints=fixed)
        for q in rng.uniform(-3.0, 3.0, (4, model.dof)):
            bus = Rotation.from_euler("xyz", _bus_angles(robot)).as_matrix()
            S = spart_generalized_jacobian(tmp_path / f"{number}.urdf", robot, q, fixed)
            seen = np.vstack([bus @ S[:3], bus @ S[3:]])
            worst = relative(ff.generalized_jacobian(model, q), seen)
            assert_agrees("test_spart_finds_the_same_generalized_jacobian", worst)


def _bus_angles(robot: Robot) -> list[float]:
    """``rpy`` of the spacecraft's inertial frame."""
    inertial = robot.text.split('<link name="bus">')[1].split('rpy="')[1].split('"')[0]
    return [float(word) for word in inertial.split()]
