"""Files made to do harm, or broken by chance: read, or refused in one message; nothing else."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from freefloat.errors import InputError
from freefloat.io.scenario import load_scenario
from freefloat.io.yaml import parse_yaml
from freefloat.motion.problem import Problem
from freefloat.paths.path import parse_samples, samples_text
from freefloat.planning.simulation import simulate
from freefloat.robot.meshes import read_mesh
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.names import MeshFileError, find_mesh
from freefloat.robot.validation import examine
from freefloat.so3 import heading_quaternion
from freefloat.studies.study import load_study
from freefloat.visualization.playback import playback
from tests import hostile_samples as good
from tests.example_studies import BASE, a_study, write_study
from tests.hostile import KINDS, READ, REFUSED, Watch, outcome
from tests.scenarios import PARABOLA

MUTATED = 38
"""Of each of eight kinds."""


@pytest.fixture
def watch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Watch]:
    """Folders to work in, and somebody who looks."""
    for kind in KINDS.values():
        kind.samples()  # made elsewhere, before anybody looks
    watch = Watch(tmp_path)
    monkeypatch.chdir(watch.inside)
    yield watch
    watch.close()


@pytest.mark.parametrize("kind", KINDS)
def test_mutated_files_are_read_or_refused_in_one_message(kind: str, watch: Watch) -> None:
    """``scripts/fuzz.py`` does the same with as many as one likes."""
    found = Counter[str]()
    for number in range(MUTATED):
        content = KINDS[kind].input(f"tests/{kind}/{number}")
        result, told = outcome(KINDS[kind], content, watch)
        assert result in (READ, REFUSED), f"{kind} {number}: {result}: {told}"
        found[result] += 1
    assert found[REFUSED] > MUTATED // 4


@pytest.mark.parametrize("kind", KINDS)
def test_good_files_are_read(kind: str, watch: Watch) -> None:
    """Else mutations of them would prove nothing."""
    for content in KINDS[kind].samples():
        result, told = outcome(KINDS[kind], content, watch)
        assert result == READ, told


def test_whoever_looks_sees_what_is_done_outside(watch: Watch, tmp_path: Path) -> None:
    (watch.inside / "mine").write_text("fine")
    assert watch.found() == []
    (tmp_path / "outside" / "pwned").write_text("not fine")
    os.system("true")
    found = watch.found()
    assert any("pwned" in one for one in found), found
    assert any("os.system" in one for one in found)
    assert any("was changed" in one for one in found)
    assert watch.found() == []


# Messages


@pytest.mark.parametrize("name", ["a\nb", "\x1b[2J", "\u202e", "\ud800", "\0", "x" * 100_000])
def test_messages_are_one_line_that_any_terminal_may_get(name: str) -> None:
    told = str(InputError(name, f"{name} was given", name, name))
    assert told.isprintable()
    assert len(told) < 20_000
    told.encode()


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
def test_names_of_meshes_that_are_no_addresses_are_told(name: str) -> None:
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


def test_a_megabyte_of_yaml_is_read_in_seconds() -> None:
    """As long as nobody asks what it means."""
    begin = time.process_time()
    parse_yaml("a:\n" + "- [1.5, 2.5, 3.5]\n" * 10_000, Path("x"))
    assert time.process_time() - begin < 2.0


def test_no_yaml_runs_code(watch: Watch) -> None:
    file = watch.inside / "evil.yaml"
    for text in ("!!python/object/apply:os.system [touch ../outside/pwned]", "&a [*a, *a]"):
        file.write_text(PARABOLA.replace("planar-pose", text))
        with pytest.raises(InputError, match=r"tag|alias"):
            load_scenario(file)
    assert watch.found() == []


def test_studies_that_would_take_all_memory_are_refused_at_once(tmp_path: Path) -> None:
    many = {f"robot.held.q{n}": {"range": [0, 1, 1e-6]} for n in range(100)}
    with pytest.raises(InputError, match="vary"):
        load_study(write_study(tmp_path, many))
    wide = {"momentum": {"grid": {"from": [0] * 99, "to": [1] * 99, "count": [10**6] + [1] * 98}}}
    with pytest.raises(InputError, match="vary"):
        load_study(write_study(tmp_path, wide))


def test_very_many_cases_that_all_fail_are_told_at_once(tmp_path: Path) -> None:
    begin = time.process_time()
    with pytest.raises(InputError, match="duration"):
        load_study(write_study(tmp_path, {"momentum.2": {"range": [0.0, 0.999, 1e-5]}},
                               base=BASE | {"timing": {"duration": "long"}}))  # fmt: skip
    assert time.process_time() - begin < 8.0


def test_minus_zero_is_zero(tmp_path: Path) -> None:
    vary = {"momentum.2": {"normal": {"mean": 0.5, "sd": -0.0}}}
    assert a_study(tmp_path, vary, cases=2).parameters(1) == {"momentum.2": 0.5}
    vary = {"momentum.2": {"uniform": [0.0, -0.0]}}
    assert a_study(tmp_path, vary, cases=2).parameters(1) == {"momentum.2": 0.0}


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
def test_meshes_that_declare_entities_or_talk_nonsense_are_refused(
    name: str, content: bytes, tmp_path: Path
) -> None:
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

NAME = "</script><script>window.hacked=1</script><img src=x onerror=alert(1)>"


class Tags(HTMLParser):
    """The tags of a page, and those of their attributes that run code."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found, self.handlers = Counter[str](), list[str]()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found[tag] += 1
        self.handlers += [name for name, _ in attrs if name.startswith("on")]


def _followed(name: str) -> Problem:
    """A problem whose robot, links, joints and colours are called so."""
    told = name.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
    text = good.bundled("planar_3dof")[0].decode()
    for own in ("planar_3dof", "spacecraft", "link_1", "q1", "solar"):
        text = text.replace(f'"{own}"', f'"{own}{told}"')
    model = FreeFloatingModel.from_urdf(text, "end_effector")
    return replace(load_scenario("planar_3dof/parabola").problem(), model=model)


def test_names_in_a_robot_stay_names_on_its_page() -> None:
    pages = []
    for name in ("", NAME):
        problem = _followed(name)
        followed = simulate(problem, heading_quaternion(np.radians(200.0)), branch=0)
        pages.append(Tags(playback({f"a{name}": followed.chosen.motion}, title=f"b{name}").html()))
    assert pages[0].found == pages[1].found
    assert pages[1].handlers == pages[0].handlers == []
