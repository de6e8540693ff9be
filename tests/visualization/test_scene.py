"""What a recording says, read back from its commands; how a page carries it."""

from __future__ import annotations

import gzip
import re
from base64 import b64decode
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import umsgpack

from freefloat.dynamics.measures import SingularityMeasure
from freefloat.errors import InputError
from freefloat.io.scenario import load_scenario
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Margin
from freefloat.motion.simulation import simulate
from freefloat.so3 import heading_quaternion
from freefloat.visualization.body_poses import body_poses
from freefloat.visualization.camera import first_view
from freefloat.visualization.colours import MarginColours
from freefloat.visualization.page import Capture, page
from freefloat.visualization.scene import Recording, record

GOOD = [0.46008, 0.09337, 0.73519, -0.48898]


@pytest.fixture(scope="module")
def motion() -> Motion:
    return simulate(load_scenario("spatial_6dof/line").problem(), GOOD, branch=0).chosen.motion


@pytest.fixture(scope="module")
def recording(motion: Motion) -> Recording:
    return record({"good": motion}, "Example 2")


def unpacked(recording: Recording) -> list[dict[str, Any]]:
    return [umsgpack.unpackb(command) for command in recording.objects]


def objects(recording: Recording) -> dict[str, dict[str, Any]]:
    return {
        one["path"]: one["object"] for one in unpacked(recording) if one["type"] == "set_object"
    }


def vertices(thing: dict[str, Any]) -> np.ndarray:
    packed = thing["geometries"][0]["data"]["attributes"]["position"]["array"]
    return np.frombuffer(packed.data, dtype="<f4").reshape(-1, 3)


def colours(thing: dict[str, Any]) -> np.ndarray:
    packed = thing["geometries"][0]["data"]["attributes"]["color"]["array"]
    return np.frombuffer(packed.data, dtype="<f4").reshape(-1, 3)


def test_the_path_and_the_trail_lie_on_the_path(motion: Motion, recording: Recording) -> None:
    found = objects(recording)
    start, end = (motion.problem.path.pose(t).position for t in (0.0, 100.0))
    along = (end - start) / np.linalg.norm(end - start)
    for name in ("End-effector path", "Trail"):
        points = vertices(found[f"/meshcat/good/{name}"]) - start
        off = points - np.outer(points @ along, along)
        assert np.linalg.norm(off, axis=1).max() < 0.01 * 3.0
        assert (points @ along).max() == pytest.approx(np.linalg.norm(end - start), abs=1e-3)


def test_the_trail_tells_the_measure_by_time_and_colour(
    motion: Motion, recording: Recording
) -> None:
    trail = recording.about["scenes"][0]["trail"]
    states = motion.sample(trail["times"][::50])
    wanted = [abs(motion.problem.margin.measure(state.joints)) for state in states]
    assert trail["values"][::50] == pytest.approx(wanted, rel=1e-4)
    s = [motion.problem.path.timing.s(t) for t in trail["times"][::50]]
    assert trail["fractions"][::50] == pytest.approx(s, abs=1e-5)
    shades = colours(objects(recording)["/meshcat/good/Trail"])[::10]  # one a ring
    low, high = np.argmin(trail["values"]), np.argmax(trail["values"])
    assert shades[low].sum() < shades[high].sum()


def test_the_momentum_arrow_points_along_the_momentum(motion: Motion, recording: Recording) -> None:
    points = vertices(objects(recording)["/meshcat/good/Momentum"])
    tip = points[-1] / np.linalg.norm(points[-1])
    h = motion.problem.momentum
    assert tip == pytest.approx(h / np.linalg.norm(h), abs=1e-6)
    texts = [label["text"] for label in recording.about["scenes"][0]["labels"]]
    assert "h = 0.592 N m s" in texts


def test_without_momentum_there_is_no_arrow() -> None:
    problem = load_scenario("ur5_servicer/arc").problem()
    still = simulate(problem, [0.0, 0.0, 0.0, 1.0], branch=0).chosen.motion
    found = record({"m": still})
    assert "/meshcat/m/Momentum" not in objects(found)
    assert "/meshcat/m/Centre of mass" in objects(found)


