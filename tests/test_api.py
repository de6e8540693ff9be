"""What ``import freefloat as ff`` offers: documented names, its help, errors in notebooks."""

import doctest
import pydoc
import re
import shutil
import textwrap
from importlib.metadata import version

import numpy as np
import pytest

import freefloat as ff
from freefloat.planning.plan import Plan
from freefloat.robot.named_files import models_folder

SLOW = {
    "Weights",
    "plan_manoeuvre",
    "reorient",
    "track",
    "Search",
    "attitude_map",
    "check",
    "figures",
    "plan",
    "playback",
    "retime",
    "workspace_regions",
}
"""Names whose examples plan, draw or sample."""


@pytest.mark.parametrize("name", [
    pytest.param(name, marks=pytest.mark.slow if name in SLOW else ())
    for name in sorted({*ff.__all__} - {"paths", "run_study", "show"})
])  # fmt: skip
def test_the_example_of_a_docstring_prints_what_is_shown(name, folder):
    names = {"ff": ff, "np": np}
    text = getattr(ff, name).__doc__
    example = doctest.DocTestParser().get_doctest(text, names, name, None, None)
    outcome = doctest.DocTestRunner().run(example)
    assert outcome.attempted > 0
    assert outcome.failed == 0


def test_the_version_is_the_installed_one() -> None:
    assert ff.__version__ == version("freefloat")
    assert "__version__" not in ff.__all__
    with pytest.raises(AttributeError, match="__verson__"):
        _ = ff.__verson__


@pytest.mark.slow
def test_help_begins_with_ten_lines_that_run(tmp_path, monkeypatch, capsys):
    assert "ff.show(plan)" in pydoc.render_doc(ff, renderer=pydoc.plaintext)[:2500]
    (example,) = re.findall(r"::\n\n(.*?)\n\n(?=\S)", ff.__doc__ or "", re.DOTALL)
    code = textwrap.dedent(example)
    lines = [line for line in code.splitlines() if line and not line.startswith("import")]
    assert len(lines) == 10
    shutil.copy(models_folder() / "spatial_6dof" / "spatial_6dof.urdf", tmp_path / "robot.urdf")
    monkeypatch.chdir(tmp_path)
    shown: list[Plan] = []
    monkeypatch.setattr(ff, "show", shown.append)
    assert code.count("samples=1024") == 1
    exec(code.replace("samples=1024", "samples=16"), {})
    assert [plan.feasible for plan in shown] == [True]
    assert capsys.readouterr().out.startswith("the largest margin, det S* 0.09")


def test_a_notebook_shows_the_users_own_lines_and_what_is_accepted(capsys, monkeypatch):
    from IPython.core.interactiveshell import InteractiveShell

    monkeypatch.delenv("VIRTUAL_ENV", raising=False)  # IPython warns of another than its own
    shell = InteractiveShell()
    shell.run_cell("import freefloat as ff\n\nff.load_scenario('spatial_6dof/lin')")
    shown = re.sub(r"\x1b\[[\d;]*m", "", "".join(capsys.readouterr())).splitlines()
    assert any("ff.load_scenario('spatial_6dof/lin')" in line for line in shown)
    assert not any("bundled.py" in line or "scenario.py" in line for line in shown)
    *_, problem, accepted = [line for line in shown if line.strip()]
    assert problem.startswith("InputError: scenario: ")
    assert accepted.startswith("  accepted: ")
