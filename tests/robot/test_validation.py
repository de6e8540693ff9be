"""Errors and warnings about URDFs: severity, line and element; none about valid ones."""

from __future__ import annotations

import copy
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.errors import ModelError
from freefloat.robot.description import Severity
from freefloat.robot.names import models_folder
from freefloat.robot.robot_packages import example_robots
from freefloat.robot.validation import examine, read_urdf
from tests.broken_robots import BUS, FAULTS, HAND, UPPER, VALID, WRIST, Fault, joint, link
from tests.errors import error_key
from tests.robots import Robot, inertial_text, joint_text, link_text, robots

Diagnosis = tuple[str, int, str]


def written(folder: Path, text: str) -> Path:
    path = folder / "robot.urdf"
    path.write_text(text, encoding="utf-8")
    return path


def diagnosed(urdf: str | Path, mounted: bool = False) -> list[Diagnosis]:
    return [(str(entry.severity), entry.line, entry.element) for entry in examine(urdf, mounted)]


def elements(urdf: str | Path) -> list[str]:
    return [element for _, _, element in diagnosed(urdf)]


def test_nothing_is_reported_about_a_valid_robot() -> None:
    assert examine(VALID) == ()


@pytest.mark.parametrize("fault", FAULTS.values(), ids=FAULTS)
def test_a_fault_is_reported_first_and_refused_or_kept_as_a_warning(
    fault: Fault, tmp_path: Path
) -> None:
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


def test_an_arm_without_mass_needs_a_spacecraft() -> None:
    text = re.sub(r"<inertial>.*?</inertial>", "", VALID, flags=re.DOTALL)
    assert ("error", 1, "robot servicer") in diagnosed(text)
    assert {severity for severity, _, _ in diagnosed(text, mounted=True)} == {"warning"}


def test_a_robot_without_inertia_is_refused() -> None:
    """Two links of the three are points, on the axis of the only moment."""
    text = re.sub(r"<inertial>.*?</inertial>", "", VALID, flags=re.DOTALL)
    flat = inertial_text(10.0, np.diag([0.0, 0.0, 1.0]))
    text = re.sub(r'<link name="bus">', lambda match: match[0] + flat, text)
    assert ff.FreeFloatingModel.from_urdf(text).total_mass == 10.0  # planar joints: a flat body
    text = text.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 1 0"/>', 1)
    assert error_key(ff.FreeFloatingModel.from_urdf, text) == "robot"


def test_all_faults_are_reported_at_once_errors_first() -> None:
    text = VALID.replace('value="10"', 'value="ten"').replace('xyz="0 0 1"', 'xyz="0 0 2"', 1)
    text = text.replace('ixx="0.1" ixy="0" ixz="0"\n               iyy="0.7"',
                        'ixx="9" ixy="0" ixz="0"\n               iyy="0.7"')  # fmt: skip
    assert [(severity, element) for severity, _, element in diagnosed(text)] == [
        ("error", "link upper"),
        ("warning", "joint shoulder"),
        ("warning", "link lower"),
    ]


def test_a_root_link_without_mass_is_valid_where_something_massive_is_fixed_to_it() -> None:
    ground = '<link name="world"/>\n  <joint name="weld" type="fixed"><parent link="world"/>'
    ground += '<child link="bus"/></joint>\n  <link name="bus">'
    assert diagnosed(VALID.replace('<link name="bus">', ground)) == []
    bare = VALID.replace(BUS.strip(), '<link name="bus"/>')
    assert diagnosed(bare, mounted=True) == []


# --------------------------------------------------------------------------- inertias


@pytest.mark.parametrize(("factor", "count"), [(0.98, 0), (1.02, 1)])
def test_gyration_radii_up_to_three_times_the_extent_are_accepted(
    factor: float, count: int
) -> None:
    """The upper link reaches half a metre from its centre of mass."""
    moment = 10.0 * (3.0 * 0.5 * factor) ** 2
    text = VALID.replace('iyy="0.9"', f'iyy="{moment!r}"').replace('ixx="0.1"', 'ixx="22"', 1)
    assert len(examine(text.replace('izz="0.9"', 'izz="20"'))) == count


