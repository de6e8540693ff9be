"""The reference pages: every key, command and option is documented, and exists."""

import re
from collections.abc import Iterator
from contextlib import chdir
from pathlib import Path
from types import ModuleType
from typing import Any

import h5py
import numpy as np
import pytest
import yaml

import freefloat as ff
from freefloat.cli.models import bundled_file
from freefloat.io.scenario.schema import ScenarioFile
from freefloat.studies.study_file import StudyFile
from tests.commands import document, run
from tests.documents import PAGES, ROOT

SCENARIO = PAGES["docs/reference/scenario.md"]
GOAL = """
robot: {urdf: planar_2dof, end_effector: end_effector}
search: {from_attitude: [0, 0, 0, 1], joints: [0.3, 0.7]}
goal: {pose: {position: [1.0, 0.6, 0]}, duration: 30}
"""
PHASES = """
robot: {urdf: planar_2dof, end_effector: end_effector}
task: planar-position
path: {line: {from: [1.9, 0.2, 0], to: [0.5, 1.2, 0]}}
timing: {duration: 30}
margin: {measure: system, fraction: 0.1}
limits: {joint_rate: 0.25}
scene:
  bodies:
    - {name: client, sphere: 0.1, position: [0.5, 1.2, 0]}
phases:
  - capture: {body: client, mass: 3, inertia: [0.1, 0.1, 0.1]}
  - joints: [0.4, 1.2]
    duration: 30
"""
STUDY = """
base: spatial_6dof/line
command: simulate
attitude: [0.46008, 0.09337, 0.73519, -0.48898]
cases: 16
files: none
vary:
  momentum: {ball: {center: [0.5, 0.3, 0.1], radius: 1.0}}
  timing.duration: {uniform: [50, 200]}
"""
ROWS = re.findall(r"^\| `(\w+: .+?)` \|", SCENARIO, re.MULTILINE)
"""YAML of the tables of examples."""


@pytest.fixture
def tables(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(ROOT / "scripts" / "documentation"))
    import tables

    return tables


@pytest.mark.slow
def test_every_section_of_a_file_has_its_table(tables: ModuleType) -> None:
    pages = {"scenario": SCENARIO, "study": PAGES["docs/reference/studies.md"]}
    for name, model in {"scenario": ScenarioFile, "study": StudyFile}.items():
        markers = re.findall(rf"^<!-- keys: {name}(?:\.(\w+))? -->$", pages[name], re.MULTILINE)
        keys = tables.key_names(name)
        assert keys == list(model.model_fields)
        rows = [
            key for marker in filter(None, markers) for key in tables.key_names(f"{name}.{marker}")
        ]
        laws = {key.rpartition(".")[2] for key in rows if key.startswith("robot.arms.NAME.law.")}
        assert laws == ({"joints", "times", "path"} if name == "scenario" else set())
        sections = re.findall(r"^\| `(\w+)` \| .*?section", tables.keys_table(name), re.MULTILINE)
        assert sorted(markers) == sorted(["", *sections])
        assert {row.partition(".")[0].removesuffix("[]") for row in rows} == set(sections)


@pytest.mark.parametrize("row", ROWS)
def test_the_yaml_of_a_table_row_makes_a_problem(row: str, folder: Path) -> None:
    write_samples()
    section = yaml.safe_load(row)
    ((key, _),) = section.items()
    document = yaml.safe_load(bundled_file("spatial_6dof/line").text)
    if key in ("timing", "margin"):
        document |= section
    elif key in ("attitude", "frame"):
        document["path"] |= section
        document["search"] = {"joints": [0.3, -0.5, 1.1, 0.4, 0.9, -0.2]}
    else:
        kept = {} if key == "samples" else {"attitude": document["path"]["attitude"]}
        document["path"] = section | kept
    path = loaded(document).path.path
    assert np.linalg.norm(path.pose(1.0).position - path.pose(0.0).position) > 1.0
    if "fixed" in row:
        rotation = [[0.28, -0.96, 0.0], [0.96, 0.28, 0.0], [0.0, 0.0, 1.0]]
        np.testing.assert_allclose(path.pose(0.5).rotation, rotation, atol=1e-4)


def write_samples(columns: int = 7) -> None:
    (samples,) = re.findall(r"```csv[^\n]*\n(.*?)```", SCENARIO, re.DOTALL)
    rows = [",".join(row.split(",")[:columns]) for row in samples.splitlines()]
    Path("path.csv").write_text("\n".join(rows))


