"""``freefloat check``: plans are proved again from their files, and what was changed is named."""

import json
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

import freefloat as ff
from freefloat.cli.app import app
from freefloat.errors import InputError
from freefloat.io.digest import seal
from freefloat.io.plan_file import load_plan, save_motion, save_plan
from freefloat.io.scenario import parse_scenario
from freefloat.limits.check import check_limits
from freefloat.planning.documents import simulation_document
from freefloat.so3 import angle_between
from freefloat.verification import robust_checks
from freefloat.verification.check import check_plan
from freefloat.verification.checks import Check
from tests.scenarios import PARABOLA

pytestmark = pytest.mark.usefixtures("kernels")

PLANAR = (
    PARABOLA
    + """\
search: {objective: robust, from_attitude: [0, 0, 0, 1]}
limits: {joint_rate: 0.5, base_rate: 0.2}
"""
)
SPATIAL = """\
robot: {urdf: spatial_6dof.urdf, end_effector: end_effector}
task: pose
momentum: [0.5, 0.3, 0.1]
path:
  line: {from: [1, 0, 0], to: [-0.5, 0.8, 0.33]}
  attitude: {fixed: {axes: {x: [0.4683, 1.1683, -0.7], z: [1.5, -0.8, -0.33]}}}
timing: {law: quintic, duration: 100}
margin: {measure: arm, value: 5}
search: {samples: 256}
"""


HARDLY = """\
robot: {urdf: planar_2dof, end_effector: end_effector}
task: planar-position
path:
  line: {from: [1.5, 0, 0], to: [1.500001, 0, 0]}
timing: {law: quintic, duration: 100}
margin: {fraction: 0.01}
"""


UNTRIED = Check("ranges of headings", True)
NODES = ("time", "attitude", "joints", "base_position")


def planned(text, path):
    """A plan's file, made as the command makes it."""
    scenario = parse_scenario(text, Path("wish.yaml"))
    problem = scenario.problem()
    limits = scenario.limits(problem.model)
    found = ff.plan(problem, scenario.search(), limits=limits)
    save_plan(path, found, scenario, found.to_dict())
    return path


@pytest.fixture(scope="module")
def planar(tmp_path_factory):
    return planned(PLANAR, tmp_path_factory.mktemp("planar") / "plan.h5")


@pytest.fixture(scope="module")
def spatial(tmp_path_factory):
    return planned(SPATIAL, tmp_path_factory.mktemp("spatial") / "plan.h5")


def failed(path, **how):
    """Names and words of what fails."""
    return {one.name: one.told for one in check_plan(path, **how).checks if not one.passed}


@pytest.mark.parametrize("name", ["planar", "spatial"])
def test_a_plan_proves_itself_with_both_engines(request, name):
    verdict = check_plan(request.getfixturevalue(name), "mujoco")
    assert verdict.reasons == ()
    names = [one.name for one in verdict.checks]
    assert len(names) == len(set(names)) >= 16
    for wanted in ("as it was written", "end-effector position", "centre of mass", "|det S*|",
                   "angular momentum", "sigma", "step halving", "what the file tells",
                   "certificate in the file", "robust radius",
                   "mujoco: wrench on the base", "mujoco: final attitude"):  # fmt: skip
        assert wanted in names
    radius = next(one for one in verdict.checks if one.name == "robust radius")
    assert radius.unit.startswith("deg") or (radius.found, radius.allowed) == (0.0, 1.0)
    assert verdict.engine["forward"]["attitude"] < 1e-3
    assert verdict.engine["inverse"]["wrench"] < 1e-4 * verdict.engine["inverse"]["torque"]


def altered(source, path, change, resealed=True):
    """A copy of a file with something changed in it; with digests that fit if so wished."""
    shutil.copy(source, path)
    with h5py.File(path, "a") as file:
        change(file)
        if resealed:
            del file["digests"]
            seal(file)
    return path


def retold(*keys, by):
    """A change of the number, or whatever else, at a place of the file's document."""

    def change(file):
        document = json.loads(file["document"].asstr()[()])
        place = document
        for key in keys[:-1]:
            place = place[key]
        place[keys[-1]] = by(place[keys[-1]])
        file["document"][()] = json.dumps(document)

    return change


def rewritten(name, old, new):
    """A change of a text."""

    def change(file):
        text = file[name].asstr()[()]
        assert old in text
        file[name][()] = text.replace(old, new, 1)

    return change


