"""README and docs: every block runs and prints what is shown, links, packages, speeds."""

import json
import re
import shutil
from types import ModuleType

import pytest
from IPython.core.interactiveshell import InteractiveShell
from IPython.utils.capture import capture_output
from typer.main import get_command

from freefloat.cli.app import app
from tests.documents import PAGES, ROOT, Page, blocks_of

CHECKOUT = ("src", "models", "scripts", "tests", "docs", "pyproject.toml", "README.md", "LICENSE")
"""What the commands of CONTRIBUTING.md work on: a copy of it."""


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")  # json.load(open(...))
@pytest.mark.filterwarnings("ignore:Unclosed socket:ResourceWarning")  # of MeshCat
@pytest.mark.parametrize("name", [name for name in PAGES if "\n```" in PAGES[name]])
def test_every_block_prints_what_is_shown(name, tmp_path, monkeypatch):
    if name == "CONTRIBUTING.md":
        for entry in CHECKOUT:
            copy = shutil.copytree if (ROOT / entry).is_dir() else shutil.copy2
            copy(ROOT / entry, tmp_path / entry)
        monkeypatch.setenv("PYTHONPATH", str(tmp_path / "src"))
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    page = Page(name)
    try:
        for block in blocks_of(name):
            page.run(block)
    finally:
        page.close()


@pytest.mark.parametrize("page", PAGES)
def test_commands_in_sentences_have_their_options(page: str) -> None:
    group = get_command(app)
    for command, rest in re.findall(r"`freefloat ([a-z]+)( [^`]*)?`", PAGES[page]):
        entries = group.commands[command].params if command in group.commands else []
        known = {option for entry in entries for option in entry.opts}
        assert set(re.findall(r"--[a-z-]+", rest)) <= known | {"--help"}, command


@pytest.mark.slow
def test_the_notebook_runs_the_example_of_the_readme(monkeypatch: pytest.MonkeyPatch) -> None:
    cells = json.loads((ROOT / "docs" / "quickstart.ipynb").read_text("utf-8"))["cells"]
    codes = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    (example,) = (block for block in blocks_of("README.md") if block.language == "python")
    lines = [line for line in example.text.splitlines() if not line.startswith("ff.playback")]
    assert set(lines) <= set("\n".join(codes).splitlines())
    monkeypatch.delenv("VIRTUAL_ENV", raising=False)  # IPython warns of another than its own
    shell = InteractiveShell.instance()
    monkeypatch.setattr(shell, "kernel", True, raising=False)  # as those of notebooks have
    with capture_output() as captured:
        results = [shell.run_cell(code) for code in codes]
    shown = [shell.display_formatter.format(result.result)[0] for result in results[2:]]
    InteractiveShell.clear_instance()
    assert all(result.success for result in results)
    printed = iter(captured.stdout.splitlines())  # with the texts of plan and figure in between
    assert all(line in printed for line in example.shown.splitlines())
    assert "<iframe" in captured.outputs[0].data["text/html"]
    assert "Motion of branch" in shown[0]["text/html"]
    assert {"image/png", "image/svg+xml"} & {*shown[1]}


@pytest.mark.parametrize("page", PAGES)
def test_linked_and_named_files_exist(page: str) -> None:
    folder = (ROOT / page).parent
    for link in re.findall(r"\]\((?!\w+:|#)([^)#\s]+)(?:#[\w-]+)?\)", PAGES[page]):
        script = re.search(r"tutorials/(\d\d_\w+)\.md$", link)
        file = ROOT / "scripts" / f"{script[1]}.py" if script else folder / link
        assert file.exists(), link
    for script in re.findall(r"`(scripts/\w+\.py)`", PAGES[page]):
        assert (ROOT / script).is_file(), script


@pytest.fixture
def benchmark(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    import benchmark

    return benchmark


def test_contributing_names_every_package() -> None:
    design = PAGES["CONTRIBUTING.md"].split("## The packages")[1].split("## Recipes")[0]
    named = re.findall(r"`(\w+)`(?=[^|]*\| .+ \|$)", design, re.MULTILINE)
    source = ROOT / "src" / "freefloat"
    packages = {path.parent.name for path in source.glob("*/__init__.py")}
    modules = {path.stem for path in source.glob("[!_]*.py")}
    assert packages | modules == set(named)


def test_the_speeds_are_those_measured(benchmark: ModuleType) -> None:
    from benchmarks.result import load

    computer, results = load(benchmark.MEASURED)
    assert len(benchmark.headlines(results)) == len(benchmark.HEADLINES)
    for page, content in benchmark.tables(computer, results).items():
        assert benchmark.with_table(PAGES[page], content) == PAGES[page]


def test_the_readme_is_short() -> None:
    assert PAGES["README.md"].count("\n") <= 140
