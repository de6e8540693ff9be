"""Errors and warnings about URDFs: severity, line and element; none about valid ones."""

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from hypothesis import given
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.errors import ModelError
from freefloat.robot.description import Severity
from freefloat.robot.named_files import example_robots, models_folder
from freefloat.robot.validation import examine, read_urdf
from tests.broken_robots import BUS, FAULTS, LIMIT, UPPER, VALID, link
from tests.commands import document, run
from tests.errors import error_key
from tests.robot.test_urdf import one_joint
from tests.robots import Robot, inertial_text, robots

Diagnosis = tuple[str, int | None, str]


def written(folder: Path, text: str) -> Path:
    path = folder / "robot.urdf"
    path.write_text(text, encoding="utf-8")
    return path


def diagnosed(urdf: str | Path, mounted: bool = False) -> list[Diagnosis]:
    return [(str(entry.severity), entry.line, entry.element) for entry in examine(urdf, mounted)]


def elements(urdf: str | Path) -> list[str]:
    return [element for _, _, element in diagnosed(urdf)]


def test_nothing_is_reported_about_a_valid_robot() -> None:
    """Also where the centre of mass of a link is beside its joint, far from it."""
    assert examine(VALID) == ()
    assert examine(VALID.replace(UPPER, link("upper", "10", "0 0.3 0", "0.1 0.9 0.9"))) == ()


@pytest.mark.parametrize("fault", FAULTS.values(), ids=FAULTS)
def test_a_fault_is_reported_first_and_refused_or_kept_as_a_warning(fault, tmp_path):
    path = written(tmp_path, fault.text)
    first, *_ = diagnostics = examine(path)
    assert diagnosed(path)[0] == fault.diagnosis
    assert all(entry.file == str(path) for entry in diagnostics)
    if first.severity is Severity.ERROR:
        with pytest.raises(ModelError) as caught:
            ff.FreeFloatingModel.from_urdf(path)
        assert (caught.value.key, caught.value.problem) == (first.element, first.problem)
        assert (caught.value.source, caught.value.line) == (str(path), first.line)
    else:
        warnings = ff.FreeFloatingModel.from_urdf(path).warnings
        assert warnings == tuple(entry for entry in diagnostics if "mesh" not in entry.problem)


def test_a_centre_of_mass_in_millimetres_is_named_as_such() -> None:
    shape = '<visual><geometry><box size="1 0.1 0.1"/></geometry></visual>'
    upper = link("upper", "10", "500 0 0", "0.1 0.9 0.9", shape)
    (warning,) = examine(VALID.replace(UPPER, upper))
    assert "centre of mass is 500 m" in warning.problem
    assert "<origin>" in warning.remedy


def test_a_prismatic_joint_without_range_is_reported_once() -> None:
    text = VALID.replace('"shoulder" type="revolute"', '"shoulder" type="prismatic"')
    assert [s for s, _, _ in diagnosed(text.replace(LIMIT, "", 1))] == ["error"]


def test_info_shows_warnings_before_it_refuses(tmp_path: Path) -> None:
    refused = run("info", written(tmp_path, FAULTS["a massless root"].text), "--end-effector", "no")
    assert refused.exit_code == 2
    assert "no mass" in refused.stdout
    assert "end_effector" in refused.stderr


def test_info_shows_ranges_with_one_end(tmp_path: Path) -> None:
    text = VALID.replace('lower="-2"', 'lower="-1e9"', 1)
    text = text.replace('lower="-2" upper="2"', 'lower="-2" upper="1e9"')
    shown = run("info", written(tmp_path, text)).stdout
    assert "at most 114.6°" in shown
    assert "at least -114.6°" in shown


def test_an_arm_without_mass_needs_a_spacecraft() -> None:
    text = re.sub(r"<inertial>.*?</inertial>", "", VALID, flags=re.DOTALL)
    assert ("error", 4, "robot servicer") in diagnosed(text)
    assert {severity for severity, _, _ in diagnosed(text, mounted=True)} == {"warning"}


def test_a_robot_without_inertia_is_refused() -> None:
    """Two links of the three are points, on the axis of the only moment."""
    text = re.sub(r"<inertial>.*?</inertial>", "", VALID, flags=re.DOTALL)
    flat = inertial_text(10.0, np.diag([0.0, 0.0, 1.0]))
    text = re.sub(r'<link name="bus">', lambda match: match[0] + flat, text)
    assert ff.FreeFloatingModel.from_urdf(text).total_mass == 10.0  # planar joints: a flat body
    text = text.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 1 0"/>', 1)
    assert error_key(ff.FreeFloatingModel.from_urdf, text) == "robot"


def test_a_root_link_without_mass_is_valid_where_something_massive_is_fixed_to_it() -> None:
    ground = '<link name="world"/>\n  <joint name="weld" type="fixed"><parent link="world"/>'
    ground += '<child link="bus"/></joint>\n  <link name="bus">'
    assert diagnosed(VALID.replace('<link name="bus">', ground)) == []
    bare = VALID.replace(BUS.strip(), '<link name="bus"/>')
    assert diagnosed(bare, mounted=True) == []


@pytest.mark.parametrize(("factor", "count"), [(0.98, 0), (1.02, 1)])
def test_gyration_radii_up_to_three_times_the_extent_are_accepted(factor, count):
    """The upper link reaches half a metre from its centre of mass."""
    moment = 10.0 * (3.0 * 0.5 * factor) ** 2
    text = VALID.replace('iyy="0.9"', f'iyy="{moment!r}"').replace('ixx="0.1"', 'ixx="22"', 1)
    assert len(examine(text.replace('izz="0.9"', 'izz="20"'))) == count


