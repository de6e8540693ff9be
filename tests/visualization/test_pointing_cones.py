"""Cones and axes of limits of pointing on the page."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.motion.law import PathLaw
from freefloat.motion.motion import Motion
from freefloat.visualization.scenes.scene import motion_scene
from tests.scene_commands import tracks, vertices

ATTITUDE = [0.46008, 0.09337, 0.73519, -0.48898]
SUN = ff.PointingLimit("spacecraft", [0.6, 0.0, 0.8], 2.0, "outside", direction=[1.0, 2.0, -1.0])
VIEW = ff.PointingLimit("end_effector", [1.0, 0.0, 0.0], 0.3, point=[2.0, 0.5, 1.0])
LIMITS = ff.Limits(pointing=[SUN, VIEW])


@pytest.fixture(scope="module")
def motion(spatial: ff.Problem) -> Motion:
    return ff.simulate(spatial, ATTITUDE, branch=0).chosen.motion


@pytest.mark.slow
@pytest.mark.parametrize(("number", "drift"), [(0, 0.02), (1, 0.0)])
def test_the_rim_is_at_the_angle_from_the_target_and_the_arrow_is_the_axis(
    number: int, drift: float, motion: Motion
) -> None:
    """Also of a cone that opens backward, and while the target passes by."""
    limit = LIMITS.pointing[number]
    path = replace(motion.problem.path, drift=[drift, 0.0, 0.0])
    motion = replace(motion, law=PathLaw(motion.problem.replace(path=path)))
    scene = motion_scene({"good": motion}, limits=LIMITS)
    root = f"/meshcat/good/Pointing limits/pointing.{number}"
    surface, arrow = vertices(scene, f"{root}/cone/surface"), vertices(scene, f"{root}/axis")
    distances = np.linalg.norm(surface, axis=1)
    rim, tip = surface[distances > 1e-9], arrow[np.linalg.norm(arrow, axis=1).argmax()]
    assert np.ptp(np.linalg.norm(rim, axis=1)) < 1e-6
    moves = tracks(scene)
    times, _ = moves[f"{root}/cone.position"]
    for k in (0, len(times) // 3, len(times) - 1):
        t = min(float(times[k]), 100.0)
        (state,) = motion.sample([t])
        axis, target = limit.vectors(
            motion.problem.model, state.attitude, state.joints, path.origin(t)
        )
        apexes, axes = (
            moves[f"{root}/{part}.position"][1][3 * k :][:3] for part in ("cone", "axis")
        )
        assert apexes == pytest.approx(axes)
        if limit.point is not None:
            sight = limit.point + path.origin(t) - apexes
            assert sight / np.linalg.norm(sight) == pytest.approx(target, abs=1e-5)
        turned, pointed = (
            Rotation.from_quat(moves[f"{root}/{part}.quaternion"][1][4 * k :][:4])
            for part in ("cone", "axis")
        )
        cosines = turned.apply(rim) @ target / np.linalg.norm(rim, axis=1)
        assert np.arccos(cosines) == pytest.approx(limit.angle, abs=1e-5)
        assert pointed.apply(tip) / np.linalg.norm(tip) == pytest.approx(axis, abs=1e-5)
        if t in (0.0, 100.0):  # the first view has the rim
            places, seen = apexes + turned.apply(rim), np.array(scene.description.view.points)
            assert (np.abs(places) < np.abs(seen).max(axis=0) + 0.02).all()
