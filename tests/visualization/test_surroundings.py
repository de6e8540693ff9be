"""Bodies of a scene and the corridor in the command stream of a page."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.motion.law import PathLaw
from freefloat.motion.motion import Motion
from freefloat.scene.scene_body import EndEffectorPoses
from freefloat.visualization.scenes.scene import motion_scene
from freefloat.visualization.scenes.scene_builder import PageScene
from tests.scene_commands import commands, tracks, vertices

ROOT = "/meshcat/good"
TURN = Rotation.from_euler("xyz", [0.3, 0.2, 0.1]).as_matrix()
TUMBLING = ff.Tumbling([3.0, 2.0, 1.0], [0.02, 0.1, 0.0], com=[0.1, 0.0, 0.3])
BODIES = (
    ff.SceneBody("mast", ff.Cylinder(0.1, 2.0), [3.0, 0.0, 1.0], TURN),
    ff.SceneBody("client", ff.Box([1.0, 1.0, 2.0]), [0.0, 3.0, 1.0], TURN, TUMBLING),
    ff.SceneBody("tool", ff.Sphere(0.1), [0.0, 0.1, 0.4], motion="target"),
)


@pytest.fixture(scope="module")
def motion(spatial: ff.Problem) -> Motion:
    return ff.simulate(spatial, [0.46008, 0.09337, 0.73519, -0.48898], branch=0).chosen.motion


def scene_of(motion: Motion, *arguments: Any) -> PageScene:
    problem = motion.problem.replace(scene=ff.Scene(*arguments))
    return motion_scene({"good": replace(motion, law=PathLaw(problem))})


@pytest.mark.slow
def test_moving_bodies_have_tracks_and_fixed_ones_a_place(motion: Motion) -> None:
    scene = scene_of(motion, BODIES)
    moves, path = tracks(scene), motion.problem.path
    for body in BODIES[1:]:
        times, positions = moves[f"{ROOT}/Scene bodies/{body.name}.position"]
        quaternions = moves[f"{ROOT}/Scene bodies/{body.name}.quaternion"][1].reshape(-1, 4)
        poses = [
            body.pose_at(t, path, EndEffectorPoses.on(path.pose(t)))
            for t in np.clip(times, 0.0, 100.0)
        ]
        expected = np.array([pose.position for pose in poses])
        assert positions.reshape(-1, 3) == pytest.approx(expected, abs=1e-6)
        shown = Rotation.from_quat(quaternions)
        off = shown * Rotation.from_matrix([pose.rotation for pose in poses]).inv()
        assert off.magnitude().max() < 1e-5
    assert not any("mast" in key for key in moves)
    placed = commands(scene, "set_transform")[f"{ROOT}/Scene bodies/mast"]["matrix"]
    expected = np.eye(4)
    expected[:3, :3], expected[:3, 3] = TURN, [3.0, 0.0, 1.0]
    np.testing.assert_allclose(np.reshape(placed, (4, 4)).T, expected, atol=1e-12)


@pytest.mark.slow
def test_while_the_centre_of_mass_drifts_fixed_bodies_and_the_corridor_move(motion: Motion) -> None:
    """Shown is the frame of the centre of mass."""
    path = replace(motion.problem.path, drift=[0.01, 0.0, -0.02])
    moving = replace(motion, law=PathLaw(motion.problem.replace(path=path)))
    corridor = ff.Corridor([0.1, 0.2, -0.3], [1.0, 2.0, 0.5], radius=2.0)
    moves = tracks(scene_of(moving, BODIES, corridor))
    for key, start in (("Scene bodies/mast", [3.0, 0.0, 1.0]), ("Corridor", [0.0, 0.0, 0.0])):
        times, positions = moves[f"{ROOT}/{key}.position"]
        expected = start - np.outer(times, path.drift)
        assert positions.reshape(-1, 3) == pytest.approx(expected, abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(("half_angle", "body"), [(0.3, "client"), (None, None)])
def test_the_surface_of_the_corridor_is_at_its_limit(
    motion: Motion, half_angle: float | None, body: str | None
) -> None:
    radius = 0.4 if half_angle is None else None
    corridor = ff.Corridor([0.1, 0.2, -0.3], [1.0, 2.0, 0.5], half_angle, radius, body)
    scene = scene_of(motion, BODIES, corridor)
    item = commands(scene, "set_object")[f"{ROOT}/Corridor"]["object"]
    points = vertices(scene, f"{ROOT}/Corridor")
    deviations = np.array([corridor.deviation(point) for point in points])
    assert deviations[deviations > 0.0] == pytest.approx(corridor.allowed, abs=1e-6)
    assert item["materials"][0]["opacity"] < 0.3
    assert (f"{ROOT}/Corridor.quaternion" in tracks(scene)) is (body is not None)
    path, frame = motion.problem.path, commands(scene, "set_transform")
    if body is None:
        assert frame[f"{ROOT}/Corridor"]["matrix"] == np.eye(4).ravel().tolist()
        along = [(path.pose(t).position - corridor.point) @ corridor.axis for t in (0.0, 100.0)]
        assert ((points - corridor.point) @ corridor.axis).max() > max(along)
