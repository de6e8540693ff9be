"""Rings of headings are coloured by the minimum margin, where the path is reached."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import freefloat as ff
from freefloat.planning.domain import SearchDomain
from freefloat.planning.plane.heading_map import HeadingMap
from freefloat.so3 import heading_quaternion
from freefloat.visualization.scenes.heading_scene import NODE, heading_scene
from tests.maps import branch_results
from tests.scene_commands import commands

MARGINS = np.array([[9.0, 6.0, 4.0, 0.0], [np.nan, 20.0, np.nan, 7.0]])


def attribute(item: dict[str, Any], name: str) -> np.ndarray:
    packed = item["geometries"][0]["data"]["attributes"][name]["array"]
    return np.frombuffer(packed.data, dtype="<f4").reshape(-1, 4, 3)


def test_a_quadrilateral_stands_for_each_motion() -> None:
    problem = ff.load_scenario("planar_3dof/parabola").problem()  # the margin is 5
    headings = SearchDomain().headings(4)
    results = branch_results(heading_quaternion(headings), MARGINS.T, 3)
    result = HeadingMap(problem, results, headings, (0, 3))
    scene = heading_scene(result)
    drawn = commands(scene, "set_object")
    for number, name in enumerate(("elbow+", "branch 3")):
        (reached,) = np.nonzero(np.isfinite(MARGINS[number]))
        centres = attribute(drawn[f"/meshcat/{NODE}/{name}"]["object"], "position").mean(axis=1)
        directions = centres[:, :2] / np.linalg.norm(centres, axis=1)[:, None]
        angles = result.headings[reached]
        wanted = np.column_stack([np.cos(angles), np.sin(angles)])
        assert directions == pytest.approx(wanted, abs=1e-6)
        colours = attribute(drawn[f"/meshcat/{NODE}/{name}"]["object"], "color")[:, 0]
        wanted = scene.description.scale(MARGINS[number, reached])
        assert colours == pytest.approx(wanted, abs=1e-6)
    below, kept = scene.description.scale(np.array([4.0, 6.0]))
    assert np.abs(below - kept).max() > 0.3
    assert scene.description.scenes[0].lines[1].startswith("75.00% of 4 headings")
    assert [label.text for label in scene.description.scenes[0].labels][-1] == "best"
