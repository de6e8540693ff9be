"""Arguments of xacro files, and the library that reads them."""

import shutil
from importlib.util import find_spec
from pathlib import Path

import pytest
import yaml

import freefloat as ff
from freefloat.beyond.formats.xacro import read
from tests.commands import document, error, run
from tests.errors import error_key
from tests.spart_robots import ROBOTS, SCENARIO

pytestmark = pytest.mark.slow
INCLUDED = (
    '<robot xmlns:xacro="x"><xacro:arg name="extra" default="${2 * 3}"/>'
    '<xacro:if value="false"><xacro:arg name="never"/></xacro:if></robot>'
)
HEAD = (
    'name="a" xmlns:xacro="x"><xacro:arg name="mass"/><xacro:include filename="more.xacro"/>'
    '<xacro:property name="m" value="${$(arg mass) + $(arg extra)}"/>'
)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A file with an argument without default, which includes one with two more."""
    (tmp_path / "more.xacro").write_text(INCLUDED)
    text = ROBOTS["no limits"].replace('"100.0"', '"${m}"').replace('name="SC_2DoF">', HEAD)
    (tmp_path / "arm.urdf.xacro").write_text(text)
    return tmp_path / "arm.urdf.xacro"


@pytest.fixture
def robot(file: Path, readers_here: None) -> Path:
    """The same file, read without processes."""
    return file


def test_arguments_are_given_and_shown(robot: Path) -> None:
    info = document("info", robot, "--xacro", "mass=100")
    assert info["total_mass"] == 124.0
    assert info["arguments"] == [
        {"name": "mass", "value": "100", "default": False},
        {"name": "extra", "value": "6", "default": True},
    ]
    both = document("info", robot, "--xacro", "mass=100", "--xacro", "extra=9")
    assert (both["total_mass"], both["arguments"][1]["default"]) == (127.0, False)
    assert "extra 6 (default)" in run("info", robot, "--xacro", "mass=100").stdout


def test_missing_and_unknown_arguments_are_named(robot: Path, tmp_path: Path) -> None:
    missing = error("info", robot)
    assert missing["key"] == "arguments.mass"
    assert "--xacro mass=" in missing["accepted"]
    unknown = error("info", robot, "--xacro", "mass=1", "--xacro", "mas=2")
    assert unknown["key"] == "arguments.mas"
    assert set(unknown["accepted"].split(", ")) == {"mass", "extra", "never"}
    for given in (["mass"], ["=1"], ["mass=1", "--xacro", "mass=2"]):
        assert error("info", robot, "--xacro", *given)["key"] == "xacro"


def test_other_files_have_no_arguments(tmp_path: Path) -> None:
    assert error("info", "planar_2dof", "--xacro", "mass=1")["key"] == "arguments"
    assert error("info", "planar_2dof/line", "--xacro", "mass=1")["key"] == "xacro"
    options = ("-o", tmp_path / "a.urdf", "--xacro", "mass=1")
    assert error("assemble", "planar_2dof/line", *options)["key"] == "options"
    (tmp_path / "a.xml").write_text("<mujoco/>")
    for file in (tmp_path / "a.xml", ROBOTS["no limits"]):
        source = ff.RobotSource(file, arguments={"mass": 1})
        assert error_key(ff.FreeFloatingModel.from_urdf, source) == "arguments"
    assert error_key(ff.RobotSource, "planar_2dof", arguments={"mass": [1]}) == "arguments.mass"


def test_written_robots_have_their_arguments(robot: Path, tmp_path: Path) -> None:
    written = tmp_path / "robot.urdf"
    assert run("assemble", robot, "--xacro", "mass=100", "-o", written).exit_code == 0
    assert ff.FreeFloatingModel.from_urdf(written).total_mass == 124.0
    file = tmp_path / "s.yaml"

    def write(arguments: dict[str, object]) -> None:
        section = {"urdf": robot.name, "end_effector": "tip", "arguments": arguments}
        file.write_text(yaml.safe_dump(SCENARIO | {"robot": section}))

    write({"mass": 100.5, "extra": 9, "never": True})
    assert run("plan", file, "-o", tmp_path / "p.h5").exit_code == 0
    assert ff.load(tmp_path / "p.h5").problem.model.total_mass == 127.5
    assert run("check", tmp_path / "p.h5").exit_code == 0
    study = {"base": "s.yaml", "command": "plan", "files": "none",
             "vary": {"robot.arguments.mass": {"list": [100, 150]}}}  # fmt: skip
    (tmp_path / "study.yaml").write_text(yaml.safe_dump(study))
    loaded = ff.load_study(tmp_path / "study.yaml")
    masses = [loaded.scenario(number).model().total_mass for number in range(2)]
    assert masses == [127.0, 177.0]
    write({"mass": [1, 2]})
    assert error("plan", file)["key"].startswith("robot.arguments.mass")
    write({})
    assert error("plan", file)["key"] == "arguments.mass"


def test_attached_files_have_arguments_of_their_own(robot: Path, tmp_path: Path) -> None:
    section = {
        "urdf": "planar_2dof", "end_effector": "end_effector",
        "attached": [{"urdf": robot.name, "prefix": "b_", "arguments": {"mass": 10}}],
    }  # fmt: skip
    (tmp_path / "r.yaml").write_text(yaml.safe_dump({"robot": section}))
    alone = ff.FreeFloatingModel.from_urdf("planar_2dof").total_mass
    written = document("assemble", tmp_path / "r.yaml", "-o", tmp_path / "a.urdf")
    assert ff.FreeFloatingModel.from_urdf(written["file"], "end_effector").total_mass == (
        pytest.approx(alone + 34.0)
    )


RELEASES = {
    "without the function": ("__init__.py", "safe_eval", "evaluate_safely"),
    "with another in its place": ("substitution_args.py", "_eval_env(args[0])", "os.environ['E']"),
    "without a substitution": ("substitution_args.py", "_eval_find", "_find_package"),
    "without symbols": ("__init__.py", "_global_symbols", "_all_symbols"),
    "with a way to Python": ("__init__.py", "'bool', 'True'", "'bool', 'vars', 'True'"),
}  # fmt: skip
"""File, text and what a later release of xacro has in its place."""


@pytest.mark.parametrize("name", RELEASES)
def test_releases_that_cannot_be_confined_are_refused(name, file, tmp_path, monkeypatch):
    spec = find_spec("xacro")
    assert spec is not None
    assert spec.origin is not None
    library = tmp_path / "library"
    shutil.copytree(Path(spec.origin).parent, library / "xacro")
    module, before, after = RELEASES[name]
    part = library / "xacro" / module
    text = part.read_text()
    assert before in text
    part.write_text(text.replace(before, after))
    monkeypatch.syspath_prepend(library)  # where the reader's process looks first, too
    source = ff.RobotSource(file, arguments={"mass": 1})
    assert error_key(ff.FreeFloatingModel.from_urdf, source) == "xacro"


def test_the_installed_release_is_confined(robot: Path) -> None:
    assert "<robot" in read(str(robot), {}, {"mass": "1"}).text
