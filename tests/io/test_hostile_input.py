"""Malicious and damaged files are read, or refused in one message, without other effects.

``scripts/fuzz.py``, which a test of CONTRIBUTING runs, does so with mutated files of every kind.
"""

from __future__ import annotations

import html
import os
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import lxml.html
import numpy as np
import pytest

from freefloat.errors import InputError
from freefloat.io.scenario.scenario import load_scenario
from freefloat.paths.path import parse_samples, samples_text
from freefloat.planning.simulation import simulate
from freefloat.robot.meshes import read_mesh
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.names import MeshFileError, find_mesh
from freefloat.robot.validation import examine
from freefloat.so3 import heading_quaternion
from freefloat.studies.study import load_study
from freefloat.visualization.page.playback import playback
from tests import hostile_samples as good
from tests.example_studies import BASE, write_study
from tests.hostile import KINDS, READ, Watch, outcome
from tests.scenarios import PARABOLA


@pytest.fixture
def watch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Watch]:
    """Working folders, and the actions outside them."""
    for kind in KINDS.values():
        kind.samples()  # made outside
    watch = Watch(tmp_path)
    monkeypatch.chdir(watch.inside)
    yield watch
    watch.close()


@pytest.mark.parametrize("kind", KINDS)
def test_files_that_mutations_begin_with_are_read(kind: str, watch: Watch) -> None:
    for content in KINDS[kind].samples():
        result, message = outcome(KINDS[kind], content, watch)
        assert result == READ, message


def test_actions_outside_the_folder_are_noticed(watch: Watch, tmp_path: Path) -> None:
    (watch.inside / "mine").write_text("inside")
    assert watch.actions() == []
    (tmp_path / "outside" / "pwned").write_text("outside")
    os.system("true")
    actions = " ".join(watch.actions())
    assert all(word in actions for word in ("pwned", "os.system", "was changed"))


# URDFs

LAUGHS = '<!DOCTYPE robot [<!ENTITY a "ha"><!ENTITY b "&a;&a;">]><robot name="&b;"/>'
THIEF = '<!DOCTYPE robot [<!ENTITY a SYSTEM "file:///etc/passwd">]><robot name="x">&a;</robot>'


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (LAUGHS, "DTD"),
        (THIEF, "DTD"),
        ('<?xml version="1.0" encoding="nonsense"?><robot/>', "robot: "),
        ("<robot>" + "<a>" * 100_000, "well-formed"),
        ("<robot>" + '<link name="z"/>' * 30_000 + "</robot>", "30,000 links"),
        (good.bundled("planar_3dof")[0].decode().replace('"400"', '"1e300"'), "mass value"),
    ],
    ids=["laughs", "thief", "encoding", "deep", "many", "huge"],
)
def test_urdfs_that_would_cost_too_much_are_refused(text: str, problem: str) -> None:
    begin = time.process_time()
    with pytest.raises(InputError, match=problem):
        FreeFloatingModel.from_urdf(text)
    examine(text)
    assert time.process_time() - begin < 3.0


def test_a_chain_of_a_hundred_joints_is_examined_at_once() -> None:
    chain = "".join(
        f'<link name="l{n}"/><joint name="j{n}" type="continuous"><parent link="l{n}"/>'
        f'<child link="l{n + 1}"/><origin xyz="0 0 1"/></joint>'
        for n in range(490)
    )
    begin = time.process_time()
    examine(f'<robot name="x">{chain}<link name="l490"/></robot>')
    assert time.process_time() - begin < 3.0


@pytest.mark.parametrize("name", ["file://[", "package://[/x", "file://\u2100/x"])
def test_names_of_meshes_that_are_no_addresses_are_refused(name: str) -> None:
    with pytest.raises(MeshFileError, match="no address"):
        find_mesh(name, "robot.urdf")


