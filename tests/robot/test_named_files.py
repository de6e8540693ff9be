"""The robots and scenarios that come with the package, and stock robots; published numbers."""

import shutil
import sysconfig
from collections.abc import Iterator
from dataclasses import replace
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import numpy as np
import pytest

import freefloat as ff
from freefloat.errors import ModelError
from freefloat.robot import named_files
from freefloat.robot.assembly import assemble
from freefloat.robot.named_files import (
    EXAMPLE,
    bundled_scenarios,
    examples_folder,
    find_robot,
    find_scenario,
    models_folder,
)
from freefloat.robot.validation import read_urdf
from freefloat.so3 import UPRIGHT
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


def test_a_scenario_is_found_by_its_path_before_its_name(folder: Path) -> None:
    assert find_scenario("spatial_6dof/line") == models_folder() / "spatial_6dof" / "line.yaml"
    file = folder / "spatial_6dof" / "line"
    file.parent.mkdir()
    file.write_text("task: pose\n")
    assert find_scenario("spatial_6dof/line").resolve() == file
    assert find_scenario(str(file)) == file


@pytest.mark.parametrize("name", ["planar_3dof", "planar_3dof.urdf"])
def test_a_robot_is_found_by_its_file_before_its_name(name: str, tmp_path: Path) -> None:
    assert find_robot(name, tmp_path) == models_folder() / "planar_3dof" / "planar_3dof.urdf"
    file = tmp_path / name
    file.touch()
    assert find_robot(name, tmp_path) == find_robot(str(file), Path("/")) == file


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
def test_stock_robots_are_where_their_wheel_lists_them(tmp_path, monkeypatch):
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
def test_without_the_package_the_message_says_how_to_get_it(tmp_path, monkeypatch):
    monkeypatch.setattr(named_files, "distribution", _not_installed)
    monkeypatch.setattr(sysconfig, "get_path", lambda name: str(tmp_path))
    assert error_key(find_robot, f"{EXAMPLE}ur5", Path("/")) == "urdf"


def test_the_two_real_arms_have_the_published_masses_and_lengths() -> None:
    ets_vii, ssrms = map(ff.FreeFloatingModel.from_urdf, ("ets_vii", "ssrms"))
    assert ets_vii.warnings == ssrms.warnings == ()
    assert [body.mass for body in ets_vii.bodies] == [2550, 35, 22.5, 21.9, 16.5, 26, 18.5]
    assert np.isclose(ssrms.total_mass, 1e5 + 2 * 243.66 + 4 * 105.98 + 314.88 + 279.2, rtol=1e-12)
    straight = ets_vii.body_poses(UPRIGHT, np.zeros(6))
    shoulder = straight[2].position
    position = ets_vii.end_effector_pose(UPRIGHT, np.zeros(6)).position
    assert np.isclose(np.linalg.norm(position - shoulder), np.hypot(0.87 + 0.63 + 0.53, np.hypot(
        0.26, 0.28)), rtol=1e-12)  # fmt: skip
    upright = ssrms.end_effector_pose(UPRIGHT, np.zeros(7)).position
    foot = ssrms.body_poses(UPRIGHT, np.zeros(7))[0].position[2] + 2.2
    assert np.isclose(upright[2] - foot, 2 * (1.3589 + 7.11), rtol=1e-12)


PLANNED = ("planar_2dof/line", "ur5_servicer/inspect", "ssrms/transfer")
"""Scenarios with limits: in the plane, with meshes, redundant. scripts/lab/verify_plans.py plans
all of them, and docs/how-to/limits.md that of ETS-VII."""


@pytest.mark.slow
@pytest.mark.parametrize("name", PLANNED)
def test_a_scenario_plans_within_its_limits(name: str) -> None:
    scenario = ff.load_scenario(name)
    problem, search = scenario.problem(), replace(scenario.search(), samples=64)
    plan = ff.plan(problem, search, scenario.limits())
    assert plan.feasible, plan.reason
    assert plan.chosen is not None
    assert problem.margin.keeps(plan.chosen.closest_approach.value)
    assert plan.disagreements == ()
    kept = {result.limit: result.kept for result in plan.limit_results}
    assert {"joint_rate", "joint_torque", "base_rate", "clearance"} <= kept.keys()
    assert all(kept.values())
    wrench = next(r.base_wrench for r in plan.limit_results if r.limit == "joint_torque")
    assert wrench is not None
    assert wrench < 1e-6
