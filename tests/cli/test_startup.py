"""What it costs to start, and what is loaded for it."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

import freefloat

HEAVY = ("matplotlib", "meshcat", "numba", "dask", "pinocchio", "scipy", "numpy", "pydantic")
"""What ``import freefloat`` has no use for."""
NEVER_NEEDED = ("matplotlib", "meshcat", "numba", "dask")
"""What none of the public names needs, but those in COMPILED and SHOWN."""
COMPILED = ("AttitudeMap", "FeasibilityEvaluator", "HeadingMap", "attitude_map")
SHOWN = ("Playback", "figures", "playback", "show")
SCRIPT = str(Path(sys.executable).parent / "freefloat")


def python(code: str, folder: Path) -> str:
    """The output of a fresh interpreter, in a folder that is not the checkout."""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout


def best_of_five(command: list[str], folder: Path) -> float:
    """Processor seconds of the fastest of five runs: what it costs, also on a busy machine."""
    seconds = []
    for _ in range(5):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(command, cwd=folder, capture_output=True, check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return min(seconds)


def test_importing_the_package_takes_less_than_half_a_second(tmp_path: Path) -> None:
    assert best_of_five([sys.executable, "-c", "import freefloat"], tmp_path) < 0.5


def test_help_appears_in_less_than_four_tenths_of_a_second(tmp_path: Path) -> None:
    assert best_of_five([SCRIPT, "--help"], tmp_path) < 0.4


def test_importing_the_package_loads_nothing_heavy(tmp_path: Path) -> None:
    loaded = python("import freefloat, sys; print('\\n'.join(sys.modules))", tmp_path).split()
    assert not set(HEAVY) & set(loaded)


def test_showing_help_loads_nothing_heavy(tmp_path: Path) -> None:
    code = (
        "import sys\n"
        "from typer.testing import CliRunner\n"
        "from freefloat.cli.app import app\n"
        "for command in ([], ['info'], ['simulate'], ['plan'], ['map'], ['view'], ['schema']):\n"
        "    assert CliRunner().invoke(app, [*command, '--help']).exit_code == 0\n"
        "print('\\n'.join(sys.modules))"
    )
    typers_own = {"pydantic"}
    assert not (set(HEAVY) - typers_own) & set(python(code, tmp_path).split())


def test_no_public_name_loads_figures_viewers_compilers_or_clusters(tmp_path: Path) -> None:
    names = sorted(set(freefloat.__all__) - {*COMPILED, *SHOWN})
    code = (
        "import freefloat, sys\n"
        f"for name in {names}: getattr(freefloat, name)\n"
        "print('\\n'.join(sys.modules))"
    )
    assert not set(NEVER_NEEDED) & set(python(code, tmp_path).split())


@pytest.mark.parametrize("name", freefloat.__all__)
def test_every_public_name_can_be_loaded_and_is_listed(name: str) -> None:
    loaded = getattr(freefloat, name)
    assert loaded.__module__.startswith("freefloat.")
    assert loaded.__name__ == name
    assert name in dir(freefloat)


def test_a_star_import_gives_every_public_name(tmp_path: Path) -> None:
    code = "from freefloat import *\nimport json\nprint(json.dumps(sorted(globals())))"
    assert set(freefloat.__all__) <= set(json.loads(python(code, tmp_path)))


def test_a_name_that_does_not_exist_is_refused_as_python_does() -> None:
    assert not hasattr(freefloat, "no_such_name")
    with pytest.raises(AttributeError, match=r"'freefloat' has no attribute 'no_such_name'"):
        _ = freefloat.no_such_name
    with pytest.raises(ImportError, match="no_such_name"):
        from freefloat import no_such_name  # noqa: F401


def test_every_module_imports_alone(tmp_path: Path) -> None:
    code = (
        "import importlib, json, pkgutil, sys\n"
        "import numpy, pinocchio, pydantic, scipy.integrate, scipy.optimize, typer\n"  # paid once
        "import freefloat\n"
        "names = [m.name for m in pkgutil.walk_packages(freefloat.__path__, 'freefloat.')]\n"
        "for name in names:\n"
        "    for loaded in [m for m in sys.modules if m.split('.')[0] == 'freefloat']:\n"
        "        del sys.modules[loaded]\n"
        "    if name != 'freefloat.__main__':\n"
        "        importlib.import_module(name)\n"
        "print(json.dumps(names))"
    )
    names = json.loads(python(code, tmp_path))
    rooms = {"errors", "machine.model", "scenario.scenario", "cli.entry", "__main__"}
    assert {f"freefloat.{room}" for room in rooms} <= set(names)


@pytest.mark.parametrize("command", [[SCRIPT], [sys.executable, "-m", "freefloat"]])
def test_the_command_tells_its_version_from_any_folder(command: list[str], tmp_path: Path) -> None:
    done = subprocess.run(
        [*command, "--version"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout.startswith("freefloat ")
    assert done.stderr == ""
    assert os.listdir(tmp_path) == []
