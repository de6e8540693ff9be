"""Mesh files: where they are looked for, and that what is read of them is what stands in them."""

import base64
import json
import time
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pytest
import trimesh

from freefloat.robot.meshes import Part, read_mesh
from freefloat.robot.named_files import examples_folder
from freefloat.robot.source import MeshFileError, find_mesh

EXAMPLES = [
    examples_folder() / file
    for file in (
        "ur_description/meshes/ur5/visual/forearm.dae",
        "panda_description/meshes/visual/link6.dae",
    )
]
"""Files with one and with several nodes and colours."""


def bounds(parts: tuple[Part, ...]) -> np.ndarray:
    points = np.vstack([part.mesh.vertices for part in parts])
    return np.array([points.min(axis=0), points.max(axis=0)])


def pinocchio_bounds(path: Path, scale: list[float]) -> np.ndarray:
    """What Pinocchio's own reader of meshes finds."""
    mesh = coal.MeshLoader().load(str(path), np.array(scale))
    mesh.computeLocalAABB()
    return np.array([mesh.aabb_local.min_, mesh.aabb_local.max_]).reshape(2, 3)


def saved(mesh: trimesh.Trimesh, path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    mesh.export(path)
    return path


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: f"{path.parts[-4]}-{path.stem}")
def test_real_arms_have_the_bounds_that_pinocchio_finds(path: Path) -> None:
    """All nodes of the file in their places, in metres, scaled axis by axis."""
    scale = [0.5, 2.0, 3.0]
    parts = read_mesh(path, scale)
    np.testing.assert_allclose(bounds(parts), pinocchio_bounds(path, scale), atol=1e-6)
    assert len({part.colour for part in parts}) == len(parts)


def test_the_unit_of_a_file_counts_and_its_upward_axis_does_not(tmp_path: Path) -> None:
    """As in RViz and Pinocchio: a URDF refers to the axes of the file."""
    text = EXAMPLES[0].read_text().replace("Z_UP", "Y_UP")
    text = text.replace('meter="1"', 'meter="0.01"')
    copy = tmp_path / "copy.dae"
    copy.write_text(text)
    np.testing.assert_allclose(bounds(read_mesh(copy)), 0.01 * bounds(read_mesh(EXAMPLES[0])))


def test_a_mirrored_mesh_still_looks_outwards(tmp_path: Path) -> None:
    (ball,) = read_mesh(saved(trimesh.creation.icosphere(2), tmp_path / "ball.stl"), [-1, 1, 1])
    a, b, c = np.moveaxis(ball.mesh.vertices[ball.mesh.faces], 1, 0)
    assert (np.einsum("fi,fi->f", np.cross(b - a, c - a), a + b + c) > 0.0).all()


def test_the_parts_of_a_scene_stand_where_its_nodes_put_them(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    for place, colour in ((0.0, [9, 9, 9, 255]), (5.0, [9, 9, 9, 255]), (8.0, [255, 0, 0, 255])):
        box = trimesh.creation.box((1, 1, 1))
        material = trimesh.visual.material.PBRMaterial(baseColorFactor=colour)
        box.visual = trimesh.visual.TextureVisuals(material=material)
        scene.add_geometry(box, transform=trimesh.transformations.translation_matrix([place, 0, 0]))
    scene.export(tmp_path / "boxes.glb")
    red, grey = sorted(read_mesh(tmp_path / "boxes.glb"), key=lambda part: -part.colour[0])
    assert red.colour == (1.0, 0.0, 0.0, 1.0)
    np.testing.assert_allclose(bounds((grey,))[:, 0], [-0.5, 5.5])
    np.testing.assert_allclose(bounds((red,))[:, 0], [7.5, 8.5])


@pytest.mark.parametrize("content", [b"", b"\x00" * 200, b"<COLLADA/>"])
@pytest.mark.parametrize("suffix", ["stl", "dae", "glb", "xyz1"])
def test_a_file_that_is_no_mesh_is_refused_with_a_reason(tmp_path, suffix, content):
    path = tmp_path / f"broken.{suffix}"
    path.write_bytes(content)
    with pytest.raises(MeshFileError) as caught:
        read_mesh(path)
    assert len(str(caught.value).splitlines()) == 1


def collada(nodes: str) -> str:
    """A triangle ``#g`` and library nodes, ``#n0`` in the scene."""
    return f"""<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
      <asset><unit meter="1"/></asset><library_geometries><geometry id="g"><mesh><source id="p">
      <float_array id="a" count="9">0 0 0 1 0 0 0 1 0</float_array><technique_common>
      <accessor source="#a" count="3" stride="3"><param name="X" type="float"/>
      <param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common>
      </source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
      <triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p>
      </triangles></mesh></geometry></library_geometries><library_nodes>{nodes}</library_nodes>
      <library_visual_scenes><visual_scene id="s"><node><instance_node url="#n0"/></node>
      </visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene>
      </COLLADA>"""


def doubled(levels: int) -> str:
    """Library nodes each of which has the next one twice."""
    twice = '<node id="n{}"><instance_node url="#n{}"/><instance_node url="#n{}"/></node>'
    nodes = [twice.format(k, k + 1, k + 1) for k in range(levels)]
    return "".join(nodes) + f'<node id="n{levels}"><instance_geometry url="#g"/></node>'


def gltf(nodes: list[dict[str, Any]], primitives: int = 1, count: int = 3) -> str:
    """A mesh whose primitives share one triangle, in nodes of which the first is in the scene."""
    triangle = base64.b64encode(np.eye(3, dtype=np.float32).tobytes()).decode()
    uri = f"data:application/octet-stream;base64,{triangle}"
    accessor = {"componentType": 5126, "count": count, "type": "VEC3"}
    return json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}] * primitives}],
        "accessors": [accessor | ({"bufferView": 0} if count == 3 else {})],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": uri}],
    })  # fmt: skip


