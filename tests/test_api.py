"""What ``import freefloat as ff`` offers: names, words, short records, errors in notebooks."""

from __future__ import annotations

import inspect
import pydoc
import re
import shutil
import textwrap
from importlib.metadata import version
from pathlib import Path

import pytest

import freefloat as ff
from freefloat.motion.time_series import TimeSeries
from freefloat.planning.plan import Plan
from freefloat.planning.simulation import Simulation
from freefloat.robot.names import models_folder

pytestmark = pytest.mark.usefixtures("kernels")


@pytest.mark.parametrize("name", ff.__all__)
def test_every_public_name_has_words_and_types(name: str) -> None:
    public = getattr(ff, name)
    assert (public.__doc__ or "").strip().endswith((".", "`."))
    if inspect.isfunction(public):
        hints = inspect.signature(public)
        assert hints.return_annotation is not inspect.Signature.empty
        assert all(one.annotation is not one.empty for one in hints.parameters.values())


def test_the_version_is_the_installed_one() -> None:
    assert ff.__version__ == version("freefloat")
    assert "__version__" not in ff.__all__
    with pytest.raises(AttributeError, match="__verson__"):
        _ = ff.__verson__


def test_help_begins_with_ten_lines_that_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "ff.show(plan)" in pydoc.render_doc(ff, renderer=pydoc.plaintext)[:2500]
    found = re.search(r"::\n\n(.*?)\n\n(?=\S)", ff.__doc__ or "", re.DOTALL)
    assert found
    code = textwrap.dedent(found[1])
    lines = [line for line in code.splitlines() if line and not line.startswith("import")]
    assert len(lines) == 10
    shutil.copy(models_folder() / "spatial_6dof" / "spatial_6dof.urdf", tmp_path / "robot.urdf")
    monkeypatch.chdir(tmp_path)
    shown: list[Plan] = []
    monkeypatch.setattr(ff, "show", shown.append)
    assert code.count("samples=1024") == 1
    exec(code.replace("samples=1024", "samples=64"), {})
    assert [one.feasible for one in shown] == [True]
    assert capsys.readouterr().out.startswith("the largest margin, gjm 0.09")


# --- records ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    """Of Example 1, from a heading that serves."""
    problem = ff.load_scenario("planar_3dof/parabola_nonstop").problem()
    return ff.simulate(problem, [0.0, 0.0, 1.0, 0.0])


def test_records_are_told_in_one_line(simulation: Simulation) -> None:
    problem = simulation.chosen.motion.problem
    found = Plan(problem, ff.Search(), True, "it was there", chosen=simulation.chosen)
    study = ff.load_study("planar_3dof/grid")
    records = [
        *(simulation, *simulation.branches, simulation.chosen.motion, found, found.problem),
        *(found.problem.path, found.problem.path.path, found.problem.margin, found.problem.model),
        *(found.problem.margin.measure, ff.load_scenario("spatial_6dof/line"), study),
        *(simulation.chosen.motion.initial, ff.Search(), ff.Limits()),
        *(ff.playback(simulation.chosen.motion), TimeSeries.of(simulation.chosen.motion, [1.0])),
    ]
    for record in records:
        told = repr(record)
        assert told.startswith(f"{type(record).__name__}(")
        assert "\n" not in told
        assert len(told) < 600, told


# --- errors -------------------------------------------------------------------------------------


def test_a_notebook_shows_the_users_own_lines_and_what_is_accepted(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from IPython.core.interactiveshell import InteractiveShell

    monkeypatch.delenv("VIRTUAL_ENV", raising=False)  # IPython warns of another than its own
    shell = InteractiveShell()
    shell.run_cell("import freefloat as ff\n\nff.load_scenario('spatial_6dof/lin')")
    shown = re.sub(r"\x1b\[[\d;]*m", "", "".join(capsys.readouterr())).splitlines()
    assert any("ff.load_scenario('spatial_6dof/lin')" in line for line in shown)
    assert not any("names.py" in line or "scenario.py" in line for line in shown)
    *_, problem, accepted = [line for line in shown if line.strip()]
    assert problem == (
        "InputError: scenario: no such file or name: spatial_6dof/lin "
        "(did you mean spatial_6dof/line?)"
    )
    assert accepted.startswith("  accepted: a scenario file, or one of ets_vii/inspect")


def test_elsewhere_errors_keep_their_whole_traceback() -> None:
    with pytest.raises(ff.InputError) as caught:
        ff.load_scenario("nothing")
    assert any(Path(str(one.path)).name == "names.py" for one in caught.traceback)
    assert isinstance(caught.value, ff.FreeFloatError)