@given(robot=robots())
def test_inertias_of_rigid_bodies_are_accepted_in_any_frame(robot: Robot) -> None:
    problems = " ".join(entry.problem for entry in read_urdf(robot.text).warnings)
    for word in ("definite", "triangle", "no mass", "range", "length"):
        assert word not in problems


def test_the_triangle_inequality_holds_up_to_flat_plates() -> None:
    R = Rotation.from_euler("xyz", [0.4, 0.5, 0.6]).as_matrix()
    for axes in (np.eye(3), R):
        for largest, found in ((3.1, ["link arm"]), (3.0, [])):
            inertial = inertial_text(5.0, axes @ np.diag([1.0, 2.0, largest]) @ axes.T)
            assert elements(one_joint(inertial)) == found


EXPECTED = {
    "planar_3dof": ["link link_3"],  # 1.5 kg m² of 1 kg: Table I
    "spatial_6dof": ["link link_3"],  # 0.001, 1.7, 7.5: Table II
    # wrists of the real arm have a radius of 0.06 m, their inertias are those of 0.6 m
    "ur5": [*(f"link wrist_{k}_link" for k in (1, 2, 3)), "link world"],
    # feet of arms, which no spacecraft carries
    "panda": ["link panda_link0"], "kinova": ["link base"], "z1": ["link world"],
}  # fmt: skip


@pytest.mark.parametrize("name", EXPECTED)
def test_warnings_about_real_robots_are_true(name: str) -> None:
    bundled = {path.stem: path for path in models_folder().glob("*/*.urdf")}
    assert elements((bundled | example_robots())[name]) == EXPECTED[name]


@pytest.mark.parametrize(
    ("mass", "moments", "shape"),
    [("450000", "450 450 450", ""), ("450", "450000 450000 450000", ""), ("450", "4 4 4", ""),
     ("450", "14 14 14", '<box size="4 4 4"/>'),
     ("450", "15000 15000 15000", '<box size="2 2 2"/>')],
    ids=["tonnes", "as of tonnes", "steel", "small for its size", "large for its size"],
)  # fmt: skip
def test_an_inertia_that_does_not_fit_the_mass_is_reported(mass, moments, shape):
    visual = f"\n<visual><geometry>{shape}</geometry></visual>" if shape else ""
    text = VALID.replace(BUS, link("bus", mass, "0 0 0", moments, visual))
    assert elements(text) == ["link bus"]
    size = None if not shape else np.array(shape.split('"')[1].split(), dtype=float)
    spacecraft = ff.Spacecraft(float(mass), np.array(moments.split(), dtype=float), size=size)
    model = ff.FreeFloatingModel.from_urdf(VALID, "hand", spacecraft=spacecraft)
    assert [entry.element for entry in model.warnings] == ["link bus", "link spacecraft"]


@pytest.mark.parametrize(("mass", "moment"), [(450_000.0, 1.5e8), (4.0, 0.007)])
def test_inertias_of_spacecraft_are_plausible(mass: float, moment: float) -> None:
    """The Space Station, a CubeSat."""
    spacecraft = ff.Spacecraft(mass, moment * np.ones(3))
    model = ff.FreeFloatingModel.from_urdf(VALID, "hand", spacecraft=spacecraft)
    assert [entry.element for entry in model.warnings] == ["link bus"]  # a spacecraft already


def test_each_missing_mesh_is_reported_once(tmp_path: Path) -> None:
    """However many shapes name it; those of one package take two lines in all."""
    shapes = "".join(
        f'\n<{kind}><geometry><mesh filename="package://gone/{name}"/></geometry></{kind}>'
        for name in ("bus.stl", "plate.stl", "bus.stl") for kind in ("visual", "collision")
    )  # fmt: skip
    text = VALID.replace(BUS, link("bus", "300", "0 0 0", "50 50 50", shapes))
    missing = examine(written(tmp_path, text))
    assert [entry.problem.count("/bus.stl") for entry in missing] == [1, 0]
    assert len({entry.remedy for entry in missing}) == 1
    shown = run("info", written(tmp_path, text)).stdout
    assert "2 warnings" in shown
    assert "plate.stl" not in shown


@pytest.mark.slow
def test_collision_meshes_that_cannot_be_used_are_reported(tmp_path: Path) -> None:
    """Each once, however many shapes name it; also those of attached robots."""
    box = trimesh.creation.box().export(file_type="stl")
    pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 684\n"
    contents = {
        "pointer": pointer, "empty": b"", "cut": box[:150], "zeros": bytes(len(box)),
        "not_numbers": box[:84] + b"\xff" * (len(box) - 84), "flattened": box, "sound": box,
    }  # fmt: skip
    shapes = ""
    for name, content in contents.items():
        (tmp_path / f"{name}.stl").write_bytes(content)
        scale = "0 0 0" if name == "flattened" else "-1 1 1"
        shapes += 2 * (f'\n<collision><geometry><mesh filename="{name}.stl" scale="{scale}"/>'
                       "</geometry></collision>")  # fmt: skip
    text = VALID.replace(BUS, link("bus", "300", "0 0 0", "50 50 50", shapes))
    path = written(tmp_path, text)
    attached = {"urdf": path.name, "prefix": "tool_"}
    robot = {"urdf": "planar_2dof", "end_effector": "end_effector", "attached": [attached]}
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text(yaml.safe_dump({"robot": robot, "goal": {"joints": [0.5, 0.5]}}))
    lines = text.splitlines()
    for file in (path, scenario):
        found = document("info", file)["findings"]
        assert {entry["element"] for entry in found} == {"link bus"}
        shown = [re.findall(r'"(\w+)\.stl"', lines[entry["line"] - 1])[0] for entry in found]
        assert shown == [name for name in contents if name != "sound"]
        assert {entry["file"] for entry in found} == {str(path)}
