"""What is imported at the start."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import freefloat
from tests.samples import plans

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


def test_help_imports_nothing_heavy(tmp_path: Path) -> None:
    code = (
        "import sys\n"
        "from freefloat.cli.app import app\n"
        "try: app(['plan', '--help'])\n"
        "except SystemExit: print('\\n'.join(sys.modules))"
    )
    assert not (HEAVY - {"pydantic"}) & set(python(code, tmp_path).split())


@pytest.mark.slow
def test_a_scenario_is_read_without_compiled_kernels(tmp_path: Path) -> None:
    code = (
        "import sys, freefloat as ff\n"
        "ff.load_scenario('planar_2dof/line').search()\n"
        "print('numba' in sys.modules)\n"
        "from freefloat import *\n"
        "print('\\n'.join(globals()))"
    )
    compiled, *names = python(code, tmp_path).split()
    assert compiled == "False"
    assert set(freefloat.__all__) <= set(names)


def test_every_public_name_can_be_imported_and_is_listed() -> None:
    assert set(freefloat.__all__) <= set(dir(freefloat))
    for name in freefloat.__all__:
        loaded = getattr(freefloat, name)
        assert getattr(loaded, "__module__", loaded.__name__).startswith("freefloat.")
        assert loaded.__name__.removeprefix("freefloat.") == name


@pytest.mark.slow
def test_a_file_is_loaded_without_compiled_kernels(tmp_path: Path) -> None:
    code = (
        "import sys, freefloat as ff\n"
        "for name in ('motion.h5', 'plan.h5'): ff.load(name)\n"
        "print('\\n'.join(sys.modules))"
    )
    for name, content in zip(("motion.h5", "plan.h5"), plans(), strict=True):
        (tmp_path / name).write_bytes(content)
    assert "numba" not in python(code, tmp_path).split()


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError):
        _ = freefloat.no_such_name
