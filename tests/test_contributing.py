"""CONTRIBUTING: its recipes work as they stand, its commands run, its picture is current."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
RECIPES = dict(
    re.findall(r"^### An? (.+?)\n.*?```diff\n(.*?)```", TEXT, re.MULTILINE | re.DOTALL)
) | {
    file.stem.replace("_", " "): file.read_text("utf-8")
    for file in Path(__file__).with_name("recipes").glob("*.patch")
}
"""The recipe that CONTRIBUTING shows, and those that it links."""
MOST_FILES = 3
"""Files under ``src`` that a recipe may change."""
KERNELS = "src/freefloat/ensemble/kernels/"
SCRIPTS = re.findall(r"^python (scripts/.+)$", TEXT, re.MULTILINE)
TOUR = """
import json
import freefloat as ff
import numpy as np
import yaml
from typer.testing import CliRunner
from freefloat.cli.app import app

def run(*words, code=0):
    done = CliRunner().invoke(app, [str(word) for word in words])
    assert done.exit_code == code, done.output
    return done.stdout

def tour(content, *options):
    # a scenario is planned, saved, loaded, checked, printed and shown
    open("new.yaml", "w").write(yaml.safe_dump(content))
    table = run("plan", "new.yaml", "-o", "new.h5", "--html", "new.html", *options)
    loaded = ff.load("new.h5")
    assert " ".join(loaded.reason.split()) in " ".join(table.split())
    assert json.loads(run("check", "new.h5", "--json"))["proved"]
    return loaded, table
"""
"""Beginning of each use."""
USES = {
    "path kind": """
from freefloat.io.scenario.path_section import section_of

helix = {"center": [0, 0, 2], "normal": [0, 0, 1], "from": [0.7, 0, 2], "angle_deg": 180, "rise": 1}
scenario = {
    "robot": {"urdf": "ets_vii", "end_effector": "end_effector"},
    "task": "position",
    "path": {"helix": helix},
    "timing": {"duration": 60},
}
path = ff.load_scenario(scenario).problem().path.path
np.testing.assert_allclose(path.curve(1.0), [-0.7, 0, 3], atol=1e-12)
for order in (1, 2):
    difference = (path.curve(0.4 + 1e-5, order - 1) - path.curve(0.4 - 1e-5, order - 1)) / 2e-5
    np.testing.assert_allclose(path.curve(0.4, order), difference, atol=1e-8)
assert section_of(path) == ({"helix": helix}, {})
scenario["path"]["frame"], scenario["search"] = "spacecraft", {"joints": [0, 1, -1, 0, 1, 0]}
moved = ff.load_scenario(scenario).problem().path.path
np.testing.assert_allclose(np.ptp([moved.curve(s) - path.curve(s) for s in (0, 0.5, 1)], axis=0), 0,
                           atol=1e-12)
assert set(section_of(moved)[0]) == {"helix"}

flat = {"center": [0.6, 0.2, 0], "normal": [0, 0, 1], "from": [1, 0.2, 0],
        "angle_deg": 60, "rise": 0}
content = yaml.safe_load(ff.load_scenario("planar_2dof/line").text)
content["robot"]["urdf"] = "planar_2dof"
loaded, table = tour(content | {"path": {"helix": flat}})
assert loaded.problem.path.path.curve.rise == 0.0 and ff.figures(loaded)
assert "helix" in run("schema")
""",
    "measure": """
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.certificate.certificate import certify

problem = ff.load_scenario("planar_2dof/line").problem()
gjm, relative = (
    ff.singularity_measure(problem.model, problem.task, name) for name in ("gjm", "relative")
)
reach = VirtualManipulator.of(problem.model).reach
assert abs(relative([0.3, 1.1]) / gjm([0.3, 1.1]) * reach**2 - 1.0) < 1e-12
problem = problem.replace(margin=ff.Margin(relative, 0.02))
best = ff.attitude_map(problem, 36).best
chosen = ff.simulate(problem, heading=best.heading, branch=best.branch).chosen
assert abs(best.minimum_margin / chosen.minimum_margin - 1.0) < 1e-4
(minimum,) = (entry for entry in certify(chosen.motion).minima if entry.measure == "relative")
assert 0.89 < minimum.bound / minimum.value <= 1.0

content = yaml.safe_load(ff.load_scenario("planar_2dof/line").text)
content["robot"]["urdf"] = "planar_2dof"
loaded, table = tour(content | {"margin": {"measure": "relative", "fraction": 0.1}})
assert loaded.problem.margin.measure.name == "relative" and "relative" in table
assert "relative" in run("schema")
""",
    "limit": """
def write(name, **changes):
    open(name, "w").write(yaml.safe_dump(content | changes))

def limit(results):
    (result,) = (r for r in results if r["limit"] == "end_effector_speed")
    assert result["unit"] == "m/s"
    return result