CHAIN = [{"mesh": 0, "children": [k + 1]} for k in range(200)] + [{"mesh": 0}]


@pytest.mark.parametrize(
    ("suffix", "text"),
    [
        ("dae", collada(doubled(26))),
        ("gltf", gltf(CHAIN)),
        ("gltf", gltf([{"mesh": 0}], count=10**9)),
    ],
    ids=["doubled nodes", "nested nodes", "vertices without data"],
)
def test_a_small_file_that_expands_is_refused_at_once(tmp_path, suffix, text):
    path = tmp_path / f"small.{suffix}"
    path.write_text(text)
    begin = time.process_time()
    with pytest.raises(MeshFileError, match="more than"):
        read_mesh(path)
    assert time.process_time() - begin < 10.0


@pytest.mark.parametrize(
    ("suffix", "text"),
    [("dae", collada(doubled(3))), ("gltf", gltf([{"mesh": 0, "children": [1]}, {"mesh": 0}]))],
)
def test_instances_of_nodes_are_read(tmp_path: Path, suffix: str, text: str) -> None:
    path = tmp_path / f"nested.{suffix}"
    path.write_text(text)
    assert read_mesh(path)


@pytest.fixture
def box(tmp_path: Path) -> Path:
    """``tmp/kit/meshes/a box.stl``."""
    return saved(trimesh.creation.box((1, 1, 1)), tmp_path / "kit" / "meshes" / "a box.stl")


def test_names_are_relative_to_the_folder_of_the_urdf(box, tmp_path, monkeypatch):
    urdf = tmp_path / "kit" / "urdf" / "arm.urdf"
    urdf.parent.mkdir()
    assert find_mesh("../meshes/a box.stl", str(urdf)).samefile(box)
    assert find_mesh(str(box), str(urdf)) == box
    assert find_mesh(box.as_uri(), str(urdf)) == box
    odd = box.rename(box.with_name("a%20#b?c.stl"))
    for name in ("package://kit/meshes/a%20#b?c.stl", f"file://{odd}"):
        assert find_mesh(name, str(urdf)) == odd
    odd.rename(box)
    monkeypatch.chdir(tmp_path / "kit")
    assert find_mesh("../meshes/a box.stl", "urdf/arm.urdf").samefile(box)


@pytest.mark.parametrize(
    "name", ["package://kit/meshes/a box.stl", "model://kit/meshes/a%20box.stl"]
)
def test_packages_are_found_by_folder_and_by_environment(name, box, tmp_path, monkeypatch):
    """Above the URDF; in a folder of packages or a package itself; installed under a prefix."""
    for variable in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(variable, raising=False)
    assert find_mesh(name, str(tmp_path / "kit" / "urdf" / "arm.urdf")) == box
    assert find_mesh(name, str(tmp_path / "other" / "arm.urdf")) == box
    far = "/nowhere/arm.urdf"
    with pytest.raises(MeshFileError):
        find_mesh(name, far)
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"/nowhere:{tmp_path}")
    assert find_mesh(name, far) == box
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "kit"))
    assert find_mesh(name, far) == box
    monkeypatch.delenv("ROS_PACKAGE_PATH")
    installed = saved(trimesh.creation.box((1, 1, 1)), tmp_path / "p/share/kit/meshes/a box.stl")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "p"))
    assert find_mesh(name, far) == installed


@pytest.mark.parametrize(
    "name", ["http://a.b/c.stl", "gone.stl", "file:///gone.stl", "a\0b", "x" * 9999]
)
def test_missing_mesh_files_are_refused(name: str) -> None:
    """Nothing is fetched from the net, no name is too odd."""
    with pytest.raises(MeshFileError):
        find_mesh(name, "/nowhere/arm.urdf")