def test_vanishing_masses_are_reported_without_overflow() -> None:
    """Their gyration radius is 1e154 m and more."""
    assert "link upper" in elements(VALID.replace('<mass value="10"/>', '<mass value="1e-310"/>'))


def test_shapes_count_for_the_extent_of_a_link() -> None:
    """A boom of 8 m explains the moments."""
    text = VALID.replace('iyy="0.9"', 'iyy="40"').replace('izz="0.9"', 'izz="40"')
    shape = '<visual><geometry><cylinder radius="0.1" length="8"/></geometry></visual>'
    assert len(examine(text)) == 1
    assert examine(text.replace("</inertial>", f"</inertial>{shape}")) == ()


@pytest.mark.parametrize(("moment", "count"), [("150", 0), ("170", 1)])
def test_a_last_link_reaches_back_to_the_joint_before(moment: str, count: int) -> None:
    """1.5 m from its centre of mass, 8 kg: three times that is a moment of 162 kg m²."""
    text = VALID.replace(WRIST, "").replace(HAND, "")
    text = text.replace('izz="0.7"', f'izz="{moment}"').replace('iyy="0.7"', f'iyy="{moment}"')
    assert elements(text) == count * ["link lower"]


@pytest.mark.parametrize(("offset", "count"), [("0.5 0.2 0", 0), ("0.01 0.2 0", 1)])
def test_the_mass_of_a_long_link_may_be_in_a_part_fixed_to_it(offset: str, count: int) -> None:
    """The warning is about the part with the mass, and its correction in the part's frame."""
    part = link("part", "10", "0 0 0", "0.9 0.9 0.9").lstrip()
    weld = joint("weld", "fixed", "upper part", offset).replace('rpy="0 0 0"', 'rpy="0 0 1.57"')
    text = VALID.replace(UPPER, f'{weld}\n  <link name="upper"/>\n  {part}')
    assert elements(text) == count * ["link part"]
    for diagnostic in examine(text):
        origin = re.search(r'<origin xyz="([^"]*)"/>', diagnostic.remedy)
        assert origin is not None
        middle = [float(word) for word in origin[1].split()]
        assert np.allclose(middle, [-0.2, -0.49, 0], atol=1e-3)


@pytest.mark.parametrize(("kind", "count"), [("revolute", 1), ("prismatic", 0)])
def test_a_centre_of_mass_may_be_on_a_prismatic_next_joint(kind: str, count: int) -> None:
    text = VALID.replace(UPPER, UPPER.replace('xyz="0.5 0 0"', 'xyz="1 0 0"'))
    text = text.replace('"elbow" type="revolute"', f'"elbow" type="{kind}"')
    assert elements(text) == count * ["link upper"]


@pytest.mark.parametrize(("length", "expected"), [("0.2", []), ("0.6", ["link upper"])])
def test_a_centre_of_mass_may_be_on_the_joint_of_a_short_link(
    length: str, expected: list[str]
) -> None:
    """0.2 of an arm of 1.2 m is a short link with a motor in its joint, 0.6 of 1.6 m is not."""
    after = '<child link="lower"/>\n    <origin xyz='
    text = VALID.replace(f'{after}"1 0 0"', f'{after}"{length} 0 0"')
    at = '<origin xyz="0.5 0 0" rpy="0 0 0"/>\n      <mass value="10"/>'
    text = text.replace(at, '<mass value="10"/>').replace('iyy="0.9"', 'iyy="0.1"')
    assert elements(text.replace('izz="0.9"', 'izz="0.1"')) == expected


@given(robot=robots())
def test_inertias_of_rigid_bodies_are_accepted_in_any_frame(robot: Robot) -> None:
    problems = " ".join(entry.problem for entry in read_urdf(robot.text).warnings)
    for word in ("definite", "triangle", "no mass", "range", "length"):
        assert word not in problems