speed = 15 / 8 * np.hypot(1.4, 1.0) / 30
content = {
    "robot": {"urdf": "planar_2dof", "end_effector": "end_effector"},
    "task": "planar-position",
    "path": {"line": {"from": [1.9, 0.2, 0], "to": [0.5, 1.2, 0]}},
    "timing": {"duration": 30},
    "margin": {"measure": "system", "fraction": 0.1},
    "limits": {"end_effector_speed": 0.11},
    "phases": [{"joints": {"q1": 0.4, "q2": 1.2}, "duration": 30}],
}
loaded, table = tour(content | {"phases": []}, "--verbose")
assert loaded.limits.end_effector_speed == 0.11 and "end effector speed [m/s]" in table
result = limit(r.to_dict() for r in loaded.limit_results)
assert result["kept"] and abs(result["worst"] - speed) < 1e-9 and abs(result["time"] - 15) < 1e-3

write("phases.yaml", search={"objective": "nearest", "from_attitude": [0, 0, 0, 1],
                             "joints": [0.5, 0.8]})
found = json.loads(run("plan", "phases.yaml", "--json", "-o", "phases.h5"))
assert all(limit(phase["limits"])["kept"] for phase in found["phases"])
run("check", "phases.h5")
motion = ff.load("phases.h5").phases[-1].motion
t = np.linspace(0.01, motion.final.time - 0.01, 500)
positions = [[motion.model.end_effector_pose(s.attitude, s.joints).position
              for s in motion.sample(t + step)] for step in (1e-4, -1e-4)]
speeds = np.linalg.norm(np.subtract(*positions), axis=1) / 2e-4
assert abs(limit(found["phases"][-1]["limits"])["worst"] - speeds.max()) < 1e-5
""",
    "objective": """
from freefloat.planning.motions import integrate_branch

def ratio(motion):
    (rate,) = (r for r in ff.check_limits(motion, rates) if r.limit == "joint_rate")
    return rate.ratio

content = yaml.safe_load(ff.load_scenario("spatial_6dof/above").text)
content["robot"]["urdf"] = "spatial_6dof"
content["search"] = {"objective": "quick", "samples": 64}
content["limits"] = {"joint_rate": 0.2}
loaded, table = tour(content)
assert loaded.reason.startswith("the least duration that joint rates require, ")
problem, rates = loaded.problem, loaded.limits
least, samples = ratio(loaded.chosen.motion), ff.attitude_map(problem, 64, refine=False)
kept = np.argwhere(problem.margin.keeps(samples.margins))
for k, branch in np.random.default_rng(1).permutation(kept)[:6].tolist():
    other = integrate_branch(problem, samples.attitudes[k], branch)
    assert ratio(other.motion) > least - 1e-3
open("quick.yaml", "w").write(yaml.safe_dump(content | {"limits": {}}))
run("plan", "quick.yaml", "--json", code=2)
""",
    "phase kind": """
from freefloat.dynamics.momentum import inertia_matrices
from freefloat.so3 import heading_of

content = yaml.safe_load(ff.load_scenario("planar_2dof/line").text)
content["robot"]["urdf"] = "planar_2dof"
content["momentum"] = [0, 0, 0.5]
rest = {"joints": [0.4, 1.2], "duration": 30}
content["phases"] = [rest, {"hold": 20}, {"hold": 5, "name": "wait"}]
open("hold.yaml", "w").write(yaml.safe_dump(content))
assert "wait" in " ".join(run("plan", "hold.yaml", "-o", "hold.h5", "--html", "hold.html").split())
loaded = ff.load("hold.h5")
phases = loaded.to_dict()["phases"]
assert [phase["kind"] for phase in phases] == ["path", "goal", "hold", "hold"]
assert phases[3]["name"] == "wait" and phases[2]["duration"] == 20
hold = loaded.phases[2].motion
np.testing.assert_allclose(hold.joints, np.tile([0.4, 1.2], (len(hold.times), 1)), atol=1e-12)
D = inertia_matrices(hold.model, hold.joints[0])[0]
angle = heading_of(hold.final.attitude) - heading_of(hold.initial.attitude)
assert abs(np.angle(np.exp(1j * (angle - 20 * 0.5 / D[2, 2])))) < 1e-9
run("check", "hold.h5")
assert "3 hold" in ff.playback(loaded).titles and ff.figures(loaded)
content["phases"][1]["hold"] = -1
open("hold.yaml", "w").write(yaml.safe_dump(content))
run("plan", "hold.yaml", code=2)
assert "hold" in run("schema")
""",
    "command": """
simulation = ff.simulate(ff.load_scenario("planar_2dof/line").problem(), heading=0.4)
ff.save(simulation, "motion.h5")
shown = json.loads(run("rotation", "motion.h5", "--json"))
z, w = simulation.chosen.motion.final.attitude[2:]
assert abs(shown["final_deg"] - abs(np.degrees(2 * np.arctan2(z, w) - 0.4))) < 1e-6
assert "Example: freefloat rotation" in run("rotation", "--help")
""",
    "export format": """
