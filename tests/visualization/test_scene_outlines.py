"""Outlines of a scene's bodies in figures: where they are at the instants that are drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.patches import Polygon
from scipy.spatial import ConvexHull

import freefloat as ff
from freefloat.motion.law import PathLaw
from freefloat.motion.motion import Motion
from freefloat.so3 import heading_quaternion
from freefloat.visualization.scene_figures import outline_points, snapshots_figure

RATE = 0.1
BODIES = (
    ff.SceneBody("ball", ff.Sphere(0.2), [3.0, 0.0, 0.0]),
    ff.SceneBody(
        "bar", ff.Box([1.0, 0.1, 0.2]), [0.0, 3.0, 0.0],
        motion=ff.Tumbling([1.0, 1.0, 1.0], [0.0, 0.0, RATE]),
    ),
)  # fmt: skip


def motion_beside(name: str, attitude: list[float]) -> Motion:
    problem = ff.load_scenario(name).problem().replace(scene=ff.Scene(BODIES))
    return ff.simulate(problem, attitude).chosen.motion


def test_moving_bodies_are_drawn_at_every_instant_of_a_planar_figure() -> None:
    motion = motion_beside("planar_2dof/line", list(heading_quaternion(0.5)))
    (axes,) = snapshots_figure(motion).axes
    patches = [patch for patch in axes.patches if isinstance(patch, Polygon) and patch.get_fill()]
    assert len(patches) == 1 + 5
    assert [patch.get_label() for patch in patches].count("other bodies") == 1
    ball, *bars = (patch.get_xy()[:-1] for patch in patches)
    assert np.linalg.norm(ball - [3.0, 0.0], axis=1) == pytest.approx(0.2, abs=0.01)
    for bar, time in zip(bars, np.linspace(0.0, motion.final.time, 5), strict=True):
        edges = np.diff(np.vstack([bar, bar[:1]]), axis=0)
        longest = edges[np.linalg.norm(edges, axis=1).argmax()]
        direction = [np.cos(RATE * time), np.sin(RATE * time)]
        assert abs(longest @ direction) == pytest.approx(1.0, abs=1e-6)
        assert (bar.min(axis=0) + bar.max(axis=0)) / 2.0 == pytest.approx([0.0, 3.0], abs=1e-6)


def test_outlines_have_nearly_the_volume_of_the_shapes() -> None:
    shapes = [(ff.Sphere(0.5), 4.0 / 3.0 * np.pi * 0.125), (ff.Box([1, 2, 3]), 6.0),
              (ff.Cylinder(0.5, 2.0), 0.5 * np.pi)]  # fmt: skip
    motion = motion_beside("planar_2dof/line", list(heading_quaternion(0.5)))
    for shape, volume in shapes:
        scene = ff.Scene([ff.SceneBody("body", shape, [5.0, 0.0, 0.0])])
        beside = replace(motion, law=PathLaw(motion.problem.replace(scene=scene)))
        ((_, points),) = outline_points(beside, 0.0)
        assert ConvexHull(points).volume == pytest.approx(volume, rel=0.03)
        assert points.mean(axis=0) == pytest.approx([5.0, 0.0, 0.0], abs=0.01)
