"""Visuals of URDF files in place, and default shapes for bodies without visuals."""

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import trimesh

import freefloat as ff
from freefloat.robot.meshes import Mesh
from freefloat.robot.named_files import examples_folder, find_robot
from freefloat.visualization.scenes.visuals import Visual, Visuals, robot_visuals
from tests.robots import inertial_text, joint_text, link_text


def named(visuals: Visuals, name: str) -> Visual:
    (match,) = [visual for visual in visuals.shapes if visual.name == name]
    return match


def link_visuals(visuals: Visuals, link: str) -> list[Visual]:
    return [item for item in visuals.shapes if re.fullmatch(rf"{link}( \d+)?", item.name)]


def two_links(visual: str, head: str = "") -> str:
    """A spacecraft with an arm of one link that has these visuals."""
    return (
        f"<robot name='r'>{head}{link_text('bus', inertial_text(100.0, 10.0 * np.eye(3)))}"
        f"{link_text('arm', inertial_text(5.0, np.eye(3)) + visual)}{link_text('tip')}"
        + joint_text("q", "R", "bus", "arm", "0.5 0 0", axis="0 1 0")
        + joint_text("end", "F", "arm", "tip", "0 0 2")
        + "</robot>"
    )


@pytest.mark.slow
@pytest.mark.parametrize(("name", "end_effector"), [("ur5", "tool0"), ("panda", "panda_hand")])
def test_meshes_of_real_arms_are_where_pinocchio_draws_them(name: str, end_effector: str) -> None:
    """Bounds of every body at zero joints, in metres, against Pinocchio's geometry model."""
    path = find_robot(f"example-robot-data:{name}", Path())
    model = ff.FreeFloatingModel.from_urdf(path, end_effector)
    visuals = robot_visuals(model)
    assert visuals.problems == ()
    whole = pin.buildModelFromUrdf(str(path))
    shown = pin.buildGeomFromUrdf(whole, str(path), pin.GeometryType.VISUAL,
                                  package_dirs=[str(examples_folder().parents[1])])  # fmt: skip
    data, geometry = whole.createData(), shown.createData()
    pin.forwardKinematics(whole, data, pin.neutral(whole))
    pin.updateGeometryPlacements(whole, data, shown, geometry)
    joints = np.zeros(model.dof)
    poses = model.body_poses([0, 0, 0, 1], joints)
    for index, item in enumerate(shown.geometryObjects):
        link = item.name.rsplit("_", 1)[0]
        shapes = [(poses[v.body] @ v.placement, v.shape) for v in link_visuals(visuals, link)]
        points = np.vstack([m.vertices @ at.rotation.T + at.position for at, m in shapes])
        points -= poses[0].position
        placed = geometry.oMg[index]
        expected = item.geometry.vertices() @ placed.rotation.T + placed.translation
        np.testing.assert_allclose(points.min(axis=0), expected.min(axis=0), atol=1e-5)
        np.testing.assert_allclose(points.max(axis=0), expected.max(axis=0), atol=1e-5)
    faces = sum(len(v.shape.faces) for v in visuals.shapes if isinstance(v.shape, Mesh))
    assert 50_000 < faces < 200_000  # a few megabytes, no need to thin them out


RED = "<material name='paint'><color rgba='1 0 0 1'/></material>"
BOX = "<geometry><box size='1 2 3'/></geometry>"


def test_a_capsule_is_drawn_with_its_half_spheres() -> None:
    """Outward triangles, all points at the radius from its segment, of the colour of the URDF."""
    geometry = "<geometry><capsule radius='0.2' length='1.5'/></geometry>"
    text = two_links(f"<visual><origin xyz='1 0 0'/>{geometry}{RED}</visual>")
    model = ff.FreeFloatingModel.from_urdf(text.replace("<robot", "<robot version='1.1'"), "tip")
    visual = named(robot_visuals(model), "arm")
    assert isinstance(visual.shape, Mesh)
    x, y, z = visual.shape.vertices.T
    radii = np.hypot(np.hypot(x, y), np.maximum(np.abs(z) - 0.75, 0.0))
    np.testing.assert_allclose(radii, 0.2, atol=1e-9)
    assert (z.min(), z.max()) == pytest.approx((-0.95, 0.95))
    solid = trimesh.Trimesh(visual.shape.vertices, visual.shape.faces)
    assert solid.volume == pytest.approx(np.pi * 0.04 * (1.5 + 0.8 / 3.0), rel=0.03)
    assert visual.colour == (1.0, 0.0, 0.0, 1.0)


def test_a_relative_mesh_takes_place_scale_and_colour_from_the_urdf(tmp_path: Path) -> None:
    """The STL file has no colour; a mesh with colours keeps them."""
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.stl")
    visual = (
        "<visual><origin xyz='1 0 0' rpy='0 0 1.5707963267948966'/><geometry>"
        f"<mesh filename='box.stl' scale='1 2 3'/></geometry>{RED}</visual>"
    )
    (tmp_path / "arm.urdf").write_text(two_links(visual))
    arm = named(robot_visuals(ff.FreeFloatingModel.from_urdf(tmp_path / "arm.urdf")), "arm")
    assert arm.colour == (1.0, 0.0, 0.0, 1.0)
    np.testing.assert_allclose(arm.shape.vertices.max(axis=0), [0.5, 1.0, 1.5])
    np.testing.assert_allclose(arm.placement.position, [1, 0, 0])
    np.testing.assert_allclose(arm.placement.rotation @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    dae = (examples_folder() / "ur_description/meshes/ur5/visual/base.dae").as_uri()
    painted = f"<visual><geometry><mesh filename='{dae}'/></geometry>{RED}</visual>"
    visuals = robot_visuals(ff.FreeFloatingModel.from_urdf(two_links(painted)))
    assert (1.0, 0.0, 0.0, 1.0) not in {item.colour for item in link_visuals(visuals, "arm")}


def test_a_missing_mesh_is_reported_and_replaced(tmp_path: Path) -> None:
    """By a rod from the joint to the end, unless there are other visuals or collision shapes."""
    visual = "<visual><geometry><mesh filename='gone.stl'/></geometry></visual>"
    (tmp_path / "arm.urdf").write_text(two_links(visual))
    visuals = robot_visuals(ff.FreeFloatingModel.from_urdf(tmp_path / "arm.urdf"))
    assert len(visuals.problems) == 1
    (rod,) = link_visuals(visuals, "arm")
    assert isinstance(rod.shape, ff.Cylinder)
    for shapes in (f"<visual>{BOX}</visual>" + visual, f"<collision>{BOX}</collision>"):
        others = robot_visuals(ff.FreeFloatingModel.from_urdf(two_links(shapes)))
        assert isinstance(named(others, "arm").shape, ff.Box)
