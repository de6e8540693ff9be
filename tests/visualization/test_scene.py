"""The command stream of a scene, read back, and the page around it."""

from __future__ import annotations

import gzip
import re
from base64 import b64decode
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from meshcat import Visualizer
from meshcat.path import Path as ScenePath
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.dynamics.measures import SingularityMeasure
from freefloat.motion.motion import Motion
from freefloat.so3 import heading_quaternion
from freefloat.visualization.page.playback import Playback
from freefloat.visualization.scenes.description import MarginColours
from freefloat.visualization.scenes.scene import motion_scene
from freefloat.visualization.scenes.scene_builder import PageScene
from freefloat.visualization.scenes.visuals import body_poses, robot_visuals
from tests.errors import error_key
from tests.scene_commands import commands, tracks

GOOD = [0.46008, 0.09337, 0.73519, -0.48898]


@pytest.fixture(scope="module")
def motion(spatial: ff.Problem) -> Motion:
    return ff.simulate(spatial, GOOD, branch=0).chosen.motion


@pytest.fixture(scope="module")
def scene(motion: Motion) -> PageScene:
    return motion_scene({"good": motion}, "Example 2")


def attribute(item: dict[str, Any], name: str = "position") -> np.ndarray:
    packed = item["geometries"][0]["data"]["attributes"][name]["array"]
    return np.frombuffer(packed.data, dtype="<f4").reshape(-1, 3)


def objects(scene: PageScene) -> dict[str, dict[str, Any]]:
    return {path: found["object"] for path, found in commands(scene, "set_object").items()}


@pytest.mark.slow
def test_tracks_are_the_poses_of_the_bodies(scene: PageScene, motion: Motion) -> None:
    values, names = tracks(scene), motion.problem.model.body_names
    for body, name in enumerate(names):
        times, positions = values[f"/meshcat/good/Robot/{name}.position"]
        _, quaternions = values[f"/meshcat/good/Robot/{name}.quaternion"]
        poses = body_poses(motion, motion.coordinates_at(np.clip(times, 0.0, 100.0)))
        assert positions.reshape(-1, 3) == pytest.approx(poses[0][:, body], abs=1e-6)
        shown = Rotation.from_quat(quaternions.reshape(-1, 4))
        off = shown * Rotation.from_matrix(poses[1][:, body]).inv()
        assert off.magnitude().max() < 1e-5


def test_the_trail_shows_the_measure_by_time_and_colour(scene: PageScene, motion: Motion) -> None:
    trail = scene.description.scenes[0].trail
    assert trail is not None
    states = motion.sample(trail.times[::50])
    wanted = [abs(motion.problem.margin.measure(state.joints)) for state in states]
    assert trail.values[::50] == pytest.approx(wanted, rel=1e-4)
    s = [motion.problem.path.timing.s(t) for t in trail.times[::50]]
    assert trail.fractions[::50] == pytest.approx(s, abs=1e-5)
    tube = objects(scene)[f"/meshcat/good/Trail/{motion.problem.model.end_effector_link}"]
    shades = attribute(tube, "color")[::10]  # of each ring
    assert shades[np.argmin(trail.values)].sum() < shades[np.argmax(trail.values)].sum()
    start, end = (motion.problem.path.pose(t).position for t in (0.0, 100.0))
    points, along = attribute(tube) - start, (end - start) / np.linalg.norm(end - start)
    assert np.linalg.norm(points - np.outer(points @ along, along), axis=1).max() < 0.03


def test_the_first_view_has_the_axes_but_not_long_panels() -> None:
    problem = ff.load_scenario("ets_vii/line").problem()
    motion = ff.simulate(problem, [0.0, 0.0, 0.0, 1.0], branch=0).chosen.motion
    seen = np.array(motion_scene({"a": motion}).description.view.points)
    assert np.linalg.norm(seen, axis=1).max() < 1.2 * problem.reach()  # panels: 1.8
    pose = problem.path.pose(0.0)
    tips = pose.position + 0.066 * problem.reach() * pose.rotation.T
    assert np.clip(tips, seen.min(axis=0), seen.max(axis=0)) == pytest.approx(tips, abs=1e-3)


