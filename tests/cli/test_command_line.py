"""What all commands share: where to begin, what is suggested, completed, hushed and coloured."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command
from typer.testing import CliRunner

from freefloat.cli.app import app
from freefloat.cli.catalogue import bundled_file, catalogue
from freefloat.io.scenario import load_scenario
from freefloat.robot.names import bundled_robots, bundled_scenarios, bundled_studies
from freefloat.studies.study import load_study

pytestmark = pytest.mark.usefixtures("kernels")

SCRIPT = str(Path(sys.executable).parent / "freefloat")
COMMANDS = (
    *("models", "info", "workspace", "simulate", "plan", "map", "view", "check", "export"),
    *("assemble", "batch", "schema"),
)
RUN = ("simulate", "planar_3dof/parabola_nonstop", "--heading", "200")


def run(*words: str) -> Any:
    """The result of a command, run in this process."""
    return CliRunner().invoke(app, list(words))


# --- where to begin -----------------------------------------------------------------------------


def test_alone_it_tells_three_commands_to_begin_with() -> None:
    result = run()
    assert result.exit_code == 0
    begun = re.findall(r"^  freefloat (\S+)", result.stdout, re.MULTILINE)
    assert begun == ["models", "plan", "view"]
    assert len(result.stdout.splitlines()) < 12


def test_the_version_is_the_one_installed() -> None:
    assert run("--version").stdout == f"freefloat {version('freefloat')}\n"


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_of_a_command_has_an_example_that_names_it(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    result = run(name, "--help")
    assert result.exit_code == 0
    assert f"Example: freefloat {name}" in result.stdout
    assert "--quiet" in result.stdout


def test_help_shows_its_words_whole_brackets_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "300")
    shown = {name: run(name, "--help").stdout for name in COMMANDS}
    assert "pip install 'freefloat[mujoco]'." in shown["check"]
    for name, command in get_command(app).commands.items():
        for parameter in command.params:
            words = (parameter.help or "").replace("\\[", "[")
            assert words in " ".join(shown[name].split()), (name, words)


def test_the_help_lists_every_command() -> None:
    text = run("--help").stdout
    listed = [name for name in COMMANDS if re.search(rf"│ {name} ", text)]
    assert listed == list(COMMANDS)


def test_help_fills_the_lines_of_the_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "160")
    text = run("plan", "--help").stdout
    assert "in space a grid over all attitudes is followed (search.samples in the" in text


# --- models -------------------------------------------------------------------------------------


def test_models_lists_all_that_is_bundled_with_a_line_on_each() -> None:
    document = json.loads(run("models", "--json").stdout)
    for group, names in (
        ("robots", bundled_robots()),
        ("scenarios", bundled_scenarios()),
        ("studies", bundled_studies()),
    ):
        assert [one["name"] for one in document[group]] == list(names)
        for one in document[group]:
            assert 20 < len(one["description"]) < 140
            assert one["description"].endswith((".", "?"))
            assert Path(one["file"]).is_file()
    assert all(re.search(r"\d{4}|Transactions", one["source"]) for one in document["robots"])


def test_models_names_the_robot_of_a_scenario_and_the_base_of_a_study() -> None:
    document = catalogue()
    robots = {one["name"]: one["robot"] for one in document["scenarios"]}
    assert robots["spatial_6dof/line"] == "spatial_6dof"
    assert robots["ur5_servicer/arc"] == "example-robot-data:ur5"
    bases = {one["name"]: one["base"] for one in document["studies"]}
    assert bases["spatial_6dof/montecarlo"] == "spatial_6dof/line"
    assert set(bases.values()) <= set(bundled_scenarios())


def test_models_tells_people_names_that_can_be_copied() -> None:
    text = run("models").stdout
    for name in (*bundled_robots(), *bundled_scenarios(), *bundled_studies()):
        assert f" {name} " in text


@pytest.mark.parametrize("name", ["spatial_6dof/line", "spatial_6dof/montecarlo", "ssrms"])
def test_models_prints_the_file_of_a_name_and_nothing_else(name: str) -> None:
    (entry,) = [one for group in catalogue().values() for one in group if one["name"] == name]
    text = Path(entry["file"]).read_text(encoding="utf-8")
    for words in (("models", name), ("models", name, "--quiet")):
        assert run(*words).stdout == text
    assert json.loads(run("models", name, "--json").stdout) == entry | {"text": text}


def test_a_copy_of_a_bundled_file_works_in_any_folder(tmp_path: Path) -> None:
    copy = tmp_path / "mine.yaml"
    for name in bundled_scenarios():
        copy.write_text(bundled_file(name)["text"], encoding="utf-8")
        assert load_scenario(copy).urdf() == load_scenario(name).urdf()
    for name in bundled_studies():
        copy.write_text(bundled_file(name)["text"], encoding="utf-8")
        assert load_study(copy).base == load_study(name).base


def test_models_tells_the_name_that_was_meant() -> None:
    result = run("models", "spatial_6dof/lien", "--json")
    error = json.loads(result.stdout)["error"]
    assert result.exit_code == 2
    assert error["key"] == "name"
    assert "did you mean spatial_6dof/line?" in error["problem"]
    assert all(name in error["accepted"] for name in ("ssrms", "spatial_6dof/montecarlo"))
    assert run("models", "spatial_6dof/lien").stdout == ""


# --- misspelt -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "suggested"),
    [
        (("simulat",), "simulate"),
        (("modles",), "models"),
        (("plan", "spatial_6dof/line", "--jsn"), "--json"),
        (("map", "spatial_6dof/line", "--sample", "9"), "--samples"),
        (("plan", "spatial_6dof/lin"), "spatial_6dof/line"),
        (("plan", "parabola"), "planar_3dof/parabola"),
        (("info", "panar_3dof"), "planar_3dof"),
        (("batch", "spatial_6dof/montecalro", "-o", "d"), "spatial_6dof/montecarlo"),
        (("info", "example-robot-data:ur5", "--end-effector", "tool"), "tool0"),
    ],
)
def test_the_nearest_name_is_suggested(words: tuple[str, ...], suggested: str) -> None:
    result = run(*words)
    assert result.exit_code == 2
    assert f"(did you mean {suggested}?)" in result.stderr
    assert len(result.stderr.splitlines()) == 1


@pytest.mark.parametrize("words", [("xqzw",), ("plan", "zz/zz"), ("plan", "a", "--zzzz")])
def test_nothing_is_suggested_where_nothing_is_near(words: tuple[str, ...]) -> None:
    result = run(*words)
    assert result.exit_code == 2
    assert "did you mean" not in result.stderr


SCENARIO = """\
robot: {urdf: planar_2dof.urdf, end_effector: end_effector}
task: planar-position
path:
  line: {from: [1.9, 0.2, 0], to: [0.5, 1.2, 0]}
