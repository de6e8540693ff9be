"""Readers of robot files: arguments of xacro, what is evaluated, and the library that does it.

Files that try to run code, read other files, or never end.
"""

import shutil
import subprocess
import sys
import time
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from xml.sax.saxutils import quoteattr

import psutil
import pytest
import yaml

import freefloat as ff
from freefloat.beyond.formats.xacro import read
from freefloat.robot import reader_process
from tests.commands import document, error, run
from tests.errors import error_key
from tests.spart_robots import ROBOTS, write_scenario

INCLUDED = (
    '<robot xmlns:xacro="x"><xacro:arg name="extra" default="${2 * 3}"/>'
    '<xacro:if value="false"><xacro:arg name="never"/></xacro:if></robot>'
)
HEAD = (
    'name="a" xmlns:xacro="x"><xacro:arg name="mass"/><xacro:include filename="more.xacro"/>'
    '<xacro:property name="m" value="${$(arg mass) + $(arg extra)}"/>'
)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A file with an argument without default, which includes one with two more."""
    (tmp_path / "more.xacro").write_text(INCLUDED)
    text = ROBOTS["no limits"].replace('"100.0"', '"${m}"').replace('name="SC_2DoF">', HEAD)
    (tmp_path / "arm.urdf.xacro").write_text(text)
    return tmp_path / "arm.urdf.xacro"


@pytest.fixture
def robot(file: Path, readers_here: None) -> Path:
    """The same file, read without processes."""
    return file


@pytest.mark.slow
def test_arguments_are_given_and_shown(robot: Path) -> None:
    info = document("info", robot, "--xacro", "mass=100")
    assert info["total_mass"] == 124.0
    assert info["arguments"] == [
        {"name": "mass", "value": "100", "default": False},
        {"name": "extra", "value": "6", "default": True},
    ]
    both = document("info", robot, "--xacro", "mass=100", "--xacro", "extra=9")
    assert (both["total_mass"], both["arguments"][1]["default"]) == (127.0, False)
    assert "extra 6 (default)" in run("info", robot, "--xacro", "mass=100").stdout


@pytest.mark.slow
def test_missing_and_unknown_arguments_are_named(robot: Path, tmp_path: Path) -> None:
    missing = error("info", robot)
    assert missing["key"] == "arguments.mass"
    assert "--xacro mass=" in missing["accepted"]
    unknown = error("info", robot, "--xacro", "mass=1", "--xacro", "mas=2")
    assert unknown["key"] == "arguments.mas"
    assert set(unknown["accepted"].split(", ")) == {"mass", "extra", "never"}
    for given in (["mass"], ["=1"], ["mass=1", "--xacro", "mass=2"]):
        assert error("info", robot, "--xacro", *given)["key"] == "xacro"


@pytest.mark.slow
def test_other_files_have_no_arguments(tmp_path: Path) -> None:
    assert error("info", "planar_2dof", "--xacro", "mass=1")["key"] == "arguments"
    assert error("info", "planar_2dof/line", "--xacro", "mass=1")["key"] == "xacro"
    options = ("-o", tmp_path / "a.urdf", "--xacro", "mass=1")
    assert error("assemble", "planar_2dof/line", *options)["key"] == "options"
    (tmp_path / "a.xml").write_text("<mujoco/>")
    for file in (tmp_path / "a.xml", ROBOTS["no limits"]):
        source = ff.RobotSource(file, arguments={"mass": 1})
        assert error_key(ff.FreeFloatingModel.from_urdf, source) == "arguments"
    assert error_key(ff.RobotSource, "planar_2dof", arguments={"mass": [1]}) == "arguments.mass"


@pytest.mark.slow
def test_written_robots_have_their_arguments(robot: Path, tmp_path: Path) -> None:
    written = tmp_path / "robot.urdf"
    assert run("assemble", robot, "--xacro", "mass=100", "-o", written).exit_code == 0
    assert ff.FreeFloatingModel.from_urdf(written).total_mass == 124.0
    write = partial(write_scenario, tmp_path, robot.name)
    file = write(arguments={"mass": 100.5, "extra": 9, "never": True})
    assert run("plan", file, "-o", tmp_path / "p.h5").exit_code == 0
    assert ff.load(tmp_path / "p.h5").problem.model.total_mass == 127.5
    assert run("check", tmp_path / "p.h5").exit_code == 0
    study = {"base": "s.yaml", "command": "plan", "files": "none",
             "vary": {"robot.arguments.mass": {"list": [100, 150]}}}  # fmt: skip
    (tmp_path / "study.yaml").write_text(yaml.safe_dump(study))
    loaded = ff.load_study(tmp_path / "study.yaml")
    masses = [loaded.scenario(number).model().total_mass for number in range(2)]
    assert masses == [127.0, 177.0]
    write(arguments={"mass": [1, 2]})
    assert error("plan", file)["key"].startswith("robot.arguments.mass")
    write(arguments={})
    assert error("plan", file)["key"] == "arguments.mass"


@pytest.mark.slow
def test_attached_files_have_arguments_of_their_own(robot: Path, tmp_path: Path) -> None:
    section = {
        "urdf": "planar_2dof", "end_effector": "end_effector",
        "attached": [{"urdf": robot.name, "prefix": "b_", "arguments": {"mass": 10}}],
    }  # fmt: skip
    (tmp_path / "r.yaml").write_text(yaml.safe_dump({"robot": section}))
    alone = ff.FreeFloatingModel.from_urdf("planar_2dof").total_mass
    written = document("assemble", tmp_path / "r.yaml", "-o", tmp_path / "a.urdf")
    assert ff.FreeFloatingModel.from_urdf(written["file"], "end_effector").total_mass == (
        pytest.approx(alone + 34.0)
    )


RELEASES = {
    "without the function": ("__init__.py", "safe_eval", "evaluate_safely"),
    "with another in its place": ("substitution_args.py", "_eval_env(args[0])", "os.environ['E']"),
    "without a substitution": ("substitution_args.py", "_eval_find", "_find_package"),
    "without symbols": ("__init__.py", "_global_symbols", "_all_symbols"),
    "with a way to Python": ("__init__.py", "'bool', 'True'", "'bool', 'vars', 'True'"),
}  # fmt: skip
"""File, text and what a later release of xacro has in its place."""


@pytest.mark.slow
@pytest.mark.parametrize("name", RELEASES)
def test_releases_that_cannot_be_confined_are_refused(name, file, tmp_path, monkeypatch):
    spec = find_spec("xacro")
    assert spec is not None
    assert spec.origin is not None
    library = tmp_path / "library"
    shutil.copytree(Path(spec.origin).parent, library / "xacro")
    module, before, after = RELEASES[name]
    part = library / "xacro" / module
    text = part.read_text()
    assert before in text
    part.write_text(text.replace(before, after))
    monkeypatch.syspath_prepend(library)  # where the reader's process looks first, too
    source = ff.RobotSource(file, arguments={"mass": 1})
    assert error_key(ff.FreeFloatingModel.from_urdf, source) == "xacro"


@pytest.mark.slow
def test_the_installed_release_is_confined(robot: Path) -> None:
    assert "<robot" in read(str(robot), {}, {"mass": "1"}).text


XACRO = '<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro">{}</robot>'
BLOCK = '<xacro:property name="block"><c/></xacro:property>'
CLASSES = "().__class__.__base__.__subclasses__()"
ATTACKS = {
    "code in a lambda": f"(lambda: {CLASSES})()",
    "attributes": CLASSES,
    "a format that reads attributes": r"str.format('{0.__class__\x7d', 1)",
    "builtins": "__builtins__",
    "the symbols of a namespace": "python.parent",
    "a secret text file": "xacro.load_yaml('/etc/passwd')",
    "a tag of PyYAML": "xacro.load_yaml('tag.yaml')",
    "a file of XML, then a download": "n['**block'].ownerDocument.implementation.createDOMBuilder",
}
FILES = {
    "a default": '<xacro:macro name="m" params="a:=${().__class__}"><c d="${a}"/></xacro:macro>'
                 "<xacro:m/>",
    "eval": r"""<link name="$(eval open${'\x28'}'/etc/passwd'${'\x29'})"/>""",
    "no XML": '<xacro:include filename="/etc/passwd"/>',
    "a device": '<xacro:include filename="/dev/zero"/>',
    "itself": '<xacro:include filename="a.xacro"/>',
    "an unknown macro": "<xacro:none/>",
    "a division by zero": '<link name="${1 / 0}"/>',
    "not closed": "<link>",
}  # fmt: skip


INCLUDE = '<xacro:include filename="block.xacro" ns="n"/>'
REFUSED = {
    **{name: XACRO.format(f"{INCLUDE}<link name={quoteattr(f'${{{expression}}}')}/>")
       for name, expression in ATTACKS.items()},
    **{name: XACRO.format(content) for name, content in FILES.items()},
    "an entity": '<!DOCTYPE r [<!ENTITY a "b">]>' + XACRO.format('<link name="&a;"/>'),
}  # fmt: skip


@pytest.mark.parametrize("text", REFUSED.values(), ids=REFUSED)
def test_files_reach_neither_python_nor_other_files(text: str, tmp_path: Path) -> None:
    (tmp_path / "tag.yaml").write_text("!!python/object/apply:os.getcwd []")
    (tmp_path / "block.xacro").write_text(XACRO.format(BLOCK))
    (tmp_path / "a.xacro").write_text(text)
    assert error_key(read, str(tmp_path / "a.xacro"), {}) == "urdf"


def test_what_robots_need_is_evaluated(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text("links: {upper: {mass: 3, names: [a, b]}}\nturn: !degrees 180")
    content = (
        """<xacro:property name="d" value="${xacro.load_yaml('a.yaml')}"/>"""
        """<c a="${d.links.upper.mass * 2}" b="${'-'.join(d.links.upper.names)}" """
        """c="${round(d.turn - math.pi, 9)}" d="${max(1, -2 ** 2) if True else 0}" """
        """e="${sorted([2, 1])[0:1]}" f="$(optenv PATH none)"/>"""
        """<xacro:macro name="m" params="n g:=2"><d e="${n}" f="${g}"/></xacro:macro>"""
        """<xacro:if value="${d.turn > 3}"><xacro:m n="i"/></xacro:if>"""
        """<xacro:unless value="true"><xacro:m n="j"/></xacro:unless>"""
    )
    (tmp_path / "a.xacro").write_text(XACRO.format(content))
    text = read(str(tmp_path / "a.xacro"), {}).text
    assert '<c a="6" b="a-b" c="0.0" d="1" e="[1]" f="none"/>' in text
    assert '<d e="i" f="2"/>' in text
    assert 'e="j"' not in text


@pytest.mark.parametrize("size", ["${9**9**9**9}", "${'a' * 10**10}"])
def test_time_and_memory_are_limited(size, tmp_path, monkeypatch):
    monkeypatch.setattr(reader_process, "SECONDS", 0.5)
    (tmp_path / "a.xacro").write_text(XACRO.format(f'<link name="{size}"/>'))
    assert error_key(ff.FreeFloatingModel.from_urdf, tmp_path / "a.xacro") == "urdf"


@pytest.mark.slow
@pytest.mark.parametrize("model", [
    '<worldbody><replicate count="100000000"><body><geom size="1"/></body></replicate>'
    "</worldbody>",
    '<asset><hfield name="h" nrow="60000" ncol="60000" size="1 1 1 1"/></asset>',
])  # fmt: skip
def test_large_models_of_mujoco_are_refused(model, tmp_path, monkeypatch):
    monkeypatch.setattr(reader_process, "SECONDS", 3)
    monkeypatch.chdir(tmp_path)
    Path("a.xml").write_text(f"<mujoco>{model}</mujoco>")
    assert error_key(ff.FreeFloatingModel.from_urdf, "a.xml") == "urdf"
    assert [file.name for file in tmp_path.iterdir()] == ["a.xml"]


@pytest.mark.slow
def test_readers_end_with_their_parent(tmp_path: Path) -> None:
    (tmp_path / "a.xacro").write_text(XACRO.format('<link name="${9**9**9**9}"/>'))
    code = "import sys, freefloat as ff; ff.FreeFloatingModel.from_urdf(sys.argv[1])"
    parent = subprocess.Popen([sys.executable, "-c", code, str(tmp_path / "a.xacro")])
    while not (children := psutil.Process(parent.pid).children()):
        assert parent.poll() is None
        time.sleep(0.05)
    while children[0].cpu_times().user < 0.5:  # it evaluates
        assert children[0].is_running()
        time.sleep(0.05)
    parent.kill()
    parent.wait()
    assert psutil.wait_procs(children, timeout=60)[1] == []
