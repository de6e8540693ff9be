"""Recorded paths: splines through rounded samples are integrated and checked precisely.

Between neighbours a spline is smooth; at them its third derivative jumps, the more the rounder the
numbers and the denser the samples. What steps across loses its order there.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.certificate.certificate import certify
from freefloat.motion.motion import DEGREE
from freefloat.paths import Stop, TimeLaw
from freefloat.paths.samples import parse_samples
from freefloat.verification.comparisons import certificate_checks
from tests.errors import error_key
from tests.motions import bundled, compiled_motion, first_motion


def recorded(points: np.ndarray, decimals: int, rotations: Rotation | None = None) -> str:
    """A CSV file as a motion tracker writes it."""
    rows, names = np.round(points, decimals), "x,y,z"
    if rotations is not None:
        rows, names = np.hstack([rows, np.round(rotations.as_quat(), 4)]), "x,y,z,qx,qy,qz,qw"
    return "\n".join([names, *(",".join(f"{value:.6g}" for value in row) for row in rows)])


def arch(count: int, noise: float = 0.0) -> np.ndarray:
    """Half a revolution of a screw, with noise [m]."""
    a = np.linspace(0.0, np.pi, count)
    points = np.column_stack([0.9 + 0.1 * np.cos(a), 0.1 * np.sin(a), 0.03 * a])
    return points + noise * np.random.default_rng(4).standard_normal(points.shape)


def nodding(count: int) -> Rotation:
    a = np.linspace(0.0, 1.0, count)
    return Rotation.from_euler("zy", np.column_stack([0.3 * a, 0.2 * np.sin(3.0 * a)]))


def parabola(count: int) -> tuple[np.ndarray, Rotation]:
    """The paper's, the end-effector normal to it."""
    s = np.linspace(0.0, 1.0, count)
    points = np.column_stack([2.0 - 3.0 * s, 0.5 * s + 1.5 * s**2, 0.0 * s])
    headings = np.arctan2(0.5 + 3.0 * s, -3.0) + np.pi / 2.0
    return points, Rotation.from_rotvec(headings[:, None] * [0.0, 0.0, 1.0])


def problem_of(kind: str, count: int) -> ff.Problem:
    """A robot that follows a recorded path."""
    points, headings = parabola(count)
    robot, task, margin, samples = {
        "quaternions": (
            "spatial_6dof", "pose", ("arm", 5.0), recorded(arch(count), 3, nodding(count))),
        "planar": ("planar_3dof", "planar-position", ("gjm", 1e-3), recorded(points, 3)),
        "planar, quaternions": (
            "planar_3dof", "planar-pose", ("system", 5.0), recorded(points, 3, headings)),
        "noise": ("spatial_6dof", "pose", ("arm", 5.0), recorded(arch(count, 1e-3), 6)),
    }[kind]  # fmt: skip
    curve, orientation = parse_samples(samples, Path("path.csv"))
    if kind == "noise":
        orientation = bundled("spatial_6dof/line").path.path.orientation
    path = ff.EndEffectorPath(curve, *([] if orientation is None else [orientation]))
    h = [0.0, 0.0, 0.5]
    return ff.Problem(robot, path=path, duration=100.0, task=task, momentum=h, margin=margin)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "count"),
    [("quaternions", 41), ("planar", 41), ("planar, quaternions", 31), ("noise", 40)],
)
def test_recorded_paths_are_integrated_as_precisely_as_others(kind: str, count: int) -> None:
    motion = first_motion(problem_of(kind, count))
    for check in certificate_checks(certify(motion), motion, False):
        if check.unit and check.allowed and check.name != "singular end":
            assert check.recomputed < (0.2 if "again" in check.name else 0.05) * check.allowed, (
                check
            )
    last = compiled_motion(motion)
    assert np.abs(last.joints[0] - motion.final.joints).max() < 1e-4
    last = compiled_motion(motion, tolerance=1e-9)
    assert np.abs(last.joints[0] - motion.final.joints).max() < 2e-7


@pytest.mark.parametrize("backwards", [False, True])
def test_panels_end_where_the_path_is_not_smooth(backwards: bool) -> None:
    problem = problem_of("quaternions", 21)
    law = ff.Timing(100.0, TimeLaw.TRAPEZOIDAL, (Stop(0.33, 40.0),))
    problem = replace(problem, path=replace(problem.path, timing=law))
    motion = first_motion(problem)
    if backwards:
        final = motion.final
        motion = ff.integrate_motion(
            problem, final.attitude, final.joints, start=100.0, end=0.0
        )  # fmt: skip
        assert motion.completed
    breaks, path = problem.path.breaks, problem.path.path
    assert set(law.ends[:-1]) <= set(breaks.tolist())
    assert len(breaks) == len(path.breaks) + len(law.ends) - 1
    assert set(breaks.tolist()) <= set(motion.times[::DEGREE].tolist())
    reached = np.array([law.s(t) for t in breaks.tolist()])
    assert np.abs(reached[:, None] - path.breaks).min(axis=0).max() < 1e-14


def test_a_path_through_poses_meets_them_smoothly() -> None:
    """Position, orientation and twist, against Pinocchio's poses and differences."""
    pin.seed(4)
    poses = [pin.SE3.Random() for _ in range(4)]
    path = ff.paths.through(poses)
    for s, pose in zip((0.0, *path.breaks, 1.0), poses, strict=True):
        np.testing.assert_allclose(path.pose(s).position, pose.translation, atol=1e-12)
        np.testing.assert_allclose(path.pose(s).rotation, pose.rotation, atol=1e-12)
    before, after = (path.second_derivative(path.breaks[1] + side) for side in (-1e-5, 1e-5))
    np.testing.assert_allclose(before, after, atol=5e-2)
    assert error_key(ff.paths.through, [poses[0], 1.0]) == "poses.1"
