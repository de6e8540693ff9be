"""What is imported at the start."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import freefloat

HEAVY = {"matplotlib", "meshcat", "numba", "dask", "pinocchio", "scipy", "numpy", "pydantic"}


def python(code: str, folder: Path) -> str:
    """The output of a fresh interpreter, in a folder that is not the checkout."""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    return done.stdout


def test_importing_the_package_imports_nothing_heavy(tmp_path: Path) -> None:
    loaded = python("import freefloat, sys; print('\\n'.join(sys.modules))", tmp_path)
    assert not HEAVY & set(loaded.split())


@pytest.mark.slow
def test_help_imports_nothing_heavy(tmp_path: Path) -> None:
    code = (
        "import sys\n"
        "from freefloat.cli.app import app\n"
        "try: app(['plan', '--help'])\n"
        "except SystemExit: print('\\n'.join(sys.modules))"
    )
    assert not (HEAVY - {"pydantic"}) & set(python(code, tmp_path).split())


@pytest.mark.slow
def test_a_scenario_is_read_without_kernels_and_meshes(tmp_path: Path) -> None:
    code = (
        "import sys, freefloat as ff\n"
        "ff.load_scenario('planar_2dof/line').search()\n"
        "print({'numba', 'trimesh', 'yourdfpy'}.isdisjoint(sys.modules))\n"
        "from freefloat import *\n"
        "print('\\n'.join(globals()))"
    )
    light, *names = python(code, tmp_path).split()
    assert light == "True"
    assert set(freefloat.__all__) <= set(names)


def test_every_public_name_can_be_imported_and_is_listed() -> None:
    assert set(freefloat.__all__) <= set(dir(freefloat))
    for name in freefloat.__all__:
        loaded = getattr(freefloat, name)
        assert getattr(loaded, "__module__", loaded.__name__).startswith("freefloat.")
        assert loaded.__name__.removeprefix("freefloat.") == name