def test_tracks_are_told_after_objects_and_last_as_long(motion: Motion) -> None:
    early = motion.cut(motion.panels / 2.0, motion.ending)
    found = record({"whole": motion, "half": early})
    animation = umsgpack.unpackb(found.animation)
    assert {clip["clip"]["duration"] for clip in animation["animations"]} == {100.0}
    assert animation["options"]["play"] is False
    known = set(objects(found)) | {f"/{target}" for _, target in found.copies}
    for clip in animation["animations"]:
        assert any(path == clip["path"] or path.startswith(clip["path"] + "/") for path in known)


def test_planar_rings_have_the_radii_of_the_areas() -> None:
    problem = load_scenario("planar_3dof/parabola").problem()
    turned = simulate(problem, heading_quaternion(3.5), branch=0).chosen.motion
    found = objects(record({"m": turned}))
    radii = [
        np.linalg.norm(vertices(found[f"/meshcat/m/Areas/{k}"])[:, :2], axis=1) for k in (1, 2, 3)
    ]
    # the paper's areas of the last joint: dependent, independent, dependent
    assert [(r.min(), r.max()) for r in radii] == [
        (pytest.approx(0.3928, abs=1e-3), pytest.approx(radii[1].min(), abs=1e-6)),
        (pytest.approx(radii[0].max(), abs=1e-6), pytest.approx(radii[2].min(), abs=1e-6)),
        (pytest.approx(radii[1].max(), abs=1e-6), pytest.approx(3.174, abs=1e-3)),
    ]


def singularity_measure() -> SingularityMeasure:
    return SingularityMeasure("gjm", "", "m^3", lambda joints: 0.0)


def test_colours_tell_what_is_below_the_margin() -> None:
    scale = MarginColours.over(
        Margin(singularity_measure(), 5.0), [np.array([1.0, 20.0]), np.array([])]
    )
    below, just_below, margin, bright = scale(np.array([0.0, 4.999, 5.0, 20.0]))
    assert below.tolist() == just_below.tolist()
    assert np.abs(margin - below).max() > 0.3
    assert bright.sum() > margin.sum()
    assert scale.document()["largest"] == 20.0


def test_colours_without_a_margin_or_a_motion() -> None:
    scale = MarginColours.over(Margin(singularity_measure(), 0.0), [])
    assert np.isfinite(scale(np.array([0.0]))).all()


def test_the_first_view_holds_everything(motion: Motion) -> None:
    poses = body_poses(motion.problem.model, motion.attitudes, motion.joints)
    bus = np.array([[0.5, 2.0, 0.5], [-0.5, -2.0, 0.5]])
    view = first_view([poses], [bus], np.array([[0.0, 0.0, -9.0]]), flat=False)
    everywhere = poses.positions + np.einsum("kij,j->ki", poses.rotations[:, 0], bus[0])[:, None]
    assert np.linalg.norm(everywhere[:, 0] - view.centre, axis=1).max() <= view.radius + 0.05
    assert min(point[2] for point in view.points) == -9.0
    eye = np.asarray(view.direction)
    ahead = poses.positions[:, 1:].mean(axis=1) - poses.positions[:, 0]
    assert (ahead @ eye).mean() > 0.0  # the arm is nearer than the spacecraft


def blob(text: str, name: str) -> Iterator[dict[str, Any]]:
    found = re.search(f'id="{name}">([^<]*)<', text)
    assert found is not None
    raw = gzip.decompress(b64decode(found[1]))
    at = 0
    while at < len(raw):
        length = int.from_bytes(raw[at : at + 4], "little")
        yield umsgpack.unpackb(raw[at + 4 : at + 4 + length])
        at += 4 + length


def test_a_page_carries_the_commands(recording: Recording) -> None:
    text = page(recording)
    assert [one["type"] for one in blob(text, "scene")] == [
        one["type"] for one in unpacked(recording)
    ]
    assert [one["type"] for one in blob(text, "tracks")] == ["set_animation"]


def test_a_page_may_ask_for_nothing(recording: Recording) -> None:
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page(recording))
    assert policy is not None
    assert "default-src 'none'" in policy[1]
    assert "'self'" not in policy[1]
    taking = page(recording, Capture((0.0,), 64, 48, "/token"))
    assert "connect-src data: blob: 'self'" in taking


def test_a_page_names_the_licences_of_what_it_carries(recording: Recording) -> None:
    text = page(recording)
    assert "Robin Deits" in text


def test_names_alike_are_refused(motion: Motion) -> None:
    with pytest.raises(InputError, match="names alike"):
        record({"a/b": motion, "a∕b": motion})
