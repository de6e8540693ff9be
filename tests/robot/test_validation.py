"""Every defect and doubt of broken URDFs by name, line and remedy; silence about sound ones."""

from __future__ import annotations

import copy
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from freefloat.errors import ModelError
from freefloat.robot.diagnostics import Severity, UrdfDiagnostic
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.names import example_robots, models_folder
from freefloat.robot.urdf import read_urdf
from freefloat.robot.urdf_numbers import value_of
from freefloat.robot.validation import examine
from tests.broken_robots import (
    HAND,
    PATIENTS,
    SOUND,
    UPPER,
    WRIST,
    Ill,
    Patient,
    joint,
    link,
)

WELL = [patient for patient in PATIENTS.values() if len(patient.ills) > 1]
ILLS = {
    f"{name}: {ill.element} {number}": (patient, ill)
    for name, patient in PATIENTS.items()
    for number, ill in enumerate(patient.ills, 1)
}
every_patient = pytest.mark.parametrize("patient", PATIENTS.values(), ids=PATIENTS)
every_ill = pytest.mark.parametrize(("patient", "ill"), ILLS.values(), ids=ILLS)


def written(folder: Path, text: str) -> Path:
    path = folder / "patient.urdf"
    path.write_text(text, encoding="utf-8")
    return path


def complaints(urdf: Path, carried: bool = False) -> list[UrdfDiagnostic]:
    """What is worse than a note."""
    return [one for one in examine(urdf, carried) if one.severity != Severity.NOTE]


def is_about(ill: Ill, finding: UrdfDiagnostic) -> bool:
    return finding.element == ill.element and ill.problem in finding.problem


def test_there_are_fifteen_broken_urdfs_and_more() -> None:
    assert len(PATIENTS) >= 15
    assert len({patient.text for patient in PATIENTS.values()}) == len(PATIENTS)


def test_nothing_is_said_of_a_sound_robot(tmp_path: Path) -> None:
    assert examine(written(tmp_path, SOUND)) == ()


@every_ill
def test_every_ill_is_told_with_file_line_element_and_remedy(
    patient: Patient, ill: Ill, tmp_path: Path
) -> None:
    path = written(tmp_path, patient.text)
    told = [one for one in complaints(path) if is_about(ill, one)]
    assert len(told) == 1, examine(path)
    assert told[0].file == str(path)
    assert told[0].line == patient.line(ill)
    assert ill.remedy in told[0].remedy


@every_ill
def test_the_remedy_silences_the_ill_and_only_that(
    patient: Patient, ill: Ill, tmp_path: Path
) -> None:
    before = complaints(written(tmp_path, patient.text))
    after = complaints(written(tmp_path, patient.mended(ill)))
    assert not any(is_about(ill, one) for one in after)
    assert len(after) < len(before)
    for other in patient.ills:
        assert (other == ill) != any(is_about(other, one) for one in after)


@every_patient
def test_a_robot_with_all_remedies_is_sound(patient: Patient, tmp_path: Path) -> None:
    path = written(tmp_path, patient.mended(*patient.ills))
    assert complaints(path) == []
    assert FreeFloatingModel.from_urdf(path, patient.hand).doubts == ()


@every_patient
def test_loading_stops_at_the_first_defect_or_keeps_every_doubt(
    patient: Patient, tmp_path: Path
) -> None:
    path = written(tmp_path, patient.text)
    first, *_ = found = complaints(path)
    if first.severity == Severity.DEFECT:
        with pytest.raises(ModelError) as caught:
            FreeFloatingModel.from_urdf(path, patient.hand)
        assert str(caught.value) == str(first.error())
        assert (caught.value.source, caught.value.line) == (str(path), first.line)
    else:
        told = FreeFloatingModel.from_urdf(path, patient.hand).doubts
        assert told == tuple(one for one in found if "mesh" not in one.problem)


def test_every_ill_of_many_is_told_at_once(tmp_path: Path) -> None:
    """One line wrong does not hide the next; defects come first, then doubts, then notes."""
    text = SOUND.replace('value="10"', 'value="ten"').replace('xyz="0 0 1"', 'xyz="0 0 2"', 1)
    text = text.replace('"elbow" type="revolute"', '"elbow" type="continuous"')
    text = text.replace('ixx="0.1" ixy="0" ixz="0"\n               iyy="0.7"',
                        'ixx="9" ixy="0" ixz="0"\n               iyy="0.7"')  # fmt: skip
    found = examine(written(tmp_path, text))
    assert [(one.severity, one.element) for one in found] == [
        ("defect", "link upper"),
        ("doubt", "joint shoulder"),
        ("doubt", "link lower"),
        ("note", "joint elbow"),
    ]