timing: {law: quintic, duration: 30}
margin: {measure: system, fraction: 0.1}
limits: {joint_rate: {q1: 0.25}}
"""


@pytest.mark.parametrize(
    ("old", "new", "suggested"),
    [
        ("duration: 30", "durration: 30", "duration"),
        ("margin:", "margn:", "margin"),
        ("measure: system", "measure: sytem", "system"),
        ("planar-position", "planar-positon", "planar-position"),
        ("law: quintic", "law: quntic", "quintic"),
        ("q1: 0.25", "q11: 0.25", "q1"),
        ("end_effector: end_effector", "end_effector: end_efector", "end_effector"),
    ],
)
def test_the_nearest_key_or_word_of_a_scenario_is_suggested(
    old: str, new: str, suggested: str, tmp_path: Path
) -> None:
    assert SCENARIO.count(old) == 1
    (tmp_path / "wish.yaml").write_text(SCENARIO.replace(old, new))
    result = run("simulate", str(tmp_path / "wish.yaml"), "--heading", "0")
    assert result.exit_code == 2
    assert f"(did you mean {suggested}?)" in result.stderr


def test_the_nearest_key_of_a_study_is_suggested(tmp_path: Path) -> None:
    (tmp_path / "study.yaml").write_text(
        "base: planar_2dof/line\ncommand: plan\nvary: {timing.duraton: {list: [1, 2]}}\n"
    )
    result = run("batch", str(tmp_path / "study.yaml"), "--dry-run")
    assert "(did you mean duration?)" in result.stderr


# --- quiet, pipes and colours -------------------------------------------------------------------


def test_quiet_says_nothing_but_writes_and_answers_by_exit_code(tmp_path: Path) -> None:
    result = run(*RUN, "-q", "-o", str(tmp_path / "a.h5"))
    assert (result.exit_code, result.output) == (0, "")
    assert (tmp_path / "a.h5").is_file()
    lost = run("simulate", RUN[1], "--heading", "140", "--branch", "0", "--quiet")
    assert (lost.exit_code, lost.output) == (1, "")


def test_quiet_leaves_errors_and_what_was_asked_for() -> None:
    assert "did you mean" in run("plan", "parabola", "--quiet").stderr
    assert "robots" in json.loads(run("models", "--quiet", "--json").stdout)
    assert run("models").stdout, "a quiet command hushed the next one"


def test_tables_are_the_same_in_a_pipe_with_colours_and_without(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    for name in ("FORCE_COLOR", "NO_COLOR"):
        monkeypatch.delenv(name, raising=False)
    plain = run(*RUN)
    monkeypatch.setenv("FORCE_COLOR", "1")
    coloured = CliRunner().invoke(app, list(RUN), color=True)
    monkeypatch.setenv("NO_COLOR", "1")
    refused = CliRunner().invoke(app, list(RUN), color=True)
    assert "\x1b" not in plain.stdout
    assert "\x1b[32mcompletes\x1b[0m" in coloured.stdout
    assert re.sub(r"\x1b\[[\d;]*m", "", coloured.stdout) == plain.stdout
    assert "\x1b[32m" not in refused.stdout
    assert plain.stderr == coloured.stderr == "", "progress goes to terminals alone"


# --- completion ---------------------------------------------------------------------------------


def completed(folder: Path, line: str) -> list[str]:
    """What bash would offer for a command line half written."""
    words = line.split(" ")
    done = subprocess.run(
        [SCRIPT], cwd=folder, capture_output=True, text=True, check=True,
        env={**os.environ, "COMP_WORDS": line, "COMP_CWORD": str(len(words) - 1),
             "_FREEFLOAT_COMPLETE": "complete_bash"},
    )  # fmt: skip
    return done.stdout.split()


def test_a_shell_completes_commands_bundled_names_and_files(tmp_path: Path) -> None:
    for name in ("spatial_mine.yaml", "spatial.txt", "other.yaml", "arm.urdf"):
        (tmp_path / name).write_text("")
    assert completed(tmp_path, "freefloat sim") == ["simulate"]
    assert completed(tmp_path, "freefloat plan spatial") == [
        *("spatial_6dof/above", "spatial_6dof/line", "spatial_mine.yaml")
    ]
    assert completed(tmp_path, "freefloat info ssr") == ["ssrms", "ssrms/sweep", "ssrms/transfer"]
    assert completed(tmp_path, "freefloat info ar") == ["arm.urdf"]
    assert completed(tmp_path, "freefloat batch p") == ["planar_3dof/grid"]


def test_a_word_in_a_folder_that_is_not_there_completes_to_nothing() -> None:
    from freefloat.cli.completion import scenario_names

    assert scenario_names("no/such/folder/a") == []


def test_what_models_prints_is_completed_whatever_it_is() -> None:
    from freefloat.cli.completion import bundled_names

    assert bundled_names("planar_3dof/g") == ["planar_3dof/grid"]
    assert bundled_names("planar_3")[:2] == ["planar_3dof", "planar_3dof/parabola"]
