"""``freefloat view`` as a user types it, and the pages of other commands."""

from __future__ import annotations

import gzip
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
from PIL import Image, ImageSequence
from typer.testing import CliRunner

import freefloat as ff
from freefloat.cli.app import app
from freefloat.io.plan_file import save_plan
from freefloat.planning.plan import Plan
from freefloat.visualization.stills import find_browser
from tests.scenarios import EASY

pytestmark = pytest.mark.usefixtures("kernels")

browser_only = pytest.mark.skipif(find_browser() is None, reason="no Chromium or Chrome here")
GOOD = ("planar_3dof/parabola", "--heading", "200", "--branch", "0")
BAD = ("planar_3dof/parabola", "--heading", "140", "--branch", "0")


def run(*words: str | Path) -> Any:
    return CliRunner().invoke(app, [str(word) for word in words])


def answer(*words: str | Path) -> dict[str, Any]:
    result = run(*words, "--json")
    assert (result.exit_code, result.stderr) == (0, ""), result.output
    return dict(json.loads(result.stdout))


def refusal(*words: str | Path) -> str:
    """The one line with which a command refuses its input."""
    result = run(*words)
    assert (result.exit_code, result.stdout) == (2, ""), result.output
    assert result.stderr.count("\n") == 1
    return str(result.stderr)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a motion that completes, one that becomes singular, and a plan without."""
    folder = tmp_path_factory.mktemp("files")
    assert run("simulate", *GOOD, "-o", folder / "good.h5").exit_code == 0
    assert run("simulate", *BAD, "-o", folder / "bad.h5").exit_code == 1
    scenario = ff.load_scenario("planar_3dof/parabola")
    plan = Plan(scenario.problem(), ff.Search(), False, "no heading keeps 149 beyond s = 0.3")
    save_plan(folder / "none.h5", plan, scenario, {"reason": plan.reason})
    return folder


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder that is neither the files' nor the checkout."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def scenes(page: Path) -> list[str]:
    """Titles of the motions on a page."""
    about = re.search(r'"scenes": \[(.*)\]', page.read_text(encoding="utf-8"))
    assert about is not None
    return [json.loads(title) for title in re.findall(r'"title": ("[^"]*")', about[1])]


# --- files --------------------------------------------------------------------------------------


def test_several_motions_become_one_page(files: Path, elsewhere: Path) -> None:
    words = ("--html", "both.html", "--scene", "bad")
    document = answer("view", files / "good.h5", files / "bad.h5", *words)
    assert '"opens": "bad"' in (elsewhere / "both.html").read_text(encoding="utf-8")
    assert document == {
        "address": None, "html": "both.html", "snapshots": [], "video": None,
        "scenes": ["good", "bad"], "remarks": [],
    }  # fmt: skip
    assert scenes(elsewhere / "both.html") == ["good", "bad"]
    assert os.listdir(elsewhere) == ["both.html"]


def test_files_of_the_same_name_are_told_apart(files: Path, elsewhere: Path) -> None:
    (elsewhere / "good.h5").write_bytes((files / "bad.h5").read_bytes())
    document = answer("view", files / "good.h5", "good.h5", files / "bad.h5", "--html", "p.html")
    assert document["scenes"] == scenes(elsewhere / "p.html") == ["good", "good (2)", "bad"]


@browser_only
def test_pictures_and_a_video_show_the_motion_asked_for(files: Path, elsewhere: Path) -> None:
    """Times in the names, the ending of the shorter motion last, the GIF's colours the page's."""
    words = ("--snapshots", "3", "--video", "v.gif", "--size", "480x300", "--scene", "bad")
    words = (*words, "--fps", "2", "--speed", "20")
    document = answer("view", files / "good.h5", files / "bad.h5", *words)
    last = json.loads(run("simulate", *BAD, "--json").stdout)["singular"]["time"]
    folder = Path("bad_snapshots")
    names = [f"bad_{k + 1}_{time:.2f}s.png" for k, time in enumerate((0.0, last / 2, last))]
    assert document["snapshots"] == [str(folder / name) for name in names]
    pictures = [np.asarray(Image.open(folder / name).convert("RGB")).astype(int) for name in names]
    assert {picture.shape for picture in pictures} == {(300, 480, 3)}
    assert (np.abs(pictures[0] - pictures[2]).sum(axis=2) > 60).sum() > 500  # it moved
    with Image.open("v.gif") as film:
        frames = [
            np.asarray(one.convert("RGB")).astype(int) for one in ImageSequence.Iterator(film)
        ]
    video, count = document["video"], int(np.ceil(last / 10.0)) + 1
    assert video == {"file": "v.gif", "pictures": count, "fps": 2.0, "speed": 20.0,
                     "duration": count / 2}  # fmt: skip
    assert len(frames) == count
    for picture, frame in ((pictures[0], frames[0]), (pictures[2], frames[-1])):
        off = np.abs(picture - frame).max(axis=2)
        assert np.percentile(off, 99.9) < 16
        assert off.max() < 60  # the bright end of the colour scale is a few pixels of all
    assert sorted(os.listdir(elsewhere)) == ["bad_snapshots", "v.gif"]


@browser_only
def test_a_map_can_be_pictured(elsewhere: Path) -> None:
    """Something bright is seen round the middle."""
    (elsewhere / "short.yaml").write_text(EASY)
    assert run("map", "short.yaml", "--samples", "64", "-o", "map.h5").exit_code == 0
    document = answer("view", "map.h5", "--snapshots", "1", "--size", "400x400")
    with Image.open(document["snapshots"][0]) as picture:
        pixels = np.asarray(picture.convert("RGB"))
    assert (pixels[100:300, 100:300].max(axis=2) > 120).sum() > 200


@browser_only
def test_pictures_of_all_motions_side_by_side(files: Path, elsewhere: Path) -> None:
    words = ("--snapshots", "1", "-o", "deep/er", "--scene", "side by side")
    result = run("view", files / "good.h5", files / "bad.h5", *words)
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout == "pictures: deep/er/side_by_side_1_0.00s.png\n"
    with Image.open("deep/er/side_by_side_1_0.00s.png") as picture:
        assert picture.size == (1280, 720)


def test_without_a_browser_nothing_is_begun(
    files: Path, elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(elsewhere))
    monkeypatch.delenv("CHROMIUM_BIN", raising=False)
    monkeypatch.setattr("freefloat.visualization.stills._NAMES", ("chromium", "google-chrome"))
    for words, key in ((("--snapshots", "3"), "snapshots"), (("--video", "v.gif"), "video")):
        told = refusal("view", files / "good.h5", "--html", "page.html", *words)
        assert told.startswith(f"freefloat: {key}: no Chromium or Chrome was found")
        assert "CHROMIUM_BIN" in told
    assert os.listdir(elsewhere) == []


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--fps", "5"), "fps: there is nothing that it could be of; accepted: --video, too"),
        (("--speed", "5", "--snapshots", "2"), "speed: there is nothing that it could be of"),
        (("-o", "folder", "--html", "p.html"), "output: there is nothing that it could be of"),
        (("--size", "10x10"), "accepted: --snapshots or --video, too"),
        (("--size", "big", "--snapshots", "1"), "size: 'big' was given; accepted: width and"),
        (("--size", "5x5000", "--snapshots", "1"), "size: 5x5000 was given; accepted: 16 to 4096"),
        (("--scene", "x", "--snapshots", "1"), "scene: there is no 'x'; accepted: good"),
        (("--video", "v.avi"), "video: v.avi is of no kind known here; accepted: a .gif or .mp4"),
        (("--html", "no/page.html"), "No such file or directory"),
        (("--snapshots", "1", "-o", "/dev/null/x"), "output: /dev/null/x: Not a directory"),
        (("--port", "70000"), "port: "),
        (("--snapshots", "0"), "snapshots: "),
    ],
)
def test_options_that_make_no_sense_are_refused(
    words: tuple[str, ...], told: str, files: Path, elsewhere: Path
) -> None:
    assert told in refusal("view", files / "good.h5", *words)
    assert os.listdir(elsewhere) == []


def test_files_without_a_motion_are_refused_with_the_reason(files: Path, elsewhere: Path) -> None:
    told = refusal("view", files / "good.h5", files / "none.h5", "--html", "page.html")
    assert f"{files / 'none.h5'}: file: there is no motion in it" in told
    assert "no heading keeps 149 beyond s = 0.3" in told
    (elsewhere / "text.h5").write_text("hello")
    assert "text.h5: file: it cannot be read" in refusal("view", "text.h5", "--html", "page.html")
    assert "none.yaml: file: no such file" in refusal("view", "none.yaml", "--html", "page.html")
    assert os.listdir(elsewhere) == ["text.h5"]


def test_a_map_is_looked_at_alone(files: Path, elsewhere: Path) -> None:
    """Its scenes are arm branches; nothing in it moves."""
    (elsewhere / "short.yaml").write_text(EASY)
    assert run("map", "short.yaml", "--samples", "64", "-o", "map.h5").exit_code == 0
    document = answer("view", "map.h5", "--html", "map.html")
    assert len(document["scenes"]) > 1
    assert scenes(elsewhere / "map.html") == document["scenes"]
    for words in (("--video", "v.gif"), ("--snapshots", "2")):
        assert "nothing moves there; accepted: --snapshots 1" in refusal("view", "map.h5", *words)
    told = refusal("view", files / "good.h5", "map.h5", "--html", "page.html")
    assert "map.h5: file: what it holds is of kind 'attitude map'" in told
    assert run("map", "planar_3dof/parabola", "--samples", "8", "-o", "flat.h5").exit_code == 0
    assert "map --plots" in refusal("view", "flat.h5", "--html", "page.html")
    assert sorted(os.listdir(elsewhere)) == ["flat.h5", "map.h5", "map.html", "short.yaml"]


# --- served -------------------------------------------------------------------------------------


def started(*words: str | Path) -> subprocess.Popen[str]:
    program = [sys.executable, "-m", "freefloat", "view", *map(str, words), "--no-open"]
    return subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def ask(port: int, host: str) -> tuple[int, bytes]:
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=30)) as connection:
        connection.request("GET", "/", headers={"Host": host, "Accept-Encoding": "gzip"})
        reply = connection.getresponse()
        return reply.status, reply.read()


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
def test_a_page_is_served_until_it_is_stopped(stop: signal.Signals, files: Path) -> None:
    """It says where, on a port that is free, and ends well: exit code 0, no noise."""
    with closing(socket.create_server(("127.0.0.1", 0))) as other:
        taken = other.getsockname()[1]
        with started(files / "good.h5", "--port", str(taken)) as process:
            assert process.stdout is not None
            line = process.stdout.readline()
            port = urlsplit(line.split()[0]).port or 0
            assert taken < port < taken + 20
            status, packed = ask(port, f"127.0.0.1:{port}")
            assert status == 200
            assert '"title": "good"' in gzip.decompress(packed).decode()
            assert ask(port, "evil.example")[0] == 403
            process.send_signal(stop)
            rest, errors = process.communicate(timeout=30)
    assert (process.returncode, rest, errors) == (0, "", "")
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port), timeout=5)


def test_machines_are_told_the_address_as_soon_as_it_is_there(files: Path) -> None:
    with started(files / "bad.h5", "--port", "0", "--json") as process:
        assert process.stdout is not None
        text = ""
        while not text.endswith("\n}\n"):
            text += process.stdout.readline()
        document = json.loads(text)
        port = urlsplit(document["address"]).port or 0
        assert ask(port, f"localhost:{port}")[0] == 200
        process.send_signal(signal.SIGINT)
        rest, errors = process.communicate(timeout=30)
    assert (process.returncode, rest, errors) == (0, "", "")
    assert document["scenes"] == ["bad"]


# --- pages of other commands --------------------------------------------------------------------


def test_simulate_writes_all_branches_on_a_page_the_followed_one_first(elsewhere: Path) -> None:
    words = ("planar_3dof/parabola", "--heading", "140", "--branch", "1")
    result = run("simulate", *words, "--html", "page.html")
    assert result.stderr == ""
    assert scenes(elsewhere / "page.html") == ["branch 1 elbow-", "branch 0 elbow+"]
    assert "<title>planar_3dof/parabola</title>" in (elsewhere / "page.html").read_text()


def test_plan_writes_a_page_of_its_motion_where_there_is_one(elsewhere: Path) -> None:
    result = run("plan", "planar_3dof/parabola_nonstop", "--html", "page.html")
    assert (result.exit_code, result.stderr) == (0, "")
    assert len(scenes(elsewhere / "page.html")) == 1
    hard = ff.load_scenario("planar_3dof/parabola_nonstop").text
    (elsewhere / "hard.yaml").write_text(hard.replace("value: 5", "value: 149"))
    assert run("plan", "hard.yaml", "--html", "none.html").exit_code == 1
    assert sorted(os.listdir(elsewhere)) == ["hard.yaml", "page.html"]
