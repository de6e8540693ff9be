"""The command line: help, exit codes of errors, quiet output, colours and completion."""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from freefloat.cli import workspace
from freefloat.cli.app import app
from freefloat.cli.options import file_names, robot_names, scenario_names, study_names
from tests.commands import error, run, without_progress

PROGRAM = [sys.executable, "-m", "freefloat"]
GROUPS = {
    "Plan": ["plan", "simulate", "map", "batch"],
    "Look": ["view", "studio"],
    "Robot": ["info", "models", "assemble", "workspace", "singularities"],
    "Files": ["check", "export", "schema"],
}
SIMULATE = ("simulate", "planar_3dof/parabola_nonstop", "--heading", "200")


def test_the_help_lists_commands_in_four_groups_and_the_exit_codes() -> None:
    text = run("--help").stdout
    groups = re.findall(r"^╭─ (\w+) ─+╮\n(.*?)^╰", text, re.MULTILINE | re.DOTALL)
    assert {name: re.findall(r"│ (\w+)  ", rows) for name, rows in groups[1:]} == GROUPS
    assert "--debug" in text
    assert "Exit codes" in text


def test_every_command_has_an_example_and_help_of_its_options() -> None:
    for name, command in get_command(app).commands.items():
        assert f"Example: freefloat {name}" in command.help
        assert all(parameter.help for parameter in command.params)
    assert "--stretch" in run("plan", "--help").stdout


@pytest.mark.parametrize(
    ("words", "key", "suggestion"),
    [
        (("simulat",), "command", "simulate"),
        (("plan", "spatial_6dof/line", "--stretchh"), "--stretchh", "--stretch"),
        (("plan",), "scenario", ""),
        (("simulate", "planar_3dof/parabola", "--heading", "north"), "--heading", ""),
        (("map", "spatial_6dof/line", "--samples", "7"), "samples", ""),
        (("plan", "spatial_6dof/lin"), "scenario", "spatial_6dof/line"),
        (("info", "panar_3dof"), "robot", "planar_3dof"),
    ],
)
def test_a_wrong_command_line_is_one_error(words, key, suggestion):
    refusal = error(*words)
    assert refusal["key"] == key
    assert suggestion in refusal["problem"]


def test_an_unforeseen_exception_asks_for_a_report(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("of mine")

    monkeypatch.setattr(workspace, "Console", broken)
    result = run("workspace", "planar_3dof/parabola")
    assert (result.exit_code, result.stdout) == (3, "")
    (line,) = result.stderr.splitlines()
    assert "ZeroDivisionError: of mine" in line
    result = run("workspace", "planar_3dof/parabola", "--json")
    assert "internal error" in json.loads(result.stdout)["error"]["message"]
    result = run("--debug", "workspace", "planar_3dof/parabola")
    assert (result.exit_code, "Traceback" in result.stderr) == (3, True)


@pytest.mark.parametrize(
    ("failure", "key", "advice"),
    [(MemoryError(), "memory", "fewer"),
     (ImportError("no h5py", name="h5py"), "packages", "pip install --upgrade h5py")],
)  # fmt: skip
def test_what_the_machine_lacks_is_no_internal_error(failure, key, advice, monkeypatch):
    def lacking(*_: object) -> None:
        raise failure

    monkeypatch.setattr(workspace, "Console", lacking)
    refusal = error("workspace", "planar_3dof/parabola")
    assert refusal["key"] == key
    assert advice in refusal["accepted"]


@pytest.mark.slow
@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_exits_with_130(stop: signal.Signals, tmp_path: Path) -> None:
    words = ["map", "spatial_6dof/line", "--samples", "900000"]
    pipes: Any = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen([*PROGRAM, *words], cwd=tmp_path, **pipes) as process:
        assert process.stderr is not None
        progress = process.stderr.readline()  # now it computes
        process.send_signal(stop)
        stdout, rest = process.communicate(timeout=60)
    said = without_progress(progress + rest)
    assert (process.returncode, stdout, said) == (130, "", "freefloat: interrupted\n")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "command",
    [
        "models | head -1", "models >&-", "models --json > /dev/full",
    ],
)  # fmt: skip
def test_a_closed_or_full_stdout_gives_no_traceback(command: str, tmp_path: Path) -> None:
    line = f"{sys.executable} -m freefloat {command}"
    done = subprocess.run(
        line, shell=True, cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) <= 1


def test_quiet_prints_errors_and_documents_only(tmp_path: Path) -> None:
    result = run(*SIMULATE, "-q", "-o", tmp_path / "a.h5")
    assert (result.exit_code, result.output) == (0, "")
    assert (tmp_path / "a.h5").is_file()
    assert run("plan", "parabola", "--quiet").stderr
    assert "robots" in json.loads(run("models", "--quiet", "--json").stdout)


def test_tables_cut_no_value_in_narrow_terminals(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("freefloat.cli.console._PIPE_WIDTH", 50)
    printed = run("info", "planar_3dof/parabola").stdout
    assert "\N{HORIZONTAL ELLIPSIS}" not in printed
    assert max(map(len, printed.splitlines()[1:8])) <= 50


def completed(folder: Path, line: str) -> list[str]:
    """What bash offers for a command line."""
    words = line.split(" ")
    code = "from freefloat.cli.app import app; app(prog_name='freefloat')"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=True,
        env={**os.environ, "COMP_WORDS": line, "COMP_CWORD": str(len(words) - 1),
             "_FREEFLOAT_COMPLETE": "complete_bash"},
    )  # fmt: skip
    return done.stdout.split()


@pytest.mark.slow
def test_a_shell_completes_commands_bundled_names_and_files(tmp_path: Path) -> None:
    for name in ("spatial_mine.yaml", "spatial.txt", "arm.urdf"):
        (tmp_path / name).write_text("")
    assert completed(tmp_path, "freefloat sim") == ["simulate"]
    assert completed(tmp_path, "freefloat plan spatial") == [
        *("spatial_6dof/above", "spatial_6dof/around", "spatial_6dof/line", "spatial_mine.yaml")
    ]
    assert robot_names(f"{tmp_path}/ar") == [f"{tmp_path}/arm.urdf"]
    assert "example-robot-data:ur5" in robot_names("example-robot-data:ur")
    assert study_names("p") == ["planar_3dof/grid"]
    assert scenario_names("no/such/folder/a") == []
    assert file_names("planar_3dof/g") == ["planar_3dof/grid"]