simulation = ff.simulate(ff.load_scenario("planar_2dof/line").problem(), heading=0.4)
ff.save(simulation, "motion.h5")
for name in ("motion.modelica", "motion.csv"):
    run("export", "motion.h5", "-o", name, "--times", 5)
lines = open("motion.modelica").read().splitlines()
table = np.loadtxt("motion.csv", delimiter=",", skiprows=1)
assert lines[0] == "#1"
assert f"double trajectory(5,{table.shape[1]})" in lines
np.testing.assert_array_equal(np.loadtxt(lines[-5:]), table)
""",
    "result view": """
from freefloat.dynamics.momentum import mass_matrix
from freefloat.io.trajectory import Trajectory
from freefloat.rotations import rotation_matrix

problem = ff.load_scenario("spatial_6dof/line").problem()
simulation = ff.simulate(problem, [0.0, 0.0, 0.0, 1.0])
(axes,) = ff.figures(simulation)["power"].axes
times, power = next(line for line in axes.lines if line.get_label() == "sum").get_data()
middle = len(times) // 3
motion = Trajectory.of(simulation.chosen.motion, times[[0, middle]])
energies = []
for k, attitude in enumerate(motion.attitudes):
    twist = np.array([motion.base_velocities[k], motion.angular_velocities[k]])
    rates = np.concatenate([*twist @ rotation_matrix(attitude), motion.joint_rates[k]])
    energies.append(rates @ mass_matrix(problem.model, motion.joints[k]) @ rates / 2.0)
work = np.trapezoid(power[: middle + 1], times[: middle + 1])
assert abs(work / np.diff(energies) - 1.0) < 1e-3
ff.save(simulation, "motion.h5")
ff.figures(ff.load("motion.h5"))["power"].savefig("power.pdf")
""",
}
"""What each recipe makes possible."""


def checkout(folder: Path, recipes: list[str]) -> Path:
    for name in ("src", "models"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("*.pyc"))
    shutil.copy(ROOT / "pyproject.toml", folder)
    for recipe in recipes:
        subprocess.run(["git", "apply"], input=recipe, cwd=folder, text=True, check=True)
    return folder


@pytest.fixture(scope="module")
def extended(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return checkout(tmp_path_factory.mktemp("checkout"), list(RECIPES.values()))


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A checkout with every recipe that leaves the kernels as they are, compiled."""
    recipes = [recipe for recipe in RECIPES.values() if KERNELS not in recipe]
    return checkout(tmp_path_factory.mktemp("compiled"), recipes)


def execute(folder: Path, *words: str) -> None:
    variables = {"PYTHONPATH": str(folder / "src"), "COLUMNS": "200"}
    done = subprocess.run(
        [sys.executable, *words], cwd=folder, env=os.environ | variables, check=False,
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("name", ["extended", "compiled"])
def test_recipes_add_what_they_say(name: str, request: pytest.FixtureRequest) -> None:
    """One process runs those of a checkout; a traceback names the recipe."""
    uses = {
        recipe: TOUR + use
        for recipe, use in USES.items()
        if (KERNELS in RECIPES[recipe]) == (name == "extended")
    }
    each = f"for name, use in {uses!r}.items(): exec(compile(use, name, 'exec'), {{}})"
    execute(request.getfixturevalue(name), "-c", each)


@pytest.mark.parametrize("name", RECIPES)
def test_a_recipe_applies(name: str) -> None:
    done = subprocess.run(
        ["git", "apply", "--check"], input=RECIPES[name], cwd=ROOT, text=True, check=False,
        capture_output=True,
    )  # fmt: skip
    assert done.returncode == 0, f"the patch of the recipe {name!r} needs mending: {done.stderr}"


def test_every_recipe_changes_few_files() -> None:
    assert set(RECIPES) == set(USES)
    for name, recipe in RECIPES.items():
        files = re.findall(r"^\+\+\+ b/(src/.+)$", recipe, re.MULTILINE)
        assert 1 <= len(set(files)) <= MOST_FILES, name


@pytest.mark.slow
def test_the_recipes_keep_the_style(extended: Path) -> None:
    execute(extended, "-m", "ruff", "check", "--no-cache", "src")
    execute(extended, "-m", "ruff", "format", "--check", "--no-cache", "src")
    execute(
        extended, "-c", "from importlinter.cli import lint_imports_command as c; c(['--no-cache'])"
    )


@pytest.mark.slow
@pytest.mark.parametrize("script", SCRIPTS)
def test_a_script_runs_as_written(script: str) -> None:
    execute(ROOT, *script.split())


def test_the_picture_shows_the_imports(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    import make_package_graph as graph

    assert graph.PICTURE.read_text("utf-8") == graph.svg(graph.imports())
