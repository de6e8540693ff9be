"""``freefloat batch``: what is told and written, and that nothing is lost whatever is killed."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pyarrow.parquet
import pytest
from playwright.sync_api import Browser
from typer.testing import CliRunner

from freefloat.cli.app import app
from freefloat.io.plan_file import load_plan
from freefloat.robot.names import bundled_studies
from freefloat.studies.files import StudyFiles
from freefloat.studies.folder import study_folder
from freefloat.studies.study import load_study
from tests.example_studies import SHORT, TURNS, write_study

pytestmark = pytest.mark.usefixtures("kernels")

RANDOM = {"momentum.2": {"uniform": [-1, 1]}}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(autouse=True)
def ended_as_before() -> Iterator[None]:
    """The command changes what SIGTERM does to this process."""
    before = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, before)


def run(*words: str) -> Any:
    return CliRunner().invoke(app, ["batch", *words])


def answer(*words: str, code: int = 0) -> dict[str, Any]:
    result = run(*words, "--json")
    assert result.exit_code == code, result.output
    return dict(json.loads(result.stdout))


def journal(folder: Path) -> list[str]:
    """The whole lines of a journal."""
    file = folder / "journal.jsonl"
    return file.read_text().splitlines(keepends=True) if file.exists() else []


def table(folder: Path) -> dict[str, list[Any]]:
    return dict(pyarrow.parquet.read_table(folder / "cases.parquet").to_pydict())


def test_a_study_runs_goes_on_and_is_told(folder: Path, browser: Browser) -> None:
    """From three headings, one of which leads to a singularity; then the same again."""
    name = '<b id="trap">&amp;.yaml'
    write_study(folder, TURNS, branch=0).rename(name)
    document = answer(name, "-o", "out", "--workers", "1", "--report")
    assert document["verdicts"] == {"feasible": 2, "infeasible": 1, "error": 0}
    assert (document["cases"], document["computed"], document["reused"]) == (3, 3, 0)
    assert document["reasons"] == {"The arm became dynamically singular.": 1}
    found = table(folder / "out")
    assert found["heading_deg"] == [200.0, 140.0, 20.0]
    assert found["verdict"] == ["feasible", "infeasible", "feasible"]
    with (folder / "out" / "cases.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["margin"]) for row in rows] == found["margin"]
    for number, file in enumerate(found["file"]):
        stored = load_plan(folder / "out" / file)
        assert stored.document["min_margin"]["value"] == found["margin"][number]
    shows_the_report(browser, folder / "out" / "report.html", found)
    lines = journal(folder / "out")
    (folder / "out" / "cases.csv").unlink()
    again = answer(name, "-o", "out")
    assert (again["computed"], again["reused"]) == (0, 3)
    assert journal(folder / "out") == lines
    assert (folder / "out" / "cases.csv").exists()
    assert sorted(path.name for path in (folder / "out").iterdir()) == sorted(
        [".lock", "cases", "cases.csv", "cases.parquet", "journal.jsonl", "report.html",
         "study.json", "summary.pdf", "summary.png"]
    )  # fmt: skip


def shows_the_report(browser: Browser, page: Path, found: dict[str, list[Any]]) -> None:
    """The numbers on the page are those of the table; nothing is fetched, no name is obeyed."""
    context = browser.new_context(offline=True)
    shown, told, asked = context.new_page(), [], []
    shown.on("pageerror", lambda error: told.append(str(error)))
    shown.on("console", lambda message: told.append(message.text))
    shown.on("request", lambda request: asked.append(request.url.partition(":")[0]))
    shown.goto(page.as_uri())
    read = "name => document.querySelector(`[data-name='${name}'] b`).textContent"
    assert shown.evaluate(read, "cases") == "3 of 3"
    assert shown.evaluate(read, "feasible") == "2"
    assert shown.evaluate(read, "infeasible") == "1"
    assert shown.evaluate(read, "feasible share") == "66.67%"
    assert float(shown.evaluate(read, "largest margin")) == pytest.approx(
        max(found["margin"]), rel=1e-5
    )
    cells = shown.evaluate(
        "[...document.querySelectorAll('#cases tr')].map(r => [...r.cells].map(c => c.textContent))"
    )
    columns = dict(zip(cells[0], zip(*cells[1:], strict=True), strict=True))
    assert columns["verdict"] == ("feasible", "infeasible", "feasible")
    assert [float(value) for value in columns["margin"]] == pytest.approx(found["margin"], rel=1e-5)
    width = shown.evaluate("document.images[0].naturalWidth")
    assert width > 400
    assert shown.title() == '<b id="trap">&amp;'
    assert shown.evaluate("document.getElementById('trap')") is None
    assert set(asked) <= {"file", "data"}
    assert told == []
    context.close()


def test_poisoned_cases_are_told_and_the_others_answered(folder: Path) -> None:
    """Of 200 cases 20 have no way to the path, a broken robot, or a number that is none."""
    (folder / "bad.urdf").write_text("<robot><link")
    nan = float("nan")
    good: dict[str, Any] = {"momentum.2": 0.1, "x": 2, "robot.urdf": "planar_3dof"}
    poison = [{"x": 9}, {"robot.urdf": "bad.urdf"}, {"momentum.2": nan}, {"robot.urdf": "none"}]
    cases = [good | poison[k // 10 % 4] if k % 10 == 3 else good for k in range(200)]
    names = {"momentum.2": "momentum.2", "x": "path.polynomial.x.0", "robot.urdf": "robot.urdf"}
    vary = {key: {"list": [case[name] for case in cases]} for name, key in names.items()}
    write_study(folder, vary, base=SHORT, combine="zipped", files=False)
    result = run("study.yaml", "-o", "out", "--workers", "1")
    assert result.exit_code == 1
    (line,) = result.stderr.splitlines()
    assert line.startswith("freefloat: 20 of 200 cases ended in error, the first: case 3: ")
    found = table(folder / "out")
    failed = [number for number, error in enumerate(found["error"]) if error is not None]
    assert failed == [number for number in range(200) if number % 10 == 3]
    words = ("begins out of reach", "not well-formed", "nan was given", "no such file")
    for number in failed:
        assert words[number // 10 % 4] in found["error"][number]
    assert found["verdict"].count("feasible") == 180
    assert len(journal(folder / "out")) == 200


# --- killed -------------------------------------------------------------------------------------


def start(*words: str) -> subprocess.Popen[str]:
    """The command as a process, in a session of its own as on a terminal of its own."""
    command = [sys.executable, "-W", "error", "-m", "freefloat", "batch", *words]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )


def wait(until: Callable[[], bool], running: subprocess.Popen[str]) -> None:
    begin = time.monotonic()
    while not until():
        assert running.poll() is None, running.communicate()
        assert time.monotonic() - begin < 120.0
        time.sleep(0.01)


def workers(running: subprocess.Popen[str]) -> list[psutil.Process]:
    children = psutil.Process(running.pid).children(recursive=True)
    return [one for one in children if any("spawn_main" in word for word in one.cmdline())]


def test_whoever_is_killed_no_case_is_lost_or_run_twice(
    folder: Path, rng: np.random.Generator
) -> None:
    """The coordinator at three random moments, then a worker at three.

    What was in the journal stays, its times included; every case is there once, with its file.
    """
    count, out = 60, folder / "out"
    write_study(folder, RANDOM, base=SHORT, cases=count)
    words = ("study.yaml", "-o", "out", "--workers")
    for more in rng.integers(2, 8, 3):
        before, running = journal(out), start(*words, "1")
        wait(lambda: len(journal(out)) >= len(before) + more, running)  # noqa: B023
        time.sleep(rng.random() * 0.2)
        at_work = workers(running)
        running.kill()
        running.communicate()
        _, alive = psutil.wait_procs(at_work, timeout=20)
        assert alive == [], "workers end with their coordinator"
        assert journal(out)[: len(before)] == before
    before, running = journal(out), start(*words, "2", "--json")
    for more in (3, 6, 9):
        wait(lambda: len(journal(out)) >= len(before) + more, running)  # noqa: B023
        time.sleep(rng.random() * 0.1)
        at_work = workers(running)
        at_work[int(rng.integers(len(at_work)))].kill()
    told, errors = running.communicate(timeout=120)
    assert (running.returncode, errors) == (0, "")
    document = json.loads(told)
    whole = [line for line in before if line.endswith("\n")]
    assert document["reused"] == len(whole)
    assert journal(out)[: len(whole)] == whole
    rows = [json.loads(line) for line in journal(out)]
    assert sorted(row["case"] for row in rows) == list(range(count))
    assert table(out)["case"] == list(range(count))
    for row in rows:
        assert row["verdict"] == "feasible"
        assert load_plan(out / row["file"]).document["min_margin"]["value"] == row["margin"]
    assert len(list((out / "cases").iterdir())) == count


def test_an_interruption_while_workers_start_is_no_other(folder: Path) -> None:
    write_study(folder, RANDOM, base=SHORT, cases=5, files=False)
    running = start("study.yaml", "-o", "out", "--workers", "1")
    wait(lambda: bool(workers(running)), running)
    begin, at_work = time.monotonic(), workers(running)
    os.killpg(running.pid, signal.SIGINT)
    _, errors = running.communicate(timeout=30)
    assert time.monotonic() - begin < 5.0
    assert (running.returncode, len(errors.splitlines())) == (130, 2), errors
    _, alive = psutil.wait_procs(at_work, timeout=5)
    assert alive == []


def test_an_interruption_ends_soon_and_can_be_gone_on_from(folder: Path) -> None:
    """Ctrl-C reaches the workers, too: the whole group gets it."""
    write_study(folder, RANDOM, base=SHORT, cases=500, files=False)
    running = start("study.yaml", "-o", "out", "--workers", "1")
    wait(lambda: len(journal(folder / "out")) > 2, running)
    at_work = workers(running)
    begin = time.monotonic()
    os.killpg(running.pid, signal.SIGINT)
    told, errors = running.communicate(timeout=30)
    assert time.monotonic() - begin < 5.0
    assert running.returncode == 130
    assert told == ""
    assert errors.splitlines() == [
        "freefloat: the same command goes on where this one ended",
        "freefloat: interrupted",
    ]
    _, alive = psutil.wait_procs(at_work, timeout=5)
    assert alive == []
    rows = [json.loads(line) for line in journal(folder / "out")]
    assert len({row["case"] for row in rows}) == len(rows) < 500
    document = answer("study.yaml", "-o", "out", "--dry-run")
    assert (document["done"], document["timed"]) == (len(rows), "journal")


# --- told ---------------------------------------------------------------------------------------


def test_a_dry_run_lists_cases_and_estimates_without_writing(folder: Path) -> None:
    write_study(folder, RANDOM | {"timing.duration": {"list": [5, 6]}}, base=SHORT, cases=30)
    before = sorted(folder.iterdir())
    document = answer("study.yaml", "--dry-run", "--workers", "3")
    assert signal.getsignal(signal.SIGTERM) is signal.default_int_handler, "as Ctrl-C"
    assert [case["case"] for case in document["cases"]] == list(range(60))
    assert document["cases"][59]["parameters"]["timing.duration"] == 6
    assert document["timed"] == "the longer of cases 0 and 30"
    side_by_side = min(3, len(os.sched_getaffinity(0)))
    whole = document["start_up_seconds"] + document["seconds_each"] * 60 / side_by_side
    assert document["seconds"] == pytest.approx(whole)
    assert document["start_up_seconds"] >= 3.0
    result = run("study.yaml", "--dry-run")
    assert result.exit_code == 0
    assert "60 cases" in result.stdout
    assert "and 40 more" in result.stdout
    assert "60 to run, about" in result.stdout
    assert sorted(folder.iterdir()) == before


def test_a_dry_run_of_nothing_but_failures_says_so(folder: Path) -> None:
    write_study(folder, {"path.polynomial.x.0": {"list": [9, 10]}}, base=SHORT)
    document = answer("study.yaml", "--dry-run")
    assert document["seconds"] is None
    told = " ".join(run("study.yaml", "--dry-run").stdout.split())
    assert "no estimate: none of the first cases can be answered, case 0: " in told
    assert "begins out of reach" in told


@pytest.mark.parametrize("name", bundled_studies())
def test_every_bundled_study_can_be_listed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("freefloat.tasks.batching._timed", lambda *_: (1.0, "nothing"))
    document = answer(name, "--dry-run")
    assert document["count"] == len(document["cases"]) > 1


@pytest.mark.parametrize(
    ("words", "key"),
    [
        (["study.yaml"], "output"),
        (["nothing.yaml", "-o", "out"], "study"),
        (["study.yaml", "-o", "wish.yaml"], "output"),
        (["study.yaml", "-o", "out", "--workers", "2", "--scheduler", "tcp://a:1"], "workers"),
        (["study.yaml", "-o", "out", "--workers", "0"], "--workers"),
        (["broken.yaml", "-o", "out"], "vary.momentun.2"),
        (["odd.yaml", "-o", "out"], "urdf"),
    ],
)
def test_what_cannot_be_run_is_one_line_and_exit_code_2(
    words: list[str], key: str, folder: Path
) -> None:
    text = write_study(folder, RANDOM, base=SHORT, cases=3).read_text()
    (folder / "broken.yaml").write_text(text.replace("momentum", "momentun"))
    (folder / "odd.yaml").write_text(text.replace("wish.yaml", "far.yaml"))
    wish = (folder / "wish.yaml").read_text()
    (folder / "far.yaml").write_text(wish.replace("planar_3dof.urdf", "bad.urdf"))
    (folder / "bad.urdf").write_text("<robot><link")
    result = run(*words)
    assert result.exit_code == 2
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert f"{key}:" in line
    assert "; accepted: " in line
    document = json.loads(run(*words, "--json").stdout)
    assert document["error"]["message"] in line


def test_another_study_in_the_folder_is_refused(folder: Path) -> None:
    study = load_study(write_study(folder, TURNS, branch=0))
    with study_folder(folder / "out", study, StudyFiles.of(study)):
        pass
    before = {path: path.stat().st_mtime_ns for path in (folder / "out").rglob("*")}
    write_study(folder, TURNS, branch=1)
    result = run("study.yaml", "-o", "out")
    assert result.exit_code == 2
    assert "study.branch was 0, now 1" in result.stderr
    assert {path: path.stat().st_mtime_ns for path in (folder / "out").rglob("*")} == before


def test_the_schema_of_studies_is_told_beside_that_of_scenarios() -> None:
    document = json.loads(CliRunner().invoke(app, ["schema"]).stdout)
    assert list(document) == ["scenario", "study"]
    study = document["study"]
    assert study["$id"] == "urn:freefloat:study"
    assert study["required"] == ["base", "task", "vary"]
    assert set(study["properties"]) >= {"base", "task", "vary", "cases", "seed", "combine"}
    ways = study["$defs"]["DrawSection"]["properties"]
    assert list(ways) == ["list", "range", "grid", "uniform", "normal", "ball", "so3"]