def moved(name, row, column, by):
    """A change of a number."""

    def change(file):
        values = file[name][()]
        values[(row, column) if values.ndim == 2 else row] += by
        file[name][()] = values

    return change


def replaced(name, values):
    def change(file):
        attributes = dict(file[name].attrs)
        del file[name]
        file[name] = values
        file[name].attrs.update(attributes)

    return change


def shortened(first, beyond):
    """Only some nodes of the motion."""

    def change(file):
        for name in NODES:
            replaced(f"motion/{name}", file[f"motion/{name}"][first:beyond])(file)

    return change


def turned(file):
    attitudes = file["motion/attitude"][()]
    turn = Rotation.from_rotvec([0.0, 0.0, 1e-4])
    attitudes[50] = (turn * Rotation.from_quat(attitudes[50])).as_quat()
    file["motion/attitude"][()] = attitudes


def attribute(name, value, group="/"):
    def change(file):
        file[group].attrs[name] = value

    return change


def doubled(value):
    return 2.0 * value


TAMPERINGS = {
    "a joint": (moved("motion/joints", 40, 1, 1e-4), "end-effector position", "at t = "),
    "the first joint value": (
        moved("motion/joints", 0, 0, 1e-3), "end-effector position", "off its path by 0.0",
    ),
    "all of a joint": (
        moved("motion/joints", slice(None), 2, 1e-4), "end-effector attitude", "by 0.0001 rad",
    ),
    "an attitude": (turned, "attitude, integrated again", "differs by 0.0001 rad at t = "),
    "no unit quaternion": (
        moved("motion/attitude", 9, 3, 1e-3), "contents", "node 9, is no unit quaternion",
    ),
    "a time": (moved("motion/time", 44, 0, 1e-3), "end-effector position", "off its path"),
    "times out of order": (moved("motion/time", 44, 0, 30.0), "contents", "back and forth at t = "),
    "a base position": (
        moved("motion/base_position", 20, 0, 1e-6), "centre of mass", "by 1e-06 m at t = ",
    ),
    "the momentum": (
        rewritten("scenario", "[0, 0, 0.5]", "[0, 0, 0.6]"), "angular momentum",
        "the momentum is not the one given: it is off by 0.1 N m s",
    ),
    "the path": (
        rewritten("scenario", "[0, 0.5, 1.5]", "[0, 0.5, 1.51]"), "end-effector position",
        "off its path by 0.01",
    ),
    "the duration": (
        rewritten("scenario", "duration: 100", "duration: 101"), "whole motion",
        "a completed motion of 101 s that goes from 0 to 100 s",
    ),
    "the margin": (
        rewritten("scenario", "value: 5", "value: 50"), "what the file tells",
        "min_margin.required says 5, but it is 50",
    ),
    "the objective": (
        rewritten("scenario", "objective: robust", "objective: margin"), "what the file tells",
        "objective says robust, but it is margin",
    ),
    "the present attitude": (
        rewritten("scenario", "from_attitude: [0, 0, 0, 1]", "from_attitude: [0, 0, 1, 0]"),
        "what the file tells", "deviation_deg says",
    ),
    "a limit": (
        rewritten("scenario", "base_rate: 0.2", "base_rate: 0.001"), "limit base rate",
        "spacecraft breaks it",
    ),
    "no scenario": (
        rewritten("scenario", "task:", "tusk:"), "contents", "tusk: there is no such key",
    ),
    "a mass": (rewritten("robot", 'mass value="40', 'mass value="41'), "angular momentum", "off"),
    "a length": (
        rewritten("robot", 'xyz="2 0 0"', 'xyz="2.01 0 0"'),
        "end-effector position", "off its path",
    ),
    "no robot": (rewritten("robot", "</robot>", ""), "contents", "scenario or the robot in it"),
    "another hand": (
        attribute("end_effector", "link_3"), "what the file tells",
        "end_effector says link_3, but it is end_effector",
    ),
    "the least margin told": (
        retold("min_margin", "value", by=doubled), "what the file tells", "min_margin.value says",
    ),
    "the end told": (
        retold("final", "joints", 1, by=doubled), "what the file tells", "final.joints[1] says",
    ),
    "the errors told": (
        retold("residuals", "momentum", by=lambda _: 1e-3), "what the file tells",
        "residuals.momentum says 0.001",
    ),
    "the branch told": (
        retold("branch", by=lambda one: 1 - one), "what the file tells", "branch says",
    ),
    "a limit told": (
        retold("limits", 0, "worst", by=doubled), "limit joint rate", "the file says",
    ),
    "the robust radius told": (
        retold("robust_radius_deg", by=lambda one: one + 1.0), "robust radius", "the ranges say",
    ),
    "a range": (moved("ranges/branch_0", 0, 1, 0.05), "ranges of headings", "breaks the margin in"),
    "a narrower range": (
        moved("ranges/branch_0", 0, 1, -0.05), "ranges of headings", "keeps the margin outside",
    ),
    "a range told": (
        retold("attitude_ranges_deg", 0, "ranges", 0, 1, by=lambda one: one - 1.0),
        "what the file tells", "attitude_ranges_deg[0].ranges[0][1] says",
    ),
    "a bound": (
        retold("certificate", "least", 0, "bound", by=doubled), "certificate in the file",
        "gjm.bound says",
    ),
    "no certificate": (
        retold("certificate", by=lambda _: None), "certificate in the file", "there is none",
    ),
    "the end left out": (shortened(0, -16), "whole motion", "motion of 100 s that goes from 0 to"),
    "the beginning left out": (shortened(8, None), "whole motion", "of 100 s that goes from 0."),
    "all but the start left out": (shortened(0, 1), "whole motion", "goes from 0 to 0 s"),
    "its success denied": (attribute("feasible", False), "motion", "told to be infeasible"),
    "another full turn": (
        replaced("ranges/branch_0", [[0.0, 2.0 * np.pi]]), "ranges of headings",
        "breaks the margin in a range of branch 0",
    ),
    "a branch without ranges": (
        replaced("ranges/branch_1", np.empty((0, 2))), "ranges of headings",
        "keeps the margin outside a range of branch 1",
    ),
    "the branch of ranges": (
        retold("attitude_ranges_deg", 0, "branch", by=lambda _: 7), "what the file tells",
        "attitude_ranges_deg[0].branch says 7, but it is 0",
    ),
    "no branch told": (retold("branch", by=lambda _: None), "what the file tells", "branch says"),
    "a negative radius": (
        retold("robust_radius_deg", by=lambda _: -5.0), "robustness", "robust_radius_deg says -5",
    ),
    "the attitude's error told": (
        retold("certificate", "end_effector_attitude", "value", by=lambda _: 0.5),
        "certificate in the file", "end_effector_attitude says 0.5",
    ),
    "the scale of its momentum told": (
        retold("certificate", "momentum_scale", by=doubled), "certificate in the file",
        "momentum_scale says",
    ),
    "the ending": (
        attribute("ending", "SINGULAR", "motion"), "singular end", "differs from zero by",
    ),
    "a text for a number": (
        retold("min_margin", "value", by=str), "what the file tells", "min_margin.value says",
    ),
    "a text for a list": (
        retold("certificate", "least", by=str), "certificate in the file", "cannot be checked",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", TAMPERINGS)
def test_what_was_changed_is_named_also_when_its_digests_fit(planar, tmp_path, name, monkeypatch):
    change, check, words = TAMPERINGS[name]
    if check != "ranges of headings":  # which takes longer than all the rest
        monkeypatch.setattr(
            robust_checks, "_headings", lambda *_: Check("ranges of headings", True)
        )
    path = altered(planar, tmp_path / "altered.h5", change)
    told = failed(path)
    assert check in told
    assert words in told[check]


@pytest.mark.parametrize(
    ("change", "part"),
    [
        (rewritten("scenario", "search:", "# kept\nsearch:"), "scenario"),
        (rewritten("robot", "<robot", "<!-- kept --><robot"), "robot"),
        (moved("motion/joints", 40, 1, 1e-15), "motion/joints"),
        (retold("reason", by=lambda _: "because"), "document"),
        (attribute("software_numpy", "1.0"), "@software_numpy"),
    ],
)
def test_a_change_of_no_consequence_is_named_by_its_digest(
    planar, tmp_path, change, part, monkeypatch
):
    monkeypatch.setattr(robust_checks, "_headings", lambda *_: UNTRIED)
    told = failed(altered(planar, tmp_path / "altered.h5", change, resealed=False))
    assert set(told) == {"as it was written"}
    assert f"changed since: {part} " in told["as it was written"]


def test_a_file_without_digests_does_not_pass(planar, tmp_path):
    def change(file):
        del file["digests"]

    told = failed(altered(planar, tmp_path / "altered.h5", change, resealed=False))
    assert "digests are gone" in told["as it was written"]


def test_another_motion_in_the_file_is_not_the_one_told(planar, tmp_path):
    """Right in itself, from another heading: only what is told of it gives it away."""
    stored = load_plan(planar)
    problem = stored.problem()
    heading = ff.Motion.sample(stored.motion(), [0.0])[0].attitude
    other = (Rotation.from_rotvec([0, 0, 0.02]) * Rotation.from_quat(heading)).as_quat()
    near = stored.motion().initial.joints
    motion = ff.simulate(problem, other, joints=problem.branch_near(
        other, near + 0.02 * np.array([-1.0, 0.0, 0.0]), problem.branches(other)
    ).joints).chosen.motion  # fmt: skip

    def change(file):
        arrays = motion.times, motion.attitudes, motion.joints, motion.base_positions
        for name, values in zip(NODES, arrays, strict=True):
            del file[f"motion/{name}"]
            file[f"motion/{name}"] = values

    told = failed(altered(planar, tmp_path / "altered.h5", change))
    assert "initial.attitude" in told["what the file tells"]
    assert "end-effector position" not in told


@pytest.mark.parametrize(
    ("change", "check", "words"),
    [
        (retold("robust_radius_deg", by=lambda one: 3.0 * one), "robust radius", "1024 attitudes"),
        (
            retold("tolerance", "momentum", by=lambda one: 6.0 * one),
            "tolerance", "the margin is broken",
        ),
        (
            moved("motion/joints", slice(None), 3, 1e-3),
            "end-effector attitude", "turned away from its path by",
        ),
        (
            rewritten("scenario", "value: 5", "value: 60"), "arm",
            "is less than the margin 60",
        ),
    ],
)  # fmt: skip
def test_promises_in_space_are_tried(spatial, tmp_path, change, check, words):
    told = failed(altered(spatial, tmp_path / "altered.h5", change))
    assert words in told[check]


def test_servos_and_inverse_dynamics_tell_a_motion_that_is_none(spatial, tmp_path):
    """The spacecraft turns by a percent more than the joints make it: MuJoCo sees it alone, too."""

    def change(file):
        attitudes = Rotation.from_quat(file["motion/attitude"][()])
        turns = (attitudes[0].inv() * attitudes).as_rotvec()
        file["motion/attitude"][()] = (attitudes[0] * Rotation.from_rotvec(1.01 * turns)).as_quat()

    told = failed(altered(spatial, tmp_path / "altered.h5", change), engine="mujoco")
    assert "pushes the free base" in told["mujoco: wrench on the base"]
    assert "ends elsewhere" in told["mujoco: final attitude"]


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """The paper's first example from a heading that leads into a singularity."""
    scenario = ff.load_scenario("planar_3dof/parabola_nonstop")
    problem = scenario.problem()
    turn = np.deg2rad(140.0) / 2.0
    simulation = ff.simulate(problem, [0, 0, np.sin(turn), np.cos(turn)], branch=0)
    motion = simulation.chosen.motion
    assert motion.ending is ff.Ending.SINGULAR
    findings = check_limits(motion, scenario.limits(problem.model))
    path = tmp_path_factory.mktemp("simulated") / "bad.h5"
    save_motion(path, motion, scenario, simulation_document(simulation, findings))
    return path


def test_a_singular_motion_is_proved_to_be_singular(simulated):
    verdict = check_plan(simulated, "mujoco")
    assert verdict.reasons == ()
    assert [one.bound for one in verdict.certificate.least] == [0.0] * 3
    assert "singular end" in [one.name for one in verdict.checks]


def test_a_singular_motion_cut_short_is_not(simulated, tmp_path):
    told = failed(altered(simulated, tmp_path / "altered.h5", shortened(0, -40)))
    assert "differs from zero" in told["singular end"]


def test_what_is_singular_cannot_be_sold_as_a_plan(simulated, tmp_path):
    """Cut before its singularity and told to be completed."""

    def change(file):
        shortened(0, -40)(file)
        attribute("ending", "COMPLETED", "motion")(file)
        file.attrs["feasible"] = True

    told = failed(altered(simulated, tmp_path / "altered.h5", change))
    assert "a completed motion of 100 s that goes from 0 to" in told["whole motion"]


def followed(text, path, **how):
    """The file of a motion that was simulated from the identity attitude."""
    scenario = parse_scenario(text, Path("wish.yaml"))
    problem = scenario.problem()
    simulation = ff.simulate(problem, [0.0, 0.0, 0.0, 1.0], **how)
    assert simulation.chosen.motion.completed
    save_motion(path, simulation.chosen.motion, scenario, simulation_document(simulation, ()))
    return path


def test_a_spacecraft_that_tumbles_many_times_is_proved(tmp_path):
    """Errors of integration grow with every turn, and so does what is allowed."""
    tumbling = SPATIAL.replace("[0.5, 0.3, 0.1]", "[50, 0, 20]").replace("value: 5", "value: 0")
    tumbling = tumbling.replace("[-0.5, 0.8, 0.33]", "[0.6, 0.5, 0.2]")
    path = followed(tumbling, tmp_path / "tumbling.h5")
    attitudes = load_plan(path).attitudes
    assert angle_between(attitudes[1:], attitudes[:-1]).sum() > 20.0 * np.pi
    assert check_plan(path).reasons == ()


def test_an_arm_that_hardly_moves_is_proved(tmp_path):
    """A micrometre in a hundred seconds: momenta and torques are no larger than rounding."""
    path = followed(HARDLY, tmp_path / "hardly.h5")
    assert check_plan(path, "mujoco").reasons == ()


def test_a_recorded_path_with_many_knots_is_proved_by_mujoco(tmp_path):
    """Accelerations bend at every knot; motions are differentiated between knots."""
    s = np.linspace(0.0, 1.0, 81)
    noise = 1e-3 * np.random.default_rng(3).standard_normal((81, 2))
    rows = np.column_stack([2.0 - s, -0.5 + 1.2 * s]) + noise
    lines = "".join(f"{x:.6f},{y:.6f},0\n" for x, y in rows.tolist())
    (tmp_path / "noisy.csv").write_text("x,y,z\n" + lines)
    text = HARDLY.replace("line: {from: [1.5, 0, 0], to: [1.500001, 0, 0]}",
                          f"samples: {tmp_path / 'noisy.csv'}")  # fmt: skip
    path = followed(text, tmp_path / "noisy.h5")
    verdict = check_plan(path, "mujoco")
    assert verdict.reasons == ()
    assert verdict.engine["inverse"]["looks"] > 40


def test_an_infeasible_plan_has_nothing_to_prove(tmp_path):
    text = PLANAR.replace("value: 5", "value: 500")
    path = planned(text, tmp_path / "none.h5")
    assert "it has no motion to prove: " in failed(path)["motion"]


def run(*words):
    return CliRunner().invoke(app, ["check", *map(str, words)])


def test_the_command_tells_people_and_machines(planar, tmp_path):
    result = run(planar)
    assert (result.exit_code, result.stderr) == (0, "")
    assert "proved again" in result.stdout
    assert "Munthe-Kaas" in result.stdout
    assert "interval subdivision" in result.stdout
    bad = altered(planar, tmp_path / "bad.h5", moved("motion/joints", 40, 1, 1e-4))
    result = run(bad, "--json")
    assert result.exit_code == 1
    document = json.loads(result.stdout)
    assert document["proved"] is False
    assert any(one.startswith("end-effector position: ") for one in document["reasons"])
    assert document["certificate"]["end_effector_position"]["value"] > 1e-6
    result = run(bad)
    assert result.exit_code == 1
    assert "not proved" in result.stdout


def test_what_is_no_plan_file_is_bad_input(planar, tmp_path):
    (tmp_path / "text.h5").write_text("no plan")
    other = altered(planar, tmp_path / "map.h5", attribute("format", "freefloat map"))
    for path in (tmp_path / "none.h5", tmp_path / "text.h5", other):
        result = run(path)
        assert (result.exit_code, result.stdout) == (2, "")
        assert len(result.stderr.splitlines()) == 1


def test_an_unknown_engine_is_refused_and_a_missing_one_named(planar, monkeypatch):
    result = run(planar, "--engine", "bullet")
    assert result.exit_code == 2
    assert "'bullet' was given; accepted: mujoco" in result.stderr
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    with pytest.raises(InputError, match=r"pip install 'freefloat\[mujoco\]'"):
        check_plan(planar, "mujoco")
