"""Lists of numbers on the command line: with spaces or commas between them, with any sign."""

from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from freefloat.cli.app import app
from tests.commands import document, error

UR5 = ("example-robot-data:ur5", "--end-effector", "tool0", "-o", "out.urdf")
COMMANDS: Any = get_command(app)


@pytest.fixture(autouse=True)
def folder(folder: Path) -> None:
    (folder / "1").touch()  # names of files may be numbers


@pytest.mark.parametrize("name", sorted(COMMANDS.commands))
def test_no_option_takes_several_words_by_itself(name: str) -> None:
    options = [option for option in COMMANDS.commands[name].params if option.opts[0][0] == "-"]
    assert [option.opts for option in options if option.nargs != 1] == []


@pytest.mark.parametrize("words", [
    ("planar_2dof", "--joints", "-0.3", "0.6"),
    ("--joints", "-0.3", "0.6", "planar_2dof"),
    ("planar_2dof", "--joints=-0.3,0.6"),
    ("planar_2dof", "--joints", "-0.3,0.6"),
    ("planar_2dof", "--joints=-0.3", "0.6", "--attitude=0", "0", "0", "1"),
    ("planar_2dof", "--joints", "-3e-1,", "0.6", "--attitude", "0,0,0,1"),
    ("planar_2dof", "--joints", "-0.3, 0.6", "--attitude", "0 0 0 1"),
    ("--attitude", "0", "0", "0", "1", "--joints", "-0.3,+0.6", "planar_2dof"),
])  # fmt: skip
def test_joints_and_attitudes_have_both_forms(words: tuple[str, ...]) -> None:
    configuration = document("info", *words)["configuration"]
    assert configuration["joints"] == [-0.3, 0.6]
    assert configuration["attitude"] == [0.0, 0.0, 0.0, 1.0]


@pytest.mark.parametrize(("command", "words", "key"), [
    ("simulate", ("planar_3dof/parabola", "--attitude", "0", "0", "1"), "attitude"),
    ("simulate", ("planar_3dof/parabola", "--attitude", "0", "0", "zero", "1"), "attitude"),
    ("simulate", ("planar_3dof/parabola", "--attitude", "--quiet"), "attitude"),
    ("simulate", ("planar_3dof/parabola", "--attitude", "[0,0,0,1]"), "attitude"),
    ("simulate", ("planar_3dof/parabola", "--attitude", "0", "0", "nan", "1"), "attitude"),
    ("simulate", ("planar_3dof/parabola", "--heading", "9", "--joints", "0.1,,0.2"), "joints"),
    ("simulate", ("planar_3dof/parabola", "--heading", "9", "--joints", "0.1", "−0.2"), "joints"),
    ("info", ("planar_2dof", "--joints", "0.3"), "joints"),
    ("map", ("planar_3dof/parabola", "--nearest", "0,0,1"), "nearest"),
    ("assemble", (*UR5, "--mass", "1", "--inertia", "1", "1", "1", "--size", "1", "1"), "size"),
    ("assemble", (*UR5, "--mass", "1", "--inertia", "1,1"), "spacecraft.inertia"),
    ("assemble", (*UR5, "--mass", "1", "--inertia", "1,1,1", "--mount", "0,0,0"), "mount"),
])  # fmt: skip
def test_errors_name_the_option(command: str, words: tuple[str, ...], key: str) -> None:
    refusal = error(command, *words)
    assert refusal["key"] == key
    assert refusal["accepted"]