def one_joint(inertia: np.ndarray) -> str:
    arm = link_text("arm", inertial_text(5.0, inertia)) + joint_text("q", "C", "bus", "arm")
    return f"<robot name='r'>{link_text('bus', inertial_text(9.0, np.eye(3)))}{arm}</robot>"


def test_the_triangle_inequality_holds_up_to_flat_plates() -> None:
    R = Rotation.from_euler("xyz", [0.4, 0.5, 0.6]).as_matrix()
    for axes in (np.eye(3), R):
        assert elements(one_joint(axes @ np.diag([1.0, 2, 3.1]) @ axes.T)) == ["link arm"]
        assert elements(one_joint(axes @ np.diag([1.0, 2, 3.0]) @ axes.T)) == []


@pytest.mark.parametrize(
    "matrix", [[[1, 2, 0], [2, 1, 0], [0, 0, 2]], np.diag([1, 1, -1]), np.diag([0, 1, 1])]
)
def test_inertias_that_are_not_positive_definite_are_reported(matrix: np.ndarray) -> None:
    assert elements(one_joint(np.array(matrix, dtype=float))) == ["link arm"]


def test_moments_that_are_rounding_errors_are_zero() -> None:
    (warning,) = read_urdf(one_joint(np.diag([-1e-19, 1e-18, 3e-18]))).warnings
    assert "0, 0, 0" in warning.problem


# --------------------------------------------------------------------------- any URDF


@st.composite
def spoilt(draw: st.DrawFn) -> str:
    """A valid robot with a few elements or attributes removed, doubled or overwritten."""
    root = ET.fromstring(VALID)
    for _ in range(draw(st.integers(1, 3))):
        parents = [element for element in root.iter() if len(element)]
        parent = draw(st.sampled_from(parents))
        element = draw(st.sampled_from(list(parent)))
        change = draw(st.sampled_from(["remove", "double", "overwrite", "forget"]))
        if change == "remove" and (len(parents) > 1 or len(parent) > 1):
            parent.remove(element)
        elif change == "double":
            parent.append(copy.deepcopy(element))
        elif element.attrib:
            key = draw(st.sampled_from(sorted(element.attrib)))
            if change == "forget":
                del element.attrib[key]
            else:
                junk = ["", "0", "-1", "nan", "pi", "1 2 3", "bus", "upper", "revolute", "fixed"]
                element.set(key, draw(st.sampled_from(junk)))
    return ET.tostring(root, encoding="unicode")


@given(text=spoilt())
def test_a_spoilt_robot_has_an_error_or_can_be_built(text: str) -> None:
    diagnostics = examine(text)
    if any(entry.severity is Severity.ERROR for entry in diagnostics):
        with pytest.raises(ModelError) as caught:
            read_urdf(text)
        assert caught.value.problem == diagnostics[0].problem
    else:
        key = "end_effector"
        try:
            ff.FreeFloatingModel.from_urdf(text)
        except ModelError as error:  # no arm, or several
            key = error.key
        assert key == "end_effector"


EXPECTED = {
    "planar_3dof": ["link link_3"],  # 1.5 kg m² of 1 kg: Table I
    "spatial_6dof": ["link link_3"],  # 0.001, 1.7, 7.5: Table II
    "panda": ["joint panda_finger_joint2"],  # a mimic
    # wrists of the real arm have a radius of 0.06 m, their inertias are those of 0.6 m
    "ur5": [f"link wrist_{k}_link" for k in (1, 2, 3)],
}


@pytest.mark.parametrize(
    "name",
    ["planar_3dof", "spatial_6dof", "ur3", "ur5", "ur10", "panda", "kinova", "xarm7", "z1"],
)
def test_warnings_about_real_robots_are_true(name: str) -> None:
    bundled = {path.stem: path for path in models_folder().glob("*/*.urdf")}
    assert elements((bundled | example_robots())[name]) == EXPECTED.get(name, [])
