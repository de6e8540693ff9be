"""Malicious and damaged files are read, or refused in one message, without other effects.

``scripts/lab/fuzz.py`` does so with mutated files of every kind; a test of CONTRIBUTING runs it.
"""

import html
import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import h5py
import lxml.html
import numpy as np
import pytest

import freefloat as ff
from freefloat.paths.samples import samples_text
from freefloat.robot.meshes import read_mesh
from freefloat.robot.source import MeshFileError, find_mesh
from freefloat.robot.validation import examine
from freefloat.so3 import heading_quaternion
from tests import samples as good
from tests.errors import error_key
from tests.example_studies import write_study
from tests.result_files import with_digest


@pytest.fixture
def folder(folder: Path) -> Path:
    """A working folder with a file that never ends and a pipe."""
    (folder / "zero").symlink_to("/dev/zero")
    os.mkfifo(folder / "fifo")
    return folder


# URDFs

THIEF = '<!DOCTYPE robot [<!ENTITY a SYSTEM "file:///etc/passwd">]><robot name="x">&a;</robot>'


@pytest.mark.parametrize(
    "text",
    [
        THIEF,
        "<robot>" + "<a>" * 100_000,
        "<robot>" + '<link name="z"/>' * 30_000 + "</robot>",
        good.bundled("planar_3dof")[0].decode().replace('"400"', '"1e300"'),
    ],
    ids=["thief", "deep", "many", "huge"],
)
def test_urdfs_that_would_cost_too_much_are_refused(text: str) -> None:
    begin = time.process_time()
    with pytest.raises(ff.InputError):
        ff.FreeFloatingModel.from_urdf(text)
    examine(text)
    assert time.process_time() - begin < 3.0


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("name", ["fifo", "zero"])
def test_devices_and_pipes_are_not_read(name: str) -> None:
    for read, error in (
        (lambda: samples_text(name), ff.InputError),
        (lambda: ff.FreeFloatingModel.from_urdf(Path(name)), ff.InputError),
        (lambda: find_mesh(name, "robot.urdf"), MeshFileError),
    ):
        with pytest.raises(error):
            read()


# Studies


def test_studies_that_would_take_all_memory_are_refused_at_once(tmp_path: Path) -> None:
    many = {f"robot.held.q{n}": {"range": [0, 1, 1e-6]} for n in range(100)}
    assert error_key(ff.load_study, write_study(tmp_path, many)).startswith("vary")
    wide = {"momentum": {"grid": {"from": [0] * 99, "to": [1] * 99, "count": [10**6] + [1] * 98}}}
    assert error_key(ff.load_study, write_study(tmp_path, wide)).startswith("vary")


# Meshes


@pytest.mark.parametrize(("name", "content"), [
    ("a.dae", good.meshes()[4].replace(b"<COLLADA", b"<!DOCTYPE x><COLLADA", 1)),
    ("a.zip", b"PK"),
    ("a.svg", b"<svg/>"),
    ("a.glb", good.meshes()[3][:12] + b"\xff\xff\xff\x7f" + good.meshes()[3][16:]),
    ("a.ply", good.meshes()[2][:-4] + b"\xff\xff\xff\x7f"),
    ("a.obj", good.meshes()[5].replace(b"v ", b"v 1e200", 1)),
])  # fmt: skip
def test_invalid_meshes_are_refused(name: str, content: bytes, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(MeshFileError):
        read_mesh(tmp_path / name)


# Result files


def sealed(path: Path, write: Callable[[h5py.File], object]) -> Path:
    """An HDF5 file of any content with the digest that result files have."""
    with h5py.File(path, "w") as file:
        write(file)
    path.write_bytes(with_digest(path.read_bytes()))
    return path


def many_paths(file: h5py.File) -> None:
    """14 groups, each with 11 names of the next one: 11^13 paths."""
    groups = [file.create_group(f"group {k}") for k in range(14)]
    for outer, inner in pairwise(groups):
        for name in range(11):
            outer[str(name)] = inner


def many_bytes(file: h5py.File) -> None:
    """3,000 datasets that state 50 MB each, and hold nothing."""
    for name in range(3000):
        file.create_dataset(str(name), (6_000_000,), float, chunks=(6_000_000,))


def many_texts(file: h5py.File) -> None:
    """3,000 references to one text of 4 MB."""
    file["text"] = np.array(["x" * 4_000_000, *3000 * ["y"]], dtype=object)
    place = file["text"].id.get_offset()
    file.flush()
    with open(file.filename, "r+b") as raw:
        raw.seek(place)  # of 16 bytes for each text: length, address and index in the heap
        reference = raw.read(16)
        raw.write(3000 * reference)


LOAD = """
import resource, sys
import freefloat as ff
def largest():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
before = largest()
resource.setrlimit(resource.RLIMIT_AS, (3 << 30, 3 << 30))
try:
    ff.load(sys.argv[1])
except ff.InputError:
    print(largest() - before)
"""
"""Prints the memory that refusing a file takes [kB]."""


@pytest.mark.slow
@pytest.mark.parametrize("write", [many_paths, many_bytes, many_texts])
def test_small_result_files_that_expand_are_refused(write, tmp_path):
    file = sealed(tmp_path / "small.h5", write)
    done = subprocess.run(
        [sys.executable, "-c", LOAD, str(file)], timeout=600, capture_output=True, text=True
    )
    assert done.stderr == ""
    assert int(done.stdout) < 1_000_000


# Pages


@pytest.mark.slow
def test_names_in_a_robot_stay_names_on_its_page() -> None:
    pages, problem = [], ff.load_scenario("planar_3dof/parabola").problem()
    for name in ("", good.NAME):
        text = good.bundled("planar_3dof")[0].decode()
        for part in ("planar_3dof", "spacecraft", "link_1", "q1", "solar"):
            text = text.replace(f'"{part}"', f'"{part}{html.escape(name)}"')
        robot = replace(problem, model=ff.FreeFloatingModel.from_urdf(text, "end_effector"))
        motion = ff.simulate(robot, heading_quaternion(np.radians(200.0)), branch=0).chosen.motion
        page = ff.playback({f"a{name}": motion}, title=f"b{name}").html()
        pages.append(lxml.html.fromstring(page, parser=lxml.html.HTMLParser(huge_tree=True)))
    plain, hostile = (Counter(element.tag for element in page.iter()) for page in pages)
    assert plain == hostile
    assert pages[1].xpath("//@*[starts-with(name(), 'on')]") == []
