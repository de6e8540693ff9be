"""Paths beyond the reach: where they leave it, and what a light spacecraft has to do with it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import freefloat as ff
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import UnreachableError
from freefloat.io.scenario.scenario import parse_scenario
from freefloat.paths import PolynomialCurve
from freefloat.planning.reasons import light_spacecraft_hint, out_of_reach, reach_message
from tests.scenarios import EASY


def along(start: list[float], end: list[float]) -> ff.Problem:
    """Example 2 along another line."""
    line = ff.load_scenario("spatial_6dof/line").problem()
    path = ff.EndEffectorPath(
        PolynomialCurve.line(np.array(start), np.array(end)), line.path.path.orientation
    )
    return replace(line, path=ff.TimedPath(path, line.path.timing))


def test_the_place_where_a_path_leaves_the_reach_lies_on_the_reach() -> None:
    problem = along([1.0, 0.0, 0.0], [-5.0, 8.0, 0.33])
    s = out_of_reach(problem)
    assert s is not None
    reach = VirtualManipulator.of(problem.model).reach
    position = problem.path.path.curve(s)
    assert np.linalg.norm(position) == pytest.approx(reach, rel=1e-9)
    assert f"s = {s:.3g}" in str(reach_message(problem))


def test_simulations_of_paths_out_of_reach() -> None:
    with pytest.raises(UnreachableError):
        ff.simulate(along([1000.0, 0.0, 0.0], [1.0, 0.0, 0.0]), [0.0, 0.0, 0.0, 1.0])
    leaving = ff.simulate(along([1.0, 0.0, 0.0], [-5.0, 8.0, 0.33]), [0.0, 0.0, 0.0, 1.0])
    assert leaving.to_dict()["out_of_reach"]


def test_a_spacecraft_lighter_than_its_arm_is_reported() -> None:
    """The UR5's base link alone, 4 kg, carries the arm."""
    bare = "urdf: 'example-robot-data:ur5', end_effector: tool0"
    text = EASY.replace("urdf: spatial_6dof, end_effector: end_effector", bare)
    text = text.replace("measure: arm", "measure: gjm")
    light = parse_scenario(text, Path("bare.yaml")).problem()
    assert "robot.spacecraft" in light_spacecraft_hint(light)
    assert light_spacecraft_hint(ff.load_scenario("spatial_6dof/line").problem()) == ""