def loaded(document: dict[str, Any]) -> ff.Problem:
    file = Path("mine.yaml")
    file.write_text(yaml.safe_dump(document, sort_keys=False))
    return ff.load_scenario(file).problem()


def test_every_command_has_its_help_on_the_page(tables: ModuleType) -> None:
    page = PAGES["docs/reference/commands.md"]
    for name, command in tables.commands().items():
        assert f"\n## {name}\n\n<!-- command: {name} -->\n" in page
        options = [option.opts[0] for option in command.params]
        assert set(tables.EVERYWHERE) <= set(options)
        shown = tables.command_help(name)
        assert all(f"`{option}" in shown for option in {*options} - {*tables.EVERYWHERE}
                   if option.startswith("--"))  # fmt: skip


def rows_of(section: str) -> set[str]:
    """Keys in the tables of a section of the page on JSON documents."""
    text = re.split(rf"^##+ {section}\n", PAGES["docs/reference/json.md"], flags=re.MULTILINE)[1]
    text = re.split(r"^##+ ", text, flags=re.MULTILINE)[0]
    return keys_of_rows(text)


def keys_of_rows(text: str) -> set[str]:
    columns = re.findall(r"^(?:\| \| |\| )?(`.*?) \| ", text, re.MULTILINE)
    return {key for column in columns for key in re.findall(r"`([^`]+)`", column)}


def rows_of_other_commands() -> dict[str, set[str]]:
    """Keys by command in the table of the commands without a section."""
    text = PAGES["docs/reference/json.md"].split("\n## Other commands\n")[1].split("\n## ")[0]
    _, *parts = re.split(r"^\| `(.+?)` \| ", text, flags=re.MULTILINE)
    return dict(zip(parts[::2], map(keys_of_rows, parts[1::2]), strict=True))


def keys_in(value: Any, name: str = "") -> set[str]:
    """Keys of a JSON document as the page writes them: ``a.b``, ``a[].b``."""
    if isinstance(value, dict) and value:
        pairs = ((f"{name}.{key}".strip("."), entry) for key, entry in value.items())
        return {key for pair in pairs for key in keys_in(pair[1], pair[0])}
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return {key for entry in value for key in keys_in(entry, f"{name}[]")}
    return {name}


def begins(key: str, start: str) -> bool:
    return re.match(rf"{re.escape(start)}(?=[.\[]|$)", key) is not None


def related(key: str, row: str) -> bool:
    """Whether a row is about a key; an empty or missing object is that of its keys."""
    return begins(key, row) or begins(row, key)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, list[dict[str, Any]]]]:
    """Documents of the commands, whose files, but for figures, are in the present folder."""
    with chdir(tmp_path_factory.mktemp("reference")), pytest.MonkeyPatch.context() as patch:
        patch.setattr("matplotlib.figure.Figure.savefig", lambda *_, **__: None)
        patch.setattr("freefloat.visualization.figures._HEADINGS", 12)
        yield documents_of_all_commands()


