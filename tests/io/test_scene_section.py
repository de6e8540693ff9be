"""The ``scene`` section: every shape and motion, there and back; self-contained result files."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.io.scenario.problem_text import scenario_of
from freefloat.io.scenario.scenario import Scenario
from freefloat.robot.description import RobotDescription
from freefloat.robot.named_files import find_scenario
from freefloat.robot.shapes import MeshFile
from freefloat.scene.scene_body import EndEffectorPoses

CLIENT = (
    '<robot name="client"><link name="bus"><collision><geometry><box size="0.4 0.3 0.5"/>'
    "</geometry></collision></link></robot>"
)
BODIES = [
    {"name": "bus", "box": [0.4, 0.3, 0.5], "position": [3, 1, 0]},
    {"name": "ball", "sphere": 0.2, "position": [3, -1, 0], "with": "target"},
    {"name": "mast", "cylinder": {"radius": 0.1, "length": 0.5}, "position": [-3, 0, 0],
     "orientation": {"rpy": [0.1, 0.2, 0.3]}},
    {"name": "part", "mesh": "part.stl", "scale": [0.001, 0.001, 0.002], "position": [0, 3, 0]},
    {"name": "client", "urdf": "client.urdf", "position": [0, -3, 0],
     "tumbling": {"inertia": [2, 3, 4], "rate": [0.1, 0.2, 0], "com": [0, 0, 0.1]},
     "touch_links": ["link_2"]},
]  # fmt: skip
CORRIDOR = {"point": [0, 0, 0.4], "axis": [0, 0, 1], "half_angle_deg": 89, "body": "client"}


@pytest.fixture
def scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Scenario:
    monkeypatch.chdir(tmp_path)
    Path("client.urdf").write_text(CLIENT)
    trimesh.creation.box((400.0, 300.0, 250.0)).export("part.stl")
    return written()


def written(bodies=BODIES, corridor=CORRIDOR):
    """The scenario of ``mine.yaml``."""
    content = yaml.safe_load(find_scenario("spatial_6dof/line").read_text())
    content["scene"] = {"bodies": bodies, "corridor": corridor}
    content["limits"] = {"clearance": 0.01}
    Path("mine.yaml").write_text(yaml.safe_dump(content, sort_keys=False))
    return ff.load_scenario("mine.yaml")


def distances(problem, t=7.0):
    """Of all pairs of robot and scene in a configuration."""
    from freefloat.limits.pairs import CollisionPairs

    pairs = CollisionPairs(problem.model, scene=problem.scene)
    poses = problem.scene.poses(t, problem, EndEffectorPoses.on(problem.path.pose(t)))
    everything = np.arange(len(pairs.pairs))
    return pairs.distances(np.full(6, 0.3), everything, [0.0, 0.0, 0.6, 0.8], poses)


def test_every_shape_and_motion_is_read(scenario):
    scene = scenario.problem().scene
    bus, ball, mast, part, client = scene.bodies
    assert (bus.shape.size == [0.4, 0.3, 0.5]).all()
    assert (ball.shape.radius, ball.motion) == (0.2, "target")
    assert (mast.shape.radius, mast.shape.length) == (0.1, 0.5)
    axes = Rotation.from_euler("xyz", [0.1, 0.2, 0.3]).as_matrix()
    np.testing.assert_allclose(mast.orientation, axes, atol=1e-15)
    assert isinstance(part.shape, MeshFile)
    assert isinstance(client.shape, RobotDescription)
    assert (client.motion.com == [0.0, 0.0, 0.1]).all()
    assert client.touch_links == ("link_2",)
    assert scene.corridor.half_angle == pytest.approx(np.radians(89))


def test_a_problem_describes_its_scene(scenario):
    problem = scenario.problem()
    again = scenario_of(problem, limits=scenario.limits()).problem()
    assert again.scene.names == problem.scene.names
    np.testing.assert_allclose(distances(again), distances(problem), rtol=0, atol=1e-12)
    assert again.scene.corridor.allowed == pytest.approx(problem.scene.corridor.allowed)


@pytest.mark.slow
def test_a_result_file_needs_no_urdf_of_the_scene(scenario):
    problem = scenario.problem()
    attitude = [0.46008, 0.09337, 0.73519, -0.48898]
    simulation = ff.simulate(problem, attitude, limits=scenario.limits())
    ff.save(simulation, "motion.h5")
    Path("client.urdf").unlink()
    loaded = ff.load("motion.h5")
    np.testing.assert_allclose(distances(loaded.chosen.motion.problem), distances(problem),
                               rtol=0, atol=1e-12)  # fmt: skip
    worst = {result.limit: result.worst for result in simulation.limit_results}
    for result in ff.check(loaded).limits:
        assert result.worst == pytest.approx(worst[result.limit], abs=1e-6)
    assert {"corridor", "clearance"} <= worst.keys()


@pytest.mark.parametrize(("body", "key"), [
    ({"name": "a"}, "scene.bodies.0"),
    ({"name": "a", "mesh": "missing.stl"}, "scene.bodies.0.mesh"),
    ({"name": "a", "sphere": 1, "with": "robot"}, "scene.bodies.0.with"),
    ({"name": "a", "sphere": 1, "tumbling": {"inertia": [1, 1, 9], "rate": [0, 0, 1]}},
     "scene.bodies.0.tumbling.inertia"),
])  # fmt: skip
def test_invalid_bodies_are_errors_with_their_key(body, key, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ff.InputError) as caught:
        written([body], None).problem()
    assert (caught.value.key, caught.value.source) == (key, "mine.yaml")
