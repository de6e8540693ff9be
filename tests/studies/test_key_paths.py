"""Keys of scenarios by their dotted paths."""

from __future__ import annotations

import pytest

from freefloat.errors import InputError
from freefloat.io.schema import ScenarioFile
from freefloat.studies.key_paths import refuse_unknown_path, with_values


@pytest.mark.parametrize(
    "path",
    [
        *("momentum", "momentum.2", "timing.duration", "timing.stops.0.t", "timing.law"),
        *("path.line.to", "path.line.from.1", "path.waypoints.7", "path.polynomial.x.0"),
        *("path.attitude.fixed", "path.attitude.fixed.axes.x", "path.attitude.slerp.from.rpy"),
        *("robot", "robot.urdf", "robot.scale_mass", "robot.scale_mass.link_1", "robot.held.q9"),
        *("robot.spacecraft.mass", "robot.spacecraft.inertia.0", "robot.payload.com.2"),
        *("robot.attached.0.mount.xyz.1", "margin.fraction", "search.seed", "limits.joint_rate"),
        *("limits.joint_rate.q1", "redundancy.metric.q1", "redundancy.gain"),
    ],
)
def test_a_path_to_a_key_of_scenarios_is_known(path: str) -> None:
    refuse_unknown_path(ScenarioFile, path)


@pytest.mark.parametrize(
    ("path", "wrong", "accepted"),
    [
        ("momentun", "'momentun'", "momentum"),
        ("timing.durations", "'durations'", "duration, law, stops"),
        ("momentum.3", "'3'", "0, 1, 2"),
        ("momentum.x", "'x'", "0, 1, 2"),
        ("momentum.0.1", "'1'", "nothing below it"),
        ("path.line.start", "'start'", "from, to"),
        ("path.attitude.fixed.axes.w", "'w'", "x, y, z"),
        ("path.waypoints.first", "'first'", ""),
        ("", "''", "robot, task, momentum"),
        ("momentum.", "''", "0, 1, 2"),
        ("robot.scale_mass.", "''", ""),
    ],
)
def test_a_wrong_word_is_named_with_what_would_do(path: str, wrong: str, accepted: str) -> None:
    with pytest.raises(InputError) as caught:
        refuse_unknown_path(ScenarioFile, path)
    assert caught.value.key == path
    assert caught.value.problem.partition(" (did you mean ")[0].endswith(wrong)
    assert accepted in caught.value.accepted


def test_values_are_put_into_a_copy() -> None:
    base = {"momentum": [1, 2, 3], "timing": {"duration": 5}}
    changed = with_values(
        base, {"momentum.1": 9, "timing.duration": [7], "limits.joint_rate.q1": 0.1}
    )
    assert changed == {
        "momentum": [1, 9, 3],
        "timing": {"duration": [7]},
        "limits": {"joint_rate": {"q1": 0.1}},
    }
    assert base == {"momentum": [1, 2, 3], "timing": {"duration": 5}}


def test_a_value_put_in_is_not_shared() -> None:
    value = [0.0, 0.0]
    changed = with_values({}, {"path.line.to": value})
    value[0] = 1.0
    assert changed == {"path": {"line": {"to": [0.0, 0.0]}}}


@pytest.mark.parametrize(
    ("path", "problem"),
    [("momentum.3", "3 entries"), ("task.kind", "'pose' above 'kind'"), ("momentum.2.a", "above")],
)
def test_what_stands_in_the_way_is_told(path: str, problem: str) -> None:
    with pytest.raises(InputError) as caught:
        with_values({"momentum": [1, 2, 3], "task": "pose"}, {path: 1})
    assert caught.value.key == path
    assert problem in caught.value.problem
