"""Answers of the worker agree with the library, also where there is nothing to show."""

import base64
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.beyond.studio.analyses import PathAnalysis
from freefloat.beyond.studio.analysis import RobotCache
from freefloat.beyond.studio.messages import WorkerState
from freefloat.io.scenario.loading import parse_scenario
from freefloat.robot.named_files import find_scenario


def analysis(name: str, **changes: Any) -> tuple[PathAnalysis, WorkerState]:
    source = find_scenario(name)
    content = yaml.safe_load(source.read_text("utf-8")) | changes
    state = WorkerState(yaml.safe_dump(content), source)
    return PathAnalysis(state, parse_scenario(state.text, source), RobotCache()), state


def unpacked(text: str, kind: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), dtype=kind)


def no_progress(_: float) -> None:
    """Go on."""


@pytest.mark.slow
def test_the_ball_is_the_map_of_the_problem() -> None:
    studied, _ = analysis("spatial_6dof/line")
    answer = studied.next_map(no_progress)
    expected = ff.attitude_map(
        ff.load_scenario("spatial_6dof/line").problem(), studied.levels[0], refine=False
    )
    points = unpacked(answer.content["points"], "<f4").reshape(-1, 3)
    overlap = (Rotation.from_rotvec(points).as_quat() * expected.attitudes).sum(axis=1)
    assert np.abs(overlap) == pytest.approx(1.0, abs=1e-6)
    feasible = expected.feasible.any(axis=1)
    assert (unpacked(answer.content["states"], "u1") == 2).tolist() == feasible.tolist()
    said = [reason.startswith("feasible") for reason in answer.reasons]
    assert said == feasible.tolist()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("planar_2dof/line", {"from": [9.0, 0.0, 0.0], "to": [9.0, 1.0, 0.0]}),
        ("spatial_6dof/line", {"from": [9.0, 0.0, 0.0], "to": [9.0, 1.0, 0.0]}),
    ],
)
def test_a_path_out_of_reach_is_explained(name: str, line: dict[str, Any]) -> None:
    path = yaml.safe_load(find_scenario(name).read_text("utf-8"))["path"] | {"line": line}
    studied, state = analysis(name, path=path)
    assert len(studied.outline().content["handles"]) == 2
    while studied.level < len(studied.levels) - (name[:2] == "sp"):  # without the largest
        answer = studied.next_map(no_progress)
        assert "reach" in answer.content["remark"]
    motion = studied.motion(state, no_progress).content
    assert "scene" not in motion
    assert "reaches the start" in motion["outcome"]
    assert "refused" in studied.page().content


@pytest.mark.slow
def test_the_motion_shown_keeps_the_limits() -> None:
    studied, state = analysis("spatial_6dof/above")
    while studied.level < 2:  # as many maps as the studio makes before the motion
        studied.next_map(no_progress)
    assert "scene" in studied.motion(state, no_progress).content
    results = studied.limits().content["results"]
    assert {result["limit"] for result in results} > {"clearance", "joint rate"}
    assert all(result["kept"] for result in results)


def test_the_page_has_the_name_of_the_file_and_names_violated_limits() -> None:
    studied, state = analysis("planar_2dof/line", limits={"joint_rate": 1e-3})
    assert studied.motion(state, no_progress).content["outcome"] == "The whole path was followed."
    studied.limits()
    page = studied.page().content["html"]
    assert "<title>line</title>" in page
    assert "infeasible: violates joint_rate" in page


@pytest.mark.slow
def test_without_a_feasible_attitude_the_motion_that_gets_farthest_is_shown() -> None:
    margin = {"measure": "gjm", "fraction": 0.95}
    studied, state = analysis("ur5_servicer/inspect", margin=margin)
    answer = studied.next_map(no_progress)
    assert not (unpacked(answer.content["states"], "u1") == 2).any()
    motion = studied.motion(state, no_progress).content
    assert motion["outcome"].startswith("The whole path was followed below the margin: ")
    assert studied.limits().content["results"]