def documents_of_all_commands() -> dict[str, list[dict[str, Any]]]:
    line, planar = "spatial_6dof/line", "planar_3dof/parabola"
    attitude = ["--attitude", 0.1, 0.5, 0.2, -0.8367]
    small = yaml.safe_load(bundled_file(line).text)
    small["search"] = {"samples": 16}
    Path("small.yaml").write_text(yaml.safe_dump(small))
    spatial = ["--samples", 16, "--nearest", 0, 0, 0, 1, "--boundary", 1, "--touch", 1]
    pages = ["--html", "page.html", "--plots", "plots"]
    documents = {
        "simulate": [
            document("simulate", line, *attitude, "--branch", 2, "-o", "motion.h5", code=1),
            document("simulate", "planar_2dof/line", "--heading", 30),
        ],
        "plan": [
            document("plan", planar, "-o", "plan.h5"),
            document("plan", "planar_2dof/line", "-o", "line.h5", *pages),
            document("plan", "small.yaml"),
        ],
        "map": [
            document("map", planar, "--samples", 24, "-o", "headings.h5", "--plots", "plots"),
            document("map", line, *spatial, "-o", "attitudes.h5"),
        ],
        "check": [document("check", "plan.h5")],
        "info": [
            document("info", line, "--joints", "0,0.1,0.2,0.3,0.4,0.5"),
            document("info", "ur5_servicer/arc"),
        ],
        "workspace": [document("workspace", planar)],
        "singularities": [
            document("singularities", "planar_3dof", "--fix", "q3=0.5", "--resolution", 5, *pages)
        ],
    }
    plan = documents["plan"][1]
    Path("goal.yaml").write_text(GOAL)
    rates = ff.Goal(joints=[0.6, 0.2], joint_rates=[0.01, 0.0]).to_dict()
    turned = ff.Goal(attitude=[0.0, 0.0, 0.1305262, 0.9914449], joints=[0.6, 0.2]).to_dict()
    documents["plan, with a goal"] = [
        document("plan", "goal.yaml", *pages),
        {"goal": rates},
        {"goal": turned},
    ]  # fmt: skip
    Path("phases.yaml").write_text(PHASES)
    manoeuvre = document("plan", "phases.yaml", "-o", "manoeuvre.h5")
    above = {"path": plan, "goal": documents["plan, with a goal"][0], "capture": {}}
    for phase in manoeuvre["phases"]:
        for key in phase.keys() & above[phase["kind"]].keys() - {"reason", "feasible"}:
            del phase[key]
    documents["plan, with phases"] = [manoeuvre]
    Path("study.yaml").write_text(STUDY)
    one = document("batch", "study.yaml", "--run", 1, "-o", "run.h5")
    shown = ("case", "parameters", "verdict", "margin", "file")  # studies.md has the other columns
    return documents | {
        "models": [document("models")],
        "models NAME": [{key: document("models", "ets_vii")[key] for key in ("name", "text")}],
        "assemble": [document("assemble", "planar_2dof", "-o", "robot.urdf")],
        "export": [document("export", "line.h5"), document("export", "manoeuvre.h5")],
        "batch": [document("batch", "study.yaml", "-o", "study")],
        "batch --dry-run": [document("batch", "study.yaml", "--dry-run")],
        "batch --run": [{key: one[key] for key in shown}],
    }


@pytest.mark.slow
def test_every_key_of_a_document_is_described(written: dict[str, list[dict[str, Any]]]) -> None:
    others = rows_of_other_commands()
    for command, found in written.items():
        described = others.get(command) or rows_of(command)
        if command == "plan":
            described |= rows_of("simulate") - {"out_of_reach"}
            described = {key for key in described if not key.startswith("branches")}
        for name in ("search", "limits", "certificate"):
            described |= rows_of(name) if name in described else set()
        keys = {key for entry in found for key in keys_in(entry)}
        unknown = {key for key in keys if not any(related(key, row) for row in described)}
        assert " ".join(sorted(unknown)) == ""
        missing = {row for row in described if not any(related(key, row) for key in keys)}
        assert sorted(missing) == []


@pytest.mark.slow
@pytest.mark.usefixtures("written")
def test_every_dataset_of_a_file_is_described() -> None:
    page = PAGES["docs/reference/files.md"]
    text = page.split("\n## Plans, motions and maps\n")[1].split("\n## ")[0]
    cells = re.findall(r"^\|(?: ?\w* \|)? (`.*?) \| ", text, re.MULTILINE)
    described = {name for cell in cells for name in re.findall(r"`([\w/]+)`", cell)}
    scenario = yaml.safe_load(run("models", "planar_2dof/line").stdout)
    scenario["scene"] = {"bodies": [{"name": "client", "urdf": "planar_2dof"}]}
    Path("scene.yaml").write_text(yaml.safe_dump(scenario))
    run("simulate", "scene.yaml", "--heading", 0, "-o", "scene.h5")
    found = set()
    for name in ("plan", "manoeuvre", "motion", "scene", "headings", "attitudes"):
        with h5py.File(f"{name}.h5") as file:
            file.visit(found.add)
            found |= set(file.attrs)
    names = {re.sub(r"\d+", lambda _: "K", name) for name in found}
    groups = {name.partition("/")[0] for name in described}
    unknown = {name for name in names if name.partition("/")[0] not in described | groups}
    assert " ".join(sorted(unknown)) == ""
    datasets = names | {name.rpartition("/")[2] for name in names}
    assert " ".join(sorted(described - datasets)) == ""
