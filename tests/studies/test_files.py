"""What a study reads and sends: every file once, copies that lead to each other, names kept."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from freefloat.errors import InputError
from freefloat.robot.mesh_paths import find_mesh
from freefloat.robot.names import models_folder
from freefloat.studies.files import StudyFiles
from tests.example_studies import BASE, a_study

LISTED = {"momentum.2": {"list": [0, 1]}}
URDF = models_folder() / "planar_3dof" / "planar_3dof.urdf"
MESH = "solid a\nendsolid a\n"


def with_robot(**robot: Any) -> dict[str, Any]:
    return BASE | {"robot": {**BASE["robot"], **robot}}


def test_a_bundled_robot_is_sent_along(tmp_path: Path) -> None:
    files = StudyFiles.of(a_study(tmp_path, LISTED))
    assert files.contents == {str(URDF): URDF.read_bytes()}
    assert list(files.digests()) == ["planar_3dof.urdf"]


def test_every_file_that_some_case_names_is_read_once(tmp_path: Path) -> None:
    for name in ("a.urdf", "b.urdf"):
        shutil.copy(URDF, tmp_path / name)
    vary = {
        "robot.urdf": {"list": ["a.urdf", "b.urdf", "missing.urdf", "a.urdf"]},
        "path": {"list": [{"samples": "way.csv"}, BASE["path"]]},
    }
    (tmp_path / "way.csv").write_text("x,y,z\n2,0,0\n1,0,0\n")
    files = StudyFiles.of(a_study(tmp_path, vary))
    assert set(files.contents) == {
        str(tmp_path / "a.urdf"), str(tmp_path / "b.urdf"), str(tmp_path / "way.csv"), str(URDF),
    }  # fmt: skip


def test_copies_stand_in_for_files_that_are_gone(tmp_path: Path) -> None:
    shutil.copy(URDF, tmp_path / "arm.urdf")
    study = a_study(tmp_path, LISTED, base=with_robot(urdf="arm.urdf"))
    files = StudyFiles.of(study)
    (tmp_path / "arm.urdf").unlink()
    unpacked = files.unpack(tmp_path / "elsewhere")
    named = unpacked.led_to_copies(study.document(0))["robot"]["urdf"]
    assert Path(named).read_bytes() == URDF.read_bytes()
    assert Path(named).is_relative_to(tmp_path / "elsewhere")
    assert unpacked.told(f"{named}: broken") == f"{tmp_path / 'arm.urdf'}: broken"
    assert study.document(0)["robot"]["urdf"] == "arm.urdf"


def test_copies_lie_below_their_folder_wherever_the_names_lead(tmp_path: Path) -> None:
    shutil.copy(URDF, tmp_path / "arm.urdf")
    inner = tmp_path / "deep" / "deeper"
    inner.mkdir(parents=True)
    study = a_study(inner, LISTED, base=with_robot(urdf="../../deep/../arm.urdf"))
    place = tmp_path / "copies"
    StudyFiles.of(study).unpack(place)
    copies = [path for path in place.rglob("*") if path.is_file()]
    assert [path.relative_to(place) for path in copies] == [
        (tmp_path / "arm.urdf").relative_to("/")
    ]


@pytest.mark.parametrize("written", ["meshes/part.stl", "{folder}/meshes/part.stl", "package"])
def test_meshes_are_found_from_the_copies(
    written: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also those named by an absolute path or by a package that only this machine knows."""
    home = tmp_path / "home"
    (home / "meshes").mkdir(parents=True)
    mesh = home / "meshes" / "part.stl"
    name = written.format(folder=home)
    if written == "package":
        monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ros"))
        mesh = tmp_path / "ros" / "mine" / "part.stl"
        mesh.parent.mkdir(parents=True)
        name = "package://mine/part.stl"
    mesh.write_text(MESH)
    visual = f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
    text = URDF.read_text().replace('<link name="link_1">', f'<link name="link_1">{visual}')
    (home / "arm.urdf").write_text(text)
    study = a_study(home, LISTED, base=with_robot(urdf="arm.urdf"))
    files = StudyFiles.of(study)
    assert files.contents[str(mesh)] == MESH.encode()
    unpacked = files.unpack(tmp_path / "copies")
    mesh.unlink()
    urdf = unpacked.below(home / "arm.urdf")
    copied = urdf.read_text().partition('mesh filename="')[2].partition('"')[0]
    assert find_mesh(copied, str(urdf)).read_text() == MESH
    assert unpacked.told(urdf.read_text()).count("copies") == 0
    assert len(urdf.read_text().splitlines()) == len(text.splitlines())


def test_a_file_of_the_base_that_is_missing_is_told_before_anything_runs(tmp_path: Path) -> None:
    study = a_study(tmp_path, LISTED, base=with_robot(urdf="arm.urdf"))
    with pytest.raises(InputError) as caught:
        StudyFiles.of(study)
    assert caught.value.source == str(tmp_path / "wish.yaml")
    assert caught.value.key == "robot.urdf"


def test_a_base_file_that_every_case_replaces_may_be_missing(tmp_path: Path) -> None:
    vary = {"robot.urdf": {"list": ["planar_3dof"]}}
    study = a_study(tmp_path, vary, base=with_robot(urdf="arm.urdf"))
    assert list(StudyFiles.of(study).contents) == [str(URDF)]


def test_the_digest_follows_the_contents(tmp_path: Path) -> None:
    shutil.copy(URDF, tmp_path / "arm.urdf")
    study = a_study(tmp_path, LISTED, base=with_robot(urdf="arm.urdf"))
    before = StudyFiles.of(study).digests()
    (tmp_path / "arm.urdf").write_text(URDF.read_text() + " ")
    assert StudyFiles.of(study).digests() != before
