"""Robot files that try to run code, read other files, or never end."""

import subprocess
import sys
import time
from pathlib import Path
from xml.sax.saxutils import quoteattr

import psutil
import pytest

import freefloat as ff
from freefloat.beyond.formats.xacro import read
from freefloat.robot import reader_process
from tests.errors import error_key

XACRO = '<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro">{}</robot>'
BLOCK = '<xacro:property name="block"><c/></xacro:property>'
NEVER = XACRO.format('<link name="${9**9**9**9}"/>')
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
    (tmp_path / "a.xacro").write_text(NEVER)
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
