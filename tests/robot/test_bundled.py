"""The robots and scenarios that come with the package."""

from __future__ import annotations

import shutil
import sysconfig
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import numpy as np
import pytest

import freefloat as ff
from freefloat.errors import ModelError
from freefloat.robot import bundled
from freefloat.robot.assembly import assemble
from freefloat.robot.bundled import (
    EXAMPLE,
    bundled_scenarios,
    examples_folder,
    find_robot,
    find_scenario,
    models_folder,
)
from freefloat.robot.validation import read_urdf
from tests.errors import error_key


def test_links_of_moving_bodies_are_suggested_as_end_effector() -> None:
    """Not the frame of the foot, which is a last link as well."""
    load = ff.Payload(mass=10.0, inertia=np.full(3, 0.2))
    arm = assemble(find_robot(f"{EXAMPLE}ur10", Path("/")), None, load, "tool0")
    with pytest.raises(ModelError) as caught:
        ff.FreeFloatingModel.from_urdf(arm.text)
    assert caught.value.key == "end_effector"
    links = set(caught.value.accepted.rpartition("such as ")[2].split(", "))
    assert links == {"wrist_3_link", "ee_link", "tool0", "payload"}


@pytest.mark.parametrize("name", bundled_scenarios())
def test_every_bundled_scenario_loads(name: str) -> None:
    scenario = ff.load_scenario(name)
    assert scenario.source == models_folder() / f"{name}.yaml"
    assert scenario.model().dof > 0


def test_a_scenario_is_found_by_its_path_before_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert find_scenario("spatial_6dof/line") == models_folder() / "spatial_6dof" / "line.yaml"
    file = tmp_path / "spatial_6dof" / "line"
    file.parent.mkdir()
    file.write_text("task: pose\n")
    assert find_scenario("spatial_6dof/line").resolve() == file
    assert find_scenario(str(file)) == file


@pytest.mark.parametrize("name", ["planar_3dof", "planar_3dof.urdf"])
def test_a_robot_is_found_by_its_file_before_its_name(name: str, tmp_path: Path) -> None:
    bundled = models_folder() / "planar_3dof" / "planar_3dof.urdf"
    assert find_robot(name, tmp_path) == bundled
    file = tmp_path / name
    shutil.copy(bundled, file)
    assert find_robot(name, tmp_path) == file
    assert find_robot(str(file), Path("/")) == file


@pytest.mark.parametrize(("name", "file"), [
    ("ur3", "ur3_robot.urdf"),
    ("ur5_robot", "ur5_robot.urdf"),
    ("ur5_gripper", "ur5_gripper.urdf"),
    ("anymal_c_simple/anymal", "anymal.urdf"),
])  # fmt: skip
def test_a_stock_robot_is_found_by_its_short_name(name: str, file: str) -> None:
    path = find_robot(EXAMPLE + name, Path("/nowhere"))
    assert path.name == file
    assert read_urdf(path).source == str(path)


@pytest.fixture
def _another_installation() -> Iterator[None]:
    """Look for the package of stock robots again, before a test and after it."""
    examples_folder.cache_clear()
    yield
    examples_folder.cache_clear()


@pytest.mark.usefixtures("_another_installation")
def test_stock_robots_are_where_their_wheel_lists_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Folders inside a wheel are its maker's business."""
    root = tmp_path / "elsewhere" / "example-robot-data"
    for file in ("package.xml", "robots/my_description/urdf/mine.urdf"):
        (root / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(models_folder() / "planar_2dof/planar_2dof.urdf", root / file)
    wheel = tmp_path / "example_robot_data-9.0.dist-info"
    wheel.mkdir()
    (wheel / "METADATA").write_text("Name: example-robot-data\nVersion: 9.0\n")
    files = (file.relative_to(tmp_path) for file in tmp_path.rglob("*") if file.is_file())
    (wheel / "RECORD").write_text("".join(f"{file},,\n" for file in files))
    monkeypatch.syspath_prepend(tmp_path)
    found = find_robot(f"{EXAMPLE}mine", Path("/"))
    assert found == root / "robots/my_description/urdf/mine.urdf"


def _not_installed(name: str) -> None:
    raise PackageNotFoundError(name)


@pytest.mark.usefixtures("_another_installation")
def test_without_the_package_the_message_says_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bundled, "distribution", _not_installed)
    monkeypatch.setattr(sysconfig, "get_path", lambda name: str(tmp_path))
    assert error_key(find_robot, f"{EXAMPLE}ur5", Path("/")) == "urdf"
