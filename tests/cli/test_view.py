"""``freefloat view`` and the pages of other commands."""

import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from matplotlib import rc_context
from PIL import Image, ImageSequence

import freefloat as ff
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.plan import Plan
from freefloat.planning.space.map_sampling import sample_attitudes
from freefloat.visualization import figures
from freefloat.visualization.figure_style import new_figure
from freefloat.visualization.page.pictures import find_browser
from tests.commands import document, error, run, without_progress

pytestmark = pytest.mark.usefixtures("folder")

browser_only = pytest.mark.skipif(find_browser() is None, reason="no Chromium or Chrome here")
GOOD = ("planar_3dof/parabola", "--heading", "200", "--branch", "0")
BAD = ("planar_3dof/parabola", "--heading", "140", "--branch", "0")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory, spatial: ff.Problem) -> Path:
    """A folder with a completed motion, a singular one, a plan without a motion, and a map."""
    folder = tmp_path_factory.mktemp("files")
    assert run("simulate", *GOOD, "-o", folder / "good.h5").exit_code == 0
    assert run("simulate", *BAD, "-o", folder / "bad.h5").exit_code == 1
    problem = ff.load_scenario("planar_3dof/parabola").problem()
    ff.save(Plan(problem, ff.Search(), False, "for a test"), folder / "none.h5")
    ff.save(sample_attitudes(FeasibilityEvaluator(spatial), 16), folder / "map.h5")
    return folder


def scenes(page: Path) -> list[str]:
    """Titles of the motions on a page."""
    about = re.search(r'"scenes": \[(.*)\]', page.read_text(encoding="utf-8"))
    assert about is not None
    return [json.loads(title) for title in re.findall(r'"title": ("[^"]*")', about[1])]


@pytest.mark.slow
def test_several_motions_become_one_page(files: Path, folder: Path) -> None:
    copies = ("good (2).h5", "Good.h5", "good.h5")
    for name in copies:
        (folder / name).write_bytes((files / "bad.h5").read_bytes())
    words = (files / "good.h5", *copies, files / "bad.h5", "-o", "p.html", "--scene", "bad")
    titles = ["good", "good (2)", "Good (3)", "good (4)", "bad"]
    assert document("view", *words) == {
        "address": None, "html": "p.html", "snapshots": [], "video": None,
        "figures": [], "scenes": titles, "remarks": [],
    }  # fmt: skip
    assert scenes(folder / "p.html") == titles
    assert '"opens": "bad"' in (folder / "p.html").read_text(encoding="utf-8")


@pytest.mark.slow
@browser_only
def test_pictures_and_a_video_show_the_motion_asked_for(files: Path, folder: Path) -> None:
    """In a separate process: Playwright starts once per process."""
    words = ["view", files / "good.h5", files / "bad.h5", "--snapshots", "3", "--video", "v.gif"]
    words += ["--size", "320x200", "--scene", "bad", "--fps", "2", "--speed", "50", "--json"]
    program = [sys.executable, "-m", "freefloat", *map(str, words)]
    done = subprocess.run(program, capture_output=True, text=True, check=False)
    assert (done.returncode, without_progress(done.stderr)) == (0, "")
    written = json.loads(done.stdout)
    last = ff.load(files / "bad.h5").chosen.motion.final.time
    names = [f"bad_{k + 1}_{time:.2f}s.png" for k, time in enumerate((0.0, last / 2, last))]
    assert written["snapshots"] == [f"bad_snapshots/{name}" for name in names]
    pictures = [np.asarray(Image.open(file).convert("RGB")) for file in written["snapshots"]]
    assert {picture.shape for picture in pictures} == {(200, 320, 3)}
    first, _, final = (picture.astype(int) for picture in pictures)
    assert (np.abs(first - final).sum(axis=2) > 60).sum() > 200
    count = int(np.ceil(last / 25.0)) + 1
    assert written["video"] == {
        "file": "v.gif", "pictures": count, "fps": 2.0, "speed": 50.0, "duration": count / 2,
    }  # fmt: skip
    with Image.open("v.gif") as film:
        frames = [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(film)]
    assert len(frames) == count
    for picture, frame in ((first, frames[0]), (final, frames[-1])):
        assert np.percentile(np.abs(picture - frame).max(axis=2), 99.9) < 16
    assert sorted(os.listdir(folder)) == ["bad_snapshots", "v.gif"]


@pytest.mark.parametrize(
    ("words", "key"),
    [
        (("--fps", "5"), "fps"),
        (("--size", "5x5000", "--snapshots", "1"), "size"),
        (("--scene", "x", "--snapshots", "1"), "scene"),
        (("-o", "page.pdf"), "output"),
    ],
)
def test_impossible_options_are_refused(words, key, files, folder):
    assert error("view", files / "map.h5", *words)["key"] == key
    assert [file for file in folder.rglob("*") if file.is_file()] == []


def test_files_without_a_motion_are_refused(files: Path, folder: Path) -> None:
    (folder / "text.h5").write_text("hello")
    for file in (files / "none.h5", "text.h5", "none.yaml"):
        assert error("view", files / "good.h5", file, "--html", "page.html")["key"] == "file"
    assert os.listdir(folder) == ["text.h5"]


