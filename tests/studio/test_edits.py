"""Edits change what they are named for and nothing else, in every frame."""

from typing import Any

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.beyond.studio.analyses import analysis_of
from freefloat.beyond.studio.analysis import RobotCache
from freefloat.beyond.studio.edits import edited
from freefloat.beyond.studio.messages import (
    MoveHandle,
    SetDuration,
    SetMargin,
    SetMomentum,
    TurnEnd,
    WorkerState,
)  # fmt: skip
from freefloat.robot.named_files import find_scenario
from tests.errors import error_key

ONE = {"gesture": "1", "done": True}
END = [0.4, -0.3, 1.2]


def scenario(name: str) -> dict[str, Any]:
    return dict(yaml.safe_load(find_scenario(name).read_text("utf-8")))


def outline_of(content: dict[str, Any]) -> dict[str, Any]:
    state = WorkerState(yaml.safe_dump(content), find_scenario("spatial_6dof/line"))
    return dict(analysis_of(state, RobotCache()).outline().content)


def moved(content: dict[str, Any], handle: int, position: np.ndarray) -> dict[str, Any]:
    edit = MoveHandle(type="handle", handle=handle, position=tuple(position.tolist()), **ONE)
    return edited(content, edit, outline_of(content))


def turned_end(content: dict[str, Any]) -> dict[str, Any]:
    edit = TurnEnd(type="orientation", value=tuple(END), **ONE)
    return edited(content, edit, outline_of(content))


def positions(content: dict[str, Any]) -> np.ndarray:
    return np.array([handle["position"] for handle in outline_of(content)["handles"]])


PATHS: dict[str, dict[str, Any]] = {
    "line": {},
    "waypoints": {"path": {"waypoints": [[1, 0, 0], [0.6, 0.5, 0.1], [0, 0.7, 0.2]]}},
    "arc": {"path": {"arc": {"center": [0, 0, 0.1], "normal": [0, 0, 1], "from": [1, 0, 0.1],
                             "angle_deg": 50}}},
    "polynomial": {"path": {"polynomial": {"x": [1, -1], "y": [0, 1, 0.2], "z": [0.1]}}},
    "frame": {"path": {"line": {"from": [1.5, 0, 0], "to": [1, 0.5, 0.3]}, "frame": "spacecraft"},
              "search": {"joints": [0.3, -0.5, 1.1, 0.4, 0.9, -0.2],
                         "from_attitude": [0.1, 0.3, -0.3, 0.9]}},
    "drift": {"drift": [0.001, 0.002, 0.0]},
    "target": {"path": {"line": {"from": [1, 0, 0], "to": [0.5, 0.8, 0.3]},
                        "attitude": {"point_at": {"target": [3, 0, 0], "axis": "x"}}}},
}  # fmt: skip


def example(kind: str) -> dict[str, Any]:
    """Example 2 with another path, or a goal."""
    if kind == "goal":
        content = scenario("spatial_6dof/around")
        content["goal"]["pose"] |= {"frame": "spacecraft"}
        return content | {"search": PATHS["frame"]["search"]}
    content = scenario("spatial_6dof/line")
    changes = PATHS[kind]
    path = changes.get("path")
    if path is not None and "attitude" not in path:
        changes = {**changes, "path": {**path, "attitude": content["path"]["attitude"]}}
    return {**content, **changes}


@pytest.mark.parametrize("kind", [*PATHS, "goal"])
def test_a_moved_handle_is_where_it_was_moved_to(kind: str) -> None:
    content = example(kind)
    before = positions(content)
    for handle, place in enumerate(before):
        wanted = place + np.array([0.05, -0.03, 0.02])
        after = positions(moved(content, handle, wanted))
        assert after[handle] == pytest.approx(wanted, abs=2e-6)
        others = np.arange(len(before)) != handle
        if kind != "drift":  # a spline through other points has other knots
            assert after[others] == pytest.approx(before[others], abs=2e-6)


def test_the_end_turns_and_the_start_does_not() -> None:
    assert outline_of(turned_end(example("goal")))["rpy"] == END
    assert error_key(turned_end, example("target")) == "orientation"  # which its target states
    for kind in ("line", "frame"):
        content = example(kind)
        before = ff.load_scenario(content).problem().path.path
        changed = turned_end(content)
        after = ff.load_scenario(changed).problem().path.path
        assert after.pose(0.0).rotation == pytest.approx(before.pose(0.0).rotation, abs=1e-8)
        assert outline_of(changed)["rpy"] == END
        if kind != "frame":
            end = Rotation.from_euler("xyz", END).as_matrix()
            assert after.pose(1.0).rotation == pytest.approx(end, abs=1e-8)


def test_rests_keep_their_places_when_the_duration_changes() -> None:
    content = scenario("planar_3dof/parabola")
    changed = edited(content, SetDuration(type="duration", value=50.0, **ONE), None)
    before, after = (ff.load_scenario(each).problem().path.timing for each in (content, changed))
    assert after.duration == 50.0
    for time in (10.0, 69.73, 90.0):
        assert after.s(time / 2.0) == pytest.approx(before.s(time), abs=1e-9)


def test_momentum_and_margin_are_set_as_the_scenario_states_them() -> None:
    content = scenario("ur5_servicer/inspect")
    changed = edited(content, SetMargin(type="margin", value=0.2, **ONE), None)
    assert changed["margin"] == {"measure": "gjm", "fraction": 0.2}
    changed = edited(changed, SetMomentum(type="momentum", value=(0.1, 0.0, 0.0), **ONE), None)
    assert ff.load_scenario(changed).problem().momentum.tolist() == [0.1, 0.0, 0.0]
    assert changed["path"] == content["path"]


@pytest.mark.slow
def test_a_path_on_a_tumbling_body_has_no_handles() -> None:
    content = scenario("servicing/capture_client")
    assert outline_of(content)["handles"] == []
    assert error_key(moved, content, 0, np.zeros(3)) == "handle"


@pytest.mark.slow
def test_each_path_of_two_arms_has_handles() -> None:
    content = scenario("servicing/two_arms_both")
    names = [handle["name"] for handle in outline_of(content)["handles"]]
    assert names[3:7] == ["target", "left start", "left 1", "left end"]
    changed = moved(content, 6, positions(content)[6] + [0.0, 0.1, 0.0])
    arm = changed["robot"]["arms"].pop("left")
    assert arm["law"]["path"]["waypoints"][2] == [1.0, 0.9, 0.1]
    assert changed["robot"]["arms"] == {"right": content["robot"]["arms"]["right"]}
    assert changed["path"] == content["path"]