@pytest.mark.slow
def test_a_playback_goes_into_a_visualizer(motion: Motion) -> None:
    sent: list[dict[str, Any]] = []
    window = SimpleNamespace(send=lambda command: sent.append(command.lower()))
    visualizer = Visualizer.view_into(window, ScenePath(("meshcat", "mine")))
    short = motion.cut(1.0, motion.ending)
    ff.playback({"first": short, "second": short}).into(visualizer)
    objects = [command["path"] for command in sent if command["type"] == "set_object"]
    shapes = len(robot_visuals(motion.problem.model).shapes)
    for name in ("first", "second"):  # the second robot is a copy
        root = f"/meshcat/mine/{name}/Robot/"
        assert sum(path.startswith(root) for path in objects) == shapes
    clips = [clip["path"] for clip in sent[-1]["animations"]]
    assert "/meshcat/mine/second/Robot/spacecraft" in clips
    assert sent[-1]["options"]["play"]
    matrices = {command["path"]: np.reshape(command["matrix"], (4, 4), order="F")
                for command in sent if command["type"] == "set_transform"}  # fmt: skip
    model, first = motion.problem.model, motion.initial
    q = model.configuration(first.attitude, first.joints)
    data = model.pin_model.createData()
    pin.forwardKinematics(model.pin_model, data, q)
    for number, body in enumerate(model.body_names):  # link by link, before anything is played
        placed = matrices[f"/meshcat/mine/second/Robot/{body}"]
        assert placed == pytest.approx(data.oMi[number + 1].homogeneous, abs=1e-6)


@pytest.mark.slow
def test_a_result_is_shown_in_a_visualizer(motion: Motion) -> None:
    sent: list[dict[str, Any]] = []
    window = SimpleNamespace(send=lambda command: sent.append(command.lower()))
    simulation = ff.simulate(motion.problem, motion.initial.attitude, branch=0)
    ff.show(simulation, Visualizer.view_into(window, ScenePath(("meshcat", "plan"))))
    assert sent[-1]["type"] == "set_animation"
    assert all(clip["path"].startswith("/meshcat/plan/") for clip in sent[-1]["animations"])
    assert error_key(ff.show, simulation, "a title") == "viewer"


def test_colours_show_what_is_below_the_margin() -> None:
    measure = SingularityMeasure("gjm", "", "m^3", lambda joints: 0.0)
    scale = MarginColours.over(ff.Margin(measure, 5.0), [np.array([1.0, 20.0]), np.array([])])
    below, just_below, margin, bright = scale(np.array([0.0, 4.999, 5.0, 20.0]))
    assert below.tolist() == just_below.tolist()
    assert np.abs(margin - below).max() > 0.3
    assert bright.sum() > margin.sum()
    assert np.isfinite(MarginColours.over(ff.Margin(measure, 0.0), [])(np.array([0.0]))).all()


def test_a_page_carries_the_commands_and_may_request_nothing(scene: PageScene) -> None:
    text = Playback(scene).html()
    (packed,) = re.findall('id="scene">([^<]*)<', text)
    raw = gzip.decompress(b64decode(packed))
    assert raw[4 : 4 + int.from_bytes(raw[:4], "little")] == scene.objects[0]
    (policy,) = re.findall(r'Content-Security-Policy" content="([^"]*)"', text)
    assert "default-src 'none'" in policy
    assert "'self'" not in policy
    assert "Robin Deits" in text  # MeshCat's licence


def test_motions_that_do_not_fit_on_a_page_are_refused(motion: Motion, planar: ff.Problem) -> None:
    other = ff.simulate(planar, heading_quaternion(3.5), branch=0).chosen.motion
    for motions in ({}, {"a/b": motion, "a∕b": motion}, {"a": motion, "b": other}):
        with pytest.raises(ff.InputError):
            motion_scene(motions)
