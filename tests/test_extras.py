"""Packages that are imported are listed, and a missing extra is named with its command."""

import ast
import re
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

import freefloat as ff
from freefloat.errors import MissingExtraError
from freefloat.studies.loading import load_study
from freefloat.studies.runner import run_study
from freefloat.visualization.page.pictures import take_pictures
from tests.commands import error

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
EXTRAS = {
    name: listed
    for name, listed in PROJECT["optional-dependencies"].items()
    if name not in ("docs", "test")
}
PARTS = {
    "pinocchio": "pin", "coal": "coal", "distributed": "dask", "mujoco": "mujoco",
    "llvmlite": "numba",
}  # fmt: skip
"""Distributions whose modules are installed by a part of them; Numba names its llvmlite exactly."""
MODULES = {
    "cluster": "distributed", "mcap": "mcap_ros2",
    "mujoco": "mujoco", "parquet": "pyarrow", "video": "playwright", "xacro": "xacro",
}  # fmt: skip
COMMANDS = {
    "check missing.h5 --engine mujoco": "mujoco",
    "info robot.xml": "mujoco",
    "batch spatial_6dof/montecarlo --output study --scheduler tls://host:8786": "cluster",
    "batch spatial_6dof/track --output study": "mujoco",
    "export missing.h5 --format mcap": "mcap",
    "export missing.h5 -o motion.mcap": "mcap",
    "view missing.h5 --snapshots 2": "video",
    "view missing.h5 --video motion.gif": "video",
    "info robot.xacro": "xacro",
}
"""Commands and the extras without which they do nothing, even where their file is missing."""


def installed_by(listed: list[str]) -> set[str]:
    """Names of the distributions in a list of requirements, in lower case."""
    return {re.split(r"[^\w.-]", entry)[0].lower() for entry in listed}


def imported() -> set[str]:
    modules = set()
    for file in (ROOT / "src").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if isinstance(node, ast.Import):
                modules |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                modules.add(str(node.module).partition(".")[0])
    distributions = packages_distributions()
    others = modules - sys.stdlib_module_names - {"freefloat"}
    return {(PARTS.get(name) or distributions[name][0]).lower() for name in others}


@pytest.mark.slow
def test_every_package_that_is_imported_is_listed() -> None:
    extras = set[str]().union(*map(installed_by, EXTRAS.values()))
    listed = installed_by(PROJECT["dependencies"])
    assert not listed & extras
    used = imported()
    assert used <= listed | extras
    assert listed - used == {"example-robot-data"}  # the robots that names find


def test_every_extra_is_tried_without() -> None:
    assert set(EXTRAS) == set(MODULES)
    assert set(COMMANDS.values()) | {"parquet"} == set(MODULES)


def install_line(extra: str) -> str:
    return f"{extra}: it needs an extra: pip install 'freefloat[{extra}]'"


@pytest.fixture
def folder(folder: Path) -> Path:
    """A working folder with robots in other formats."""
    (folder / "robot.xml").write_text("<mujoco/>")
    (folder / "robot.xacro").write_text("<robot/>")
    return folder


@pytest.mark.parametrize(("words", "extra"), COMMANDS.items())
def test_a_command_names_the_missing_extra_before_any_work(words, extra, folder, monkeypatch):
    monkeypatch.setitem(sys.modules, MODULES[extra], None)
    assert error(*words.split())["message"] == install_line(extra)


def test_functions_name_the_missing_extra(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    problem = ff.load_scenario("planar_2dof/line").problem()
    simulation = ff.simulate(problem, heading=0.5)
    calls = {
        "mcap": lambda: ff.export(simulation, "motion.mcap"),
        "mujoco": lambda: ff.track(simulation),
        "video": lambda: next(take_pictures("", [0.0], (64, 64))),
        "xacro": lambda: ff.FreeFloatingModel.from_urdf("robot.xacro"),
    }
    for extra, call in calls.items():
        monkeypatch.setitem(sys.modules, MODULES[extra], None)
        with pytest.raises(MissingExtraError) as caught:
            call()
        assert str(caught.value) == install_line(extra)
    assert not (folder / "motion.mcap").exists()
    with pytest.raises(MissingExtraError):
        run_study(load_study("spatial_6dof/track"), "study")
    assert not (folder / "study").exists()
