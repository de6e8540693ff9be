"""Bad input of every kind: exit code 2 and one error with the key, the same of every command."""

from pathlib import Path

import pytest

from tests.commands import error, run
from tests.scenarios import PARABOLA

NAME = "scenario.yaml"
HEADING = ("--heading", "0")
POLYNOMIAL = "polynomial: {x: [2, -3], y: [0, 0.5, 1.5], z: [0]}"
EDITS: dict[str, tuple[str, str, str]] = {
    "unknown key": ("momentm", "momentum", "momentm"),
    "a word for a number": ("path.polynomial.x.0", "x: [2", "x: [z"),
    "no map": ("robot.scale_mass", "{urdf", "{scale_mass: z, urdf"),
    "a factor of zero": ("robot.scale_mass", "{urdf", "{scale_mass: 0, urdf"),
    "speeds of another law": (
        "timing.speeds",
        "law: quintic",
        "law: quintic, speeds: [[0, 0], [50, 0.02], [100, 0]]",
    ),
    "degrees": (
        "path.attitude.fixed.rpy",
        "follow: {axis: -y, normal: [0, 0, 1]}",
        "fixed: {rpy: [0, 90, 45]}",
    ),
    "missing key": ("timing.duration", ", duration: 100", ""),
    "NaN": ("momentum.2", "0.5]", ".nan]"),
    "unknown word": ("margin.measure", "measure: system", "measure: det"),
    "negative": ("margin.value", "value: 5", "value: -5"),
    "two alternatives": ("margin", "value: 5", "value: 5, fraction: 0.2"),
    "coinciding waypoints": ("path.waypoints", POLYNOMIAL, "waypoints: [[2, 0, 0], [2, 0, 0]]"),
    "missing URDF": ("robot.urdf", "planar_3dof.urdf", "planar_4dof.urdf"),
    "unknown link": ("robot.end_effector", "end_effector: end_effector", "end_effector: tip"),
    "missing samples": ("path.samples", POLYNOMIAL, "samples: points.csv"),
    "invalid YAML": ("file", PARABOLA, "robot: {urdf: x\n"),
}
"""Key of the error, the passage of the scenario that is replaced, and with what, by name."""
BEYOND = ("path.waypoints", "path.samples", "robot.urdf", "robot.end_effector", "timing.speeds")
"""Keys of errors that are found after the file has been read: they have no line."""
OPTIONS: dict[str, tuple[str, tuple[str, ...]]] = {
    "no attitude": ("attitude", ()),
    "attitude and heading": ("attitude", (*HEADING, "--attitude", *"0001")),
    "attitude off the plane": ("attitude", ("--attitude", *"1000")),
    "NaN heading": ("heading", ("--heading", "nan")),
    "wrong number of joints": ("joints", (*HEADING, "--joints", "1,2")),
    "joints and branch": ("branch", (*HEADING, "--joints", "0,0,0", "--branch", "1")),
    "missing branch": ("branch", (*HEADING, "--branch", "5")),
}


def replaced(text: str, old: str, new: str) -> str:
    assert old in text
    return text.replace(old, new, 1)


@pytest.mark.parametrize(("key", "old", "new"), EDITS.values(), ids=EDITS)
def test_keys(key: str, old: str, new: str, folder: Path) -> None:
    (folder / NAME).write_text(replaced(PARABOLA, old, new))
    refusal = error("simulate", NAME, *HEADING)
    assert refusal["key"].startswith(key)
    assert refusal["file"] == NAME or key == "path.samples"
    assert refusal["accepted"]
    line = PARABOLA[: PARABOLA.index(old)].count("\n") + 1
    line += key == "file"  # where the bracket is missed
    assert refusal["line"] == (None if key in BEYOND else line)


@pytest.mark.parametrize(("key", "words"), OPTIONS.values(), ids=OPTIONS)
def test_options(key: str, words: tuple[str, ...]) -> None:
    assert error("simulate", "planar_3dof/parabola", *words)["key"] == key


@pytest.mark.parametrize("command", ["workspace", "plan", "map"])
def test_every_command_refuses_the_same_input(command: str, folder: Path) -> None:
    (folder / NAME).write_text(replaced(PARABOLA, "0.5]", ".nan]"))
    assert error(command, NAME) == error("simulate", NAME, *HEADING)
    assert list(folder.iterdir()) == [folder / NAME]


@pytest.mark.parametrize(
    ("old", "new"), [("duration: 100", "duration: 1e300"), ("x: [2, -3]", "x: [2, 1e308, 1e308]")]
)
def test_extreme_numbers_give_a_result_or_an_error(old: str, new: str, folder: Path) -> None:
    (folder / NAME).write_text(replaced(PARABOLA, old, new))
    result = run("simulate", NAME, *HEADING)
    assert result.exit_code in (0, 1, 2), result.output
    assert len(result.stderr.splitlines()) == (1 if result.exit_code == 2 else 0)


@pytest.mark.parametrize(
    ("key", "option", "name", "content"),
    [
        ("output", "-o", "flight.h5", b"\x89HDF\r\n\x1a\n"),
        ("html", "--html", "a.urdf", b"<robot/>"),
    ],
)
def test_outputs_do_not_replace_files_of_another_kind(key, option, name, content, folder):
    (folder / NAME).write_text(PARABOLA)
    (folder / name).write_bytes(content)
    assert error("plan", NAME, option, name)["key"] == key
    assert (folder / name).read_bytes() == content


def test_a_heading_out_of_reach_is_named_as_a_heading() -> None:
    assert error("simulate", "ur5_servicer/table", "--heading", "90")["key"] == "heading"


def test_a_refused_map_makes_no_folder(tmp_path: Path) -> None:
    new = tmp_path / "new"
    assert error("map", "ets_vii/reach", "--touch", "2", "--plots", new)["key"] == "task"
    assert not new.exists()
    missing = tmp_path / "missing" / "new"
    assert error("map", "ets_vii/reach", "--plots", missing)["key"] == "plots"