def test_a_continuous_joint_is_noted_and_not_doubted(tmp_path: Path) -> None:
    text = SOUND.replace('"elbow" type="revolute"', '"elbow" type="continuous"')
    (note,) = examine(written(tmp_path, text))
    assert (note.severity, note.element) == ("note", "joint elbow")
    assert note.line == SOUND[: SOUND.index('<joint name="elbow"')].count("\n") + 1
    assert "plain angle without a range" in note.problem


def test_a_root_without_mass_is_told_what_becomes_of_it(tmp_path: Path) -> None:
    """It is the spacecraft with what is fixed to it, a frame on one, or nothing at all."""
    ground = '<link name="world"/>\n  <joint name="weld" type="fixed"><parent link="world"/>'
    ground += '<child link="bus"/></joint>\n  <link name="bus">'
    path = written(tmp_path, SOUND.replace('<link name="bus">', ground))
    (note,) = examine(path)
    assert (note.severity, note.line, note.element) == ("note", 5, "link world")
    assert "bus of 300 kg" in note.problem
    (note,) = examine(path, carried=True)
    assert "stands on the spacecraft" in note.problem
    bare = PATIENTS["SSRMS: root world, a boom's centre on its joint"]
    told = [one.element for one in complaints(written(tmp_path, bare.text), carried=True)]
    assert told == ["link boom"]


@pytest.mark.parametrize("three", [0.98, 1.02])
def test_a_gyration_radius_is_doubted_from_three_times_the_link(
    three: float, tmp_path: Path
) -> None:
    """The upper link reaches half a metre from its centre of mass."""
    moment = 10.0 * (3.0 * 0.5 * three) ** 2
    text = SOUND.replace('iyy="0.9"', f'iyy="{moment!r}"').replace('ixx="0.1"', 'ixx="22"', 1)
    text = text.replace('izz="0.9"', 'izz="20"')
    told = [one.problem for one in complaints(written(tmp_path, text))]
    assert len(told) == (three > 1.0)


def test_masses_that_vanish_are_doubted_without_a_warning(tmp_path: Path) -> None:
    """Their gyration radius is 1e154 m and more, whose square is no number."""
    text = SOUND.replace('<mass value="10"/>', '<mass value="1e-310"/>')
    assert text != SOUND
    told = [one.problem for one in complaints(written(tmp_path, text))]
    assert any("its gyration radius is" in one for one in told)


def test_drawn_shapes_count_for_the_size_of_a_link(tmp_path: Path) -> None:
    """A boom of 8 m is drawn: then the same moments are no wonder."""
    text = SOUND.replace('iyy="0.9"', 'iyy="40"').replace('izz="0.9"', 'izz="40"')
    shape = '<visual><geometry><cylinder radius="0.1" length="8"/></geometry></visual>'
    assert len(complaints(written(tmp_path, text))) == 1
    drawn = text.replace("</inertial>", f"</inertial>{shape}")
    assert complaints(written(tmp_path, drawn)) == []


@pytest.mark.parametrize(("moment", "count"), [("150", 0), ("170", 1)])
def test_a_link_without_an_end_reaches_back_to_the_joint_before(
    moment: str, count: int, tmp_path: Path
) -> None:
    """1.5 m from its centre of mass, 8 kg: three times that is a moment of 162 kg m²."""
    text = SOUND.replace(WRIST, "").replace(HAND, "")
    text = text.replace('izz="0.7"', f'izz="{moment}"').replace('iyy="0.7"', f'iyy="{moment}"')
    told = complaints(written(tmp_path, text))
    assert [one.element for one in told] == count * ["link lower"]


@pytest.mark.parametrize(("offset", "count"), [("0.5 0.2 0", 0), ("0.01 0.2 0", 1)])
def test_the_mass_of_a_long_link_may_be_in_a_part_fixed_to_it(
    offset: str, count: int, tmp_path: Path
) -> None:
    """What is doubted is the place of the whole, told of the part that has the mass."""
    part = link("part", "10", "0 0 0", "0.9 0.9 0.9").lstrip()
    weld = joint("weld", "fixed", "upper part", offset).replace('rpy="0 0 0"', 'rpy="0 0 1.57"')
    text = SOUND.replace(UPPER, f'{weld}\n  <link name="upper"/>\n  {part}')
    told = complaints(written(tmp_path, text))
    assert [one.element for one in told] == count * ["link part"]
    for one in told:  # half a metre along the link, seen from the turned part
        found = re.search(r'<origin xyz="([^"]*)"/>', one.remedy)
        assert found is not None
        assert np.allclose([float(word) for word in found[1].split()], [-0.2, -0.49, 0], atol=1e-3)


