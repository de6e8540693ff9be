"""What is imported at the start."""

import subprocess
import sys
from pathlib import Path

import pytest

import freefloat

LOADED = "; print('\\n'.join(sys.modules))"
HELP = "from freefloat.cli.app import app; app(['plan', '--help'], standalone_mode=False)"
HEAVY = {"matplotlib", "meshcat", "numba", "dask", "pinocchio", "scipy", "numpy"}
BEGINNINGS = {
    "import freefloat": HEAVY | {"pydantic"},
    HELP: HEAVY,
    "import freefloat; freefloat.load_scenario('planar_2dof/line').search()":
        {"numba", "trimesh", "yourdfpy"},
}  # fmt: skip
"""What is run in the beginning, and what it does not import."""


def python(code: str, folder: Path) -> str:
    """The output of a fresh interpreter, in a folder that is not the checkout."""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize(("code", "absent"), BEGINNINGS.items())
def test_nothing_is_imported_before_it_is_needed(code, absent, tmp_path):
    assert not absent & set(python(f"import sys; {code}{LOADED}", tmp_path).split())


def test_every_public_name_can_be_imported_and_is_listed() -> None:
    assert set(freefloat.__all__) <= set(dir(freefloat))
    names: dict[str, object] = {}
    exec("from freefloat import *", names)
    assert set(freefloat.__all__) <= names.keys()
    for name in freefloat.__all__:
        loaded = getattr(freefloat, name)
        assert getattr(loaded, "__module__", loaded.__name__).startswith("freefloat.")
        assert loaded.__name__.removeprefix("freefloat.") == name
