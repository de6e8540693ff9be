"""SPART as a second opinion of the generalized Jacobian."""

import os
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from tests.motions import relative
from tests.robots import Robot, random_robot
from tests.validation.comparisons import assert_agrees


def spart_generalized_jacobian(
    path: Path, robot: Robot, joints: dict[str, float], ends: Sequence[str]
) -> np.ndarray:
    """S* of the end links' centres of mass from SPART's kinematics, linear rows first."""
    from SPARTpy import SPART
    from SPARTpy.urdf2robot import urdf2robot

    path.write_text(robot.text)
    spart, keys = SPART(str(path)), urdf2robot(str(path))[1]
    body, n = spart.robot, spart.robot.n_links_joints
    column = {name: number - 1 for name, number in keys["q_id"].items()}
    q = np.zeros(body.n_q)
    for name, value in joints.items():
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
    at = [keys["link_id"][end] - 1 for end in ends]
    S = (Am[at] - A0[at] @ np.linalg.solve(H0, H0m))[:, [3, 4, 5, 0, 1, 2]]
    return S.reshape(-1, body.n_q)[:, [column[name] for name in joints]]


@pytest.mark.slow
@pytest.mark.skipif(
    shutil.which("gcc") is None and "CI" not in os.environ,
    reason="SPART compiles itself when first used and there is no gcc",
)
def test_spart_finds_the_same_generalized_jacobian(tmp_path, rng):
    """SPART uses centres of mass and the spacecraft's inertial axes; S* is the same."""
    # one test, so that one worker only meets SPART, which compiles itself when first used
    structures = [("RRRRRR", "")] * 6
    structures += [("RRRRRR", "RRRRRR"), ("RFCPRR", "CRPR"), ("CRPF", "FR")] * 3
    for number, (chain, branch) in enumerate(structures):
        robot = marked = random_robot(rng, chain, branch, on_bus=True)
        names, ends = (*robot.joints, *robot.others), [robot.end_effector]
        ends += [f"link_{name[6:]}" for name in robot.others[-1:]]
        for k, end in enumerate(ends):
            centre = _inertial(robot, end, "xyz")
            marked = replace(marked, end_effector=end).with_frame(f"centre_{k}", centre)
        arms = {"other": "centre_1"} if branch else {}
        model = ff.FreeFloatingModel.from_urdf(marked.text, "centre_0", arms=arms)
        model = model.with_paths(*arms)
        angles = [float(angle) for angle in _inertial(robot, "bus", "rpy").split()]
        bus, file = Rotation.from_euler("xyz", angles).as_matrix(), tmp_path / f"{number}.urdf"
        for q in rng.uniform(-3.0, 3.0, (4, model.dof)):
            S = spart_generalized_jacobian(file, robot, dict(zip(names, q, strict=True)), ends)
            seen = np.vstack([bus @ rows for rows in S.reshape(-1, 3, len(q))])
            worst = relative(ff.generalized_jacobian(model, q), seen)
            assert_agrees("test_spart_finds_the_same_generalized_jacobian", worst)


def _inertial(robot: Robot, link: str, key: str) -> str:
    """``xyz`` or ``rpy`` of the inertial frame of a link."""
    return robot.text.split(f'<link name="{link}">')[1].split(f'{key}="')[1].split('"')[0]