def test_devices_and_pipes_are_not_read(watch: Watch) -> None:
    """They never end."""
    for name in ("fifo", "zero"):
        with pytest.raises(InputError, match="file"):
            parse_samples(samples_text(name), name)
        with pytest.raises(InputError, match="file"):
            FreeFloatingModel.from_urdf(Path(name))
        with pytest.raises(MeshFileError, match="no such file"):
            find_mesh(name, str(watch.inside / "robot.urdf"))


# Scenarios and studies


def test_no_yaml_runs_code(watch: Watch) -> None:
    file = watch.inside / "evil.yaml"
    for text in ("!!python/object/apply:os.system [touch ../outside/pwned]", "&a [*a, *a]"):
        file.write_text(PARABOLA.replace("planar-pose", text))
        with pytest.raises(InputError, match=r"tag|alias"):
            load_scenario(file)
    assert watch.actions() == []


def test_studies_that_would_take_all_memory_are_refused_at_once(tmp_path: Path) -> None:
    many = {f"robot.held.q{n}": {"range": [0, 1, 1e-6]} for n in range(100)}
    with pytest.raises(InputError, match="vary"):
        load_study(write_study(tmp_path, many))
    wide = {"momentum": {"grid": {"from": [0] * 99, "to": [1] * 99, "count": [10**6] + [1] * 98}}}
    with pytest.raises(InputError, match="vary"):
        load_study(write_study(tmp_path, wide))


@pytest.mark.slow
def test_very_many_invalid_runs_are_refused_at_once(tmp_path: Path) -> None:
    begin = time.process_time()
    with pytest.raises(InputError, match="duration"):
        load_study(write_study(tmp_path, {"momentum.2": {"range": [0.0, 0.999, 1e-5]}},
                               base=BASE | {"timing": {"duration": "long"}}))  # fmt: skip
    assert time.process_time() - begin < 8.0


# Meshes


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.dae", good.meshes()[4].replace(b"<COLLADA", b"<!DOCTYPE x><COLLADA", 1)),
        ("a.zip", b"PK"),
        ("a.svg", b"<svg/>"),
        ("a.glb", good.meshes()[3][:12] + b"\xff\xff\xff\x7f" + good.meshes()[3][16:]),
        ("a.ply", good.meshes()[2][:-4] + b"\xff\xff\xff\x7f"),
        ("a.obj", good.meshes()[5].replace(b"v ", b"v 1e200", 1)),
    ],
)
def test_invalid_meshes_are_refused(name: str, content: bytes, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(MeshFileError, match="it cannot be read"):
        read_mesh(tmp_path / name)


@pytest.mark.parametrize("picture", ["fifo", "../outside/secret", "/etc/passwd"])
def test_pictures_of_meshes_are_plain_files_beside_them(picture: str, watch: Watch) -> None:
    file = watch.inside / "part.obj"
    file.write_bytes(good.meshes()[5])
    (watch.inside / "part.mtl").write_text(f"newmtl a\nmap_Kd {picture}\n")
    assert len(read_mesh(file)) == 1


# Pages


@pytest.mark.slow
def test_names_in_a_robot_stay_names_on_its_page() -> None:
    pages, problem = [], load_scenario("planar_3dof/parabola").problem()
    for name in ("", good.NAME):
        text = good.bundled("planar_3dof")[0].decode()
        for part in ("planar_3dof", "spacecraft", "link_1", "q1", "solar"):
            text = text.replace(f'"{part}"', f'"{part}{html.escape(name)}"')
        robot = replace(problem, model=FreeFloatingModel.from_urdf(text, "end_effector"))
        motion = simulate(robot, heading_quaternion(np.radians(200.0)), branch=0).chosen.motion
        page = playback({f"a{name}": motion}, title=f"b{name}").html()
        pages.append(lxml.html.fromstring(page, parser=lxml.html.HTMLParser(huge_tree=True)))
    plain, hostile = (Counter(element.tag for element in page.iter()) for page in pages)
    assert plain == hostile
    assert pages[1].xpath("//@*[starts-with(name(), 'on')]") == []