@pytest.mark.parametrize("length", ["0.2", "0.6"])
def test_a_centre_on_the_joint_is_doubted_for_long_links_alone(length: str, tmp_path: Path) -> None:
    """Shares of the arm: 0.2 of 1.2 m is a short link with a motor in its joint, 0.6 of 1.6 not."""
    after = '<child link="lower"/>\n    <origin xyz='
    text = SOUND.replace(f'{after}"1 0 0"', f'{after}"{length} 0 0"')
    at = '<origin xyz="0.5 0 0" rpy="0 0 0"/>\n      <mass value="10"/>'
    text = text.replace(at, '<mass value="10"/>').replace('iyy="0.9"', 'iyy="0.1"')
    text = text.replace('izz="0.9"', 'izz="0.1"')
    told = complaints(written(tmp_path, text))
    assert [one.element for one in told] == ([] if length == "0.2" else ["link upper"])
    if told:  # without an <origin> the <inertial> is where to write one
        assert told[0].line == text[: text.index('<link name="upper"')].count("\n") + 2


@st.composite
def spoilt(draw: st.DrawFn) -> str:
    """A sound robot with a few elements or attributes lost, doubled or overwritten."""
    root = ET.fromstring(draw(st.sampled_from([SOUND, *(p.mended(*p.ills) for p in WELL)])))
    for _ in range(draw(st.integers(1, 3))):
        parents = [element for element in root.iter() if len(element)]
        parent = draw(st.sampled_from(parents))
        element = draw(st.sampled_from(list(parent)))
        deed = draw(st.sampled_from(["lose", "double", "overwrite", "forget"]))
        if deed == "lose" and (len(parents) > 1 or len(parent) > 1):
            parent.remove(element)
        elif deed == "double":
            parent.append(copy.deepcopy(element))
        elif element.attrib:
            key = draw(st.sampled_from(sorted(element.attrib)))
            if deed == "forget":
                del element.attrib[key]
            else:
                junk = ["", "0", "-1", "nan", "pi", "1 2 3", "bus", "upper", "revolute", "fixed"]
                element.set(key, draw(st.sampled_from(junk)))
    return ET.tostring(root, encoding="unicode")


@given(text=spoilt())
def test_any_spoilt_robot_is_told_of_or_can_be_built(text: str) -> None:
    """Nothing that is broken makes the doctor stumble, and where no defect is told none is met."""
    found = examine(text)
    if any(one.severity == Severity.DEFECT for one in found):
        with pytest.raises(ModelError) as caught:
            read_urdf(text)
        assert str(caught.value) == str(found[0].error())
    else:
        refusal = ""
        try:
            FreeFloatingModel.from_urdf(text)
        except ModelError as error:  # no arm, or several
            refusal = str(error)
        assert refusal == "" or re.search("end_effector|no joint moves|same name", refusal)


TRUE_DOUBTS = {
    "planar_3dof": [("link link_3", "gyration radius is 1.22 m")],  # 1.5 kg m² of 1 kg: Table I
    "spatial_6dof": [("link link_3", "0.001, 1.7, 7.5 break the triangle")],  # Table II
    "panda": [("joint panda_finger_joint2", "mimics panda_finger_joint1")],
    # wrists of the real arm have a radius of 0.06 m, their inertias are those of 0.6 m
    "ur5": [(f"link wrist_{k}_link", "gyration radius is 0.424 m") for k in (1, 2, 3)],
}


@pytest.mark.parametrize(
    "name",
    ["planar_3dof", "spatial_6dof", "ur3", "ur5", "ur10", "panda", "kinova", "xarm7", "z1"],
)
def test_only_true_doubts_are_told_of_good_robots(name: str) -> None:
    bundled = {path.stem: path for path in models_folder().glob("*/*.urdf")}
    found = complaints((bundled | example_robots())[name])
    expected = TRUE_DOUBTS.get(name, [])
    assert [one.element for one in found] == [element for element, _ in expected]
    for one, (_, problem) in zip(found, expected, strict=True):
        assert problem in one.problem


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("pi/2", 1.5707963267948966),
        ("-(0.16/2)", -0.08),
        ("${2*(1.5 - 1)}", 1.0),
        ("+3e-1", 0.3),
        ("1/0", None),
        ("2**9999999", None),
        ("__import__('os')", None),
        ("five", None),
        ("1_0", None),
        ("(" * 70, None),
        ("9" * 500, None),
        ("True", None),
        ("", None),
    ],
)
def test_expressions_are_worked_out_for_the_remedy_alone(
    expression: str, value: float | None
) -> None:
    assert value_of(expression) == value
