"""The command ``singularities``."""

from pathlib import Path

import pytest

import freefloat as ff
from tests.commands import document, error


@pytest.mark.slow
def test_the_map_of_a_robot_and_its_file(tmp_path: Path) -> None:
    file = tmp_path / "map.h5"
    found = document("singularities", "planar_3dof", "--resolution", 1, "-o", file)
    assert found["joints"] == ["q1", "q2"]
    assert found["degrees"] == [2, 1, 0]
    assert sum(found["volumes"].values()) == pytest.approx(1.0)
    assert [part["sign"] for part in found["components"]] in ([1, -1], [-1, 1])
    largest = found["largest"]["system"]
    assert largest["value"] == pytest.approx(148.6, abs=0.05)
    assert largest["value"] <= largest["upper_bound"] < 1.0001 * largest["value"]
    assert ff.load(file).to_dict()["volumes"] == found["volumes"]
    report = document("check", file)
    assert report["proved"]
    assert report["kind"] == "singularity map"
    assert error("check", file, "--engine", "mujoco")["key"] == "engine"


@pytest.mark.slow
def test_fixed_joints_and_the_scenario_of_a_redundant_arm(tmp_path: Path) -> None:
    options = [word for k in (1, 2, 3, 5) for word in ("--fix", f"panda_joint{k}=0.4")]
    found = document("singularities", "panda_servicer/line", "--resolution", 20, *options, "-o",
                     tmp_path / "map.h5")  # fmt: skip
    assert document("check", tmp_path / "map.h5")["proved"]
    assert found["fixed"] == {f"panda_joint{k}": 0.4 for k in (1, 2, 3, 5)}
    assert found["volumes"]["negative"] == 0.0
    assert found["largest"] == {}


@pytest.mark.parametrize(("key", "words"), [
    ("robot", ["panda_servicer/line"]),
    ("fixed", ["planar_3dof", "--fix", "elbow=1"]),
    ("fix", ["planar_3dof", "--fix", "q1"]),
    ("resolution", ["planar_3dof", "--resolution", "-1"]),
])  # fmt: skip
def test_bad_input(key: str, words: list[str]) -> None:
    assert error("singularities", *words)["key"] == key
