"""The command stream of a scene with its surroundings, read back, and the page around it."""

import gzip
import re
from base64 import b64decode
from dataclasses import replace
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
from freefloat.motion.law import PathLaw
from freefloat.motion.motion import Motion
from freefloat.planning.plan import Plan
from freefloat.scene.scene_body import EndEffectorPoses
from freefloat.so3 import heading_quaternion
from freefloat.visualization.page.playback import Playback
from freefloat.visualization.scenes.description import MarginColours
from freefloat.visualization.scenes.scene import Place, motion_scene
from freefloat.visualization.scenes.scene_builder import PageScene
from freefloat.visualization.scenes.visuals import body_poses, robot_visuals
from tests.errors import error_key
from tests.motions import BAD, GOOD
from tests.scene_commands import commands, tracks, vertices


@pytest.fixture(scope="module")
def motion(spatial: ff.Problem) -> Motion:
    return ff.simulate(spatial, GOOD, branch=0).chosen.motion


@pytest.fixture(scope="module")
def scene(motion: Motion) -> PageScene:
    return motion_scene({"good": motion}, "Example 2")


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
    tube = f"{ROOT}/Trail/{motion.problem.model.end_effector_link}"
    shades = vertices(scene, tube, "color")[::10]  # of each ring
    assert shades[np.argmin(trail.values)].sum() < shades[np.argmax(trail.values)].sum()
    start, end = (motion.problem.path.pose(t).position for t in (0.0, 100.0))
    points, along = vertices(scene, tube) - start, (end - start) / np.linalg.norm(end - start)
    assert np.linalg.norm(points - np.outer(points @ along, along), axis=1).max() < 0.03


def test_texts_on_a_page_have_the_times_of_its_clock(motion: Motion, spatial: ff.Problem) -> None:
    """Of phases that begin 7 s before the first path: the clock is 7 s behind the page."""
    phases = {"before": motion, "path": ff.simulate(spatial, BAD, branch=2).chosen.motion}
    scene = motion_scene(phases, places=[Place(-7.0), Place(93.0)])
    (label,) = (one for one in scene.description.scenes[1].labels if one.item == "Singularity")
    end = phases["path"].final.time
    assert (label.text, label.since) == (f"singular at t = {93.0 + end:.3f} s", 100.0 + end)


@pytest.mark.slow
def test_a_playback_goes_into_a_visualizer(motion: Motion) -> None:
    sent: list[dict[str, Any]] = []
    window = SimpleNamespace(send=lambda command: sent.append(command.lower()))
    visualizer = Visualizer.view_into(window, ScenePath(("meshcat", "mine")))
    short = motion.cut(1.0, motion.ending)
    ff.show({"first": short, "second": short}, visualizer)
    assert error_key(ff.show, {"first": short}, "a title") == "viewer"
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
    infeasible = Plan(motion.problem, ff.Search(), False, "for a test")
    for result in (infeasible, motion.problem, {"name": motion.problem}, {}):
        with pytest.raises(ff.InputError):
            ff.playback(result)


ROOT = "/meshcat/good"
TURN = Rotation.from_euler("xyz", [0.3, 0.2, 0.1]).as_matrix()
TUMBLING = ff.Tumbling([3.0, 2.0, 1.0], [0.02, 0.1, 0.0], com=[0.1, 0.0, 0.3])
BODIES = (
    ff.SceneBody("mast", ff.Cylinder(0.1, 2.0), [3.0, 0.0, 1.0], TURN),
    ff.SceneBody("client", ff.Box([1.0, 1.0, 2.0]), [0.0, 3.0, 1.0], TURN, TUMBLING),
    ff.SceneBody("tool", ff.Sphere(0.1), [0.0, 0.1, 0.4], motion="target"),
)


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
@pytest.mark.parametrize(("half_angle", "body"), [(0.3, "client"), (None, None)])
def test_the_surface_of_the_corridor_is_at_its_limit(motion, half_angle, body):
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


SUN = ff.PointingLimit("spacecraft", [0.6, 0.0, 0.8], 2.0, "outside", direction=[1.0, 2.0, -1.0])
VIEW = ff.PointingLimit("end_effector", [1.0, 0.0, 0.0], 0.3, point=[2.0, 0.5, 1.0])
LIMITS = ff.Limits(pointing=[SUN, VIEW])


@pytest.mark.slow
@pytest.mark.parametrize(("number", "drift"), [(0, 0.02), (1, 0.0)])
def test_the_rim_is_at_the_angle_from_the_target_and_the_arrow_is_the_axis(number, drift, motion):
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