@pytest.mark.slow
def test_a_map_is_viewed_alone(files: Path, folder: Path) -> None:
    """Its scenes are arm branches; nothing in it moves."""
    shown = document("view", files / "map.h5", "--html", "map.html")["scenes"]
    assert len(shown) > 1
    assert scenes(folder / "map.html") == shown
    assert error("view", files / "map.h5", "--video", "v.gif")["key"] == "video"
    assert error("view", files / "map.h5", "--snapshots", "2")["key"] == "snapshots"
    words = (files / "good.h5", files / "map.h5", "--html", "page.html")
    assert error("view", *words)["key"] == "file"


def started(*words: str | Path) -> subprocess.Popen[str]:
    """The process that serves a page, with a browser that ends with the standard input."""
    environment = {**os.environ, "BROWSER": "sh -c 'read line' %s"}
    program = [sys.executable, "-m", "freefloat", "view", *map(str, words)]
    pipes: dict[str, Any] = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    return subprocess.Popen(program, env=environment, text=True, **pipes)


def ask(port: int, host: str, path: str = "/") -> tuple[int, str]:
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=30)) as connection:
        connection.request("GET", path, headers={"Host": host})
        reply = connection.getresponse()
        return reply.status, reply.read().decode()


@pytest.mark.slow
def test_a_page_is_served_until_it_is_stopped(files: Path) -> None:
    """On a free port of 127.0.0.1, for requests that name this host; exit code 0, no noise."""
    with closing(socket.create_server(("127.0.0.1", 0))) as other:
        taken = other.getsockname()[1]
        with started(files / "good.h5", "--port", str(taken)) as process:
            assert process.stdout is not None
            address = urlsplit(process.stdout.readline().split()[0])
            port = address.port or 0
            assert address.hostname == "127.0.0.1"
            assert taken < port < taken + 20
            status, page = ask(port, f"localhost:{port}")
            assert status == 200
            assert '"title": "good"' in page
            assert ask(port, "evil.example")[0] == 403
            assert ask(port, f"127.0.0.1:{port}", "/etc/passwd")[0] == 404
            with socket.create_connection(("127.0.0.1", port), timeout=60) as half:
                half.sendall(b"GET / HT")
                assert half.recv(1) == b""  # closed: it would keep a thread
            process.send_signal(signal.SIGINT)
            rest, errors = process.communicate(timeout=60)
    assert (process.returncode, rest, without_progress(errors)) == (0, "", "")
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port), timeout=5)


@pytest.mark.slow
def test_simulate_writes_all_branches_on_a_page_the_chosen_one_first(folder: Path) -> None:
    """With the bodies that overlap where contact is no limit."""
    lines = run("models", "planar_2dof/line").stdout.replace("planar_2dof.urdf", "planar_2dof")
    scenario = re.sub(r"(?m)^limits:.*$", "limits: {clearance: off}", lines)
    Path("contact.yaml").write_text(scenario, encoding="utf-8")
    words = ("contact.yaml", "--heading", "330", "--branch", "1")
    result = run("simulate", *words, "-o", "motion.h5", "--html", "page.html")
    assert result.exit_code == 0
    assert "although link_2 overlaps spacecraft" in result.stderr
    assert scenes(folder / "page.html") == ["branch 1 elbow-", "branch 0 elbow+"]
    assert run("view", "motion.h5", "--html", "again.html").stderr == ""
    assert (folder / "again.html").read_bytes() == (folder / "page.html").read_bytes()


@pytest.mark.slow
def test_plan_writes_a_page_and_figures_into_a_new_folder(folder: Path, monkeypatch) -> None:
    monkeypatch.setattr(figures, "figures", lambda *_, **__: {"name": new_figure()})
    plan = document("plan", "planar_2dof/line", "--html", "page.html", "--plots", "b")
    assert plan["html"] == "page.html"
    assert len(scenes(folder / "page.html")) == 1
    assert plan["plots"] == ["b/name.pdf", "b/name.png"]
    assert all(Path(file).stat().st_size > 500 for file in plan["plots"])


@pytest.mark.slow
def test_figures_of_a_motion_and_of_several_beside_each_other(files, folder, monkeypatch):
    monkeypatch.setattr(figures, "figures", lambda *_, **__: {"name": new_figure()})
    (folder / "good.h5").write_bytes((files / "bad.h5").read_bytes())
    (figure, *_) = document("view", "good.h5", "--plots", "one")["figures"]
    assert Path(figure).parent == Path("one")
    written = {
        Path(name)
        for name in document("view", files / "good.h5", "good.h5", "--plots", "two")["figures"]
    }
    assert all(figure.stat().st_size > 500 for figure in written)
    assert {figure.parent.name for figure in written} == {"good", "good (2)", "two"}
    assert Path("two/comparison.pdf") in written


@pytest.mark.slow
def test_figures_need_no_latex_that_the_users_own_settings_ask_for(files: Path) -> None:
    """As a matplotlibrc of the user, or of the current folder, does."""
    with rc_context({"text.usetex": True, "text.latex.preamble": r"\input{secret}"}):
        drawn = document("view", files / "good.h5", "--plots", "out")["figures"]
    assert len(drawn) > 2
