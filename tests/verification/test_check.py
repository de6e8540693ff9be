"""``ff.check``: what a record states is recomputed, and every altered value is a discrepancy."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.certificate.certificate import certify
from freefloat.ensemble.endings import SINGULAR
from freefloat.motion.law import PathLaw
from freefloat.motion.motion import Ending
from freefloat.planning.simulation import Simulation
from freefloat.so3 import angle_between
from freefloat.verification import range_checks as robustness
from freefloat.verification.comparisons import Check
from tests.commands import document, run
from tests.errors import error_key
from tests.motions import bundled
from tests.planes import planar_problem, turn_to
from tests.plans import planar_plan, spatial_plan
from tests.redundant import redundant
from tests.samples import plans

pytestmark = pytest.mark.usefixtures("kernels")


@pytest.fixture(scope="module", autouse=True)
def certified_once():
    """The certificate of a motion, recomputed once for all checks of the same motion."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("freefloat.verification.path_motions.certify", cache(certify))
        yield


@pytest.fixture(scope="module")
def planar():
    return planar_plan()


@pytest.fixture(scope="module")
def spatial():
    return spatial_plan()


def failed(result, **how):
    return {check.name for check in ff.check(result, **how).discrepancies}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["planar", "spatial"])
def test_a_plan_is_verified_with_both_engines(request, name):
    report = ff.check(request.getfixturevalue(name), engine="mujoco")
    assert report.discrepancies == ()
    names = [check.name for check in report.checks]
    assert len(names) == len(set(names))
    assert {
        "end-effector position", "|det S*|", "angular momentum", "sigma",
        "joints, integrated again", "chosen.closest_approach.value", "chosen.branch.index",
        "robust_radius",
        "mujoco: end-effector position", "mujoco: angular momentum", "mujoco: wrench on the base",
        "mujoco: final attitude",
    } <= set(names)  # fmt: skip
    assert report.runs.forward.attitude < 1e-3
    assert report.runs.inverse.wrench < 1e-4 * report.runs.inverse.torque
    assert report.to_dict().keys() >= {"proved", "kind", "reasons", "checks", "certificate"}
    json.dumps(report.to_dict(), allow_nan=False)


@pytest.mark.slow
def test_ranges_of_headings_that_keep_limits_of_attitude_are_verified():
    problem = ff.load_scenario("planar_2dof/line").problem()
    sun = ff.PointingLimit("spacecraft", [1, 0, 0], 1.2, "outside", direction=[1, 0, 0])
    limits = ff.Limits(pointing=[sun], base_turn=2.0, clearance="off")
    found = ff.plan(problem, limits=limits)
    assert found.feasible
    assert ff.check(found).passed
    shifted = replace(found, limits=replace(limits, pointing=[replace(sun, angle=1.0)]))
    assert "ranges of headings" in {entry.name for entry in ff.check(shifted).discrepancies}


@pytest.mark.slow
def test_ranges_of_retimed_plans_end_with_the_search():
    """They are not recomputed: the timing is of the chosen motion alone."""
    content = ff.load_scenario("planar_2dof/arc").content
    scenario = content.model_dump(exclude_unset=True, by_alias=True)
    scenario["timing"]["law"] = "optimal"
    scenario["limits"] = {"joint_rate": 0.2, "joint_acceleration": 0.1}
    present = [0.0, 0.0, 0.54985, -0.83526]
    scenario["search"] = {"objective": "nearest", "from_attitude": present, "within_deg": 10}
    plan = ff.load_scenario(scenario).plan()
    assert ff.check(plan).passed
    first, *others = plan.ranges
    wider = replace(first.ranges[0], high=first.ranges[0].low + 5.4)
    forged = replace(plan, ranges=(replace(first, ranges=(wider,)), *others))
    assert failed(forged) == {"ranges of headings"}


@pytest.mark.slow
def test_ranges_of_a_redundant_arm_that_few_starts_reach_are_verified():
    """The plan follows motions from heading to heading, as the check does once more."""
    start = redundant("5", ff.Task.PLANAR_POSITION, None, 1)
    motion = ff.simulate(start.problem, start.attitude).motion
    margin = start.problem.margin
    least = abs(ff.closest_approach(motion, margin.measure).value)
    problem = start.problem.replace(margin=replace(margin, threshold=0.9 * least))
    turns = angle_between(motion.attitudes, motion.attitudes[0])
    limits = ff.Limits(base_turn=1.02 * turns.max(), clearance="off")
    plan = ff.plan(problem, ff.Search("nearest", start.attitude), limits)
    assert plan.feasible
    assert ff.check(plan).discrepancies == ()
    (entry,) = plan.ranges
    for wrong in (-0.02, 0.02):
        part = replace(entry.ranges[0], low=entry.ranges[0].low + wrong)
        forged = replace(entry, ranges=(part, *entry.ranges[1:]))
        assert "ranges.0.ranges.0.low" in failed(replace(plan, ranges=(forged,)))


def with_motion(result, **changes):
    chosen = result.chosen
    chosen = replace(chosen, motion=replace(chosen.motion, **changes))
    if isinstance(result, Simulation):
        return Simulation((chosen,), chosen)
    return replace(result, chosen=chosen)


def with_problem(plan, **changes):
    problem = replace(plan.problem, **changes)
    return with_motion(replace(plan, problem=problem), law=PathLaw(problem))


def moved(name, rows, columns, by):
    """A change of an array of the motion."""

    def change(plan):
        values = getattr(plan.chosen.motion, name).copy()
        values[(rows, columns) if values.ndim == 2 else rows] += by
        return with_motion(plan, **{name: values})

    return change


def shortened(first, beyond, **changes):

    def change(plan):
        motion, nodes = plan.chosen.motion, slice(first, beyond)
        arrays = {key: getattr(motion, key)[nodes] for key in ("times", "attitudes", "joints")}
        return with_motion(plan, **arrays, **changes)

    return change


def longer(plan):
    return with_problem(plan, path=plan.problem.stretched(1.01).path)


ALTERATIONS = {
    "a joint": (moved("joints", 40, 1, 1e-4), "end-effector position"),
    "the momentum": (lambda p: with_problem(p, momentum=np.array([0, 0, 0.6])), "angular momentum"),
    "the duration": (longer, "whole motion"),
    "the margin": (
        lambda p: with_problem(p, margin=replace(p.problem.margin, threshold=140.0)), "|det A|"),
    "a limit": (lambda p: replace(p, limits=replace(p.limits, base_rate=0.001)), "limit base rate"),
    "its motion left out": (lambda plan: replace(plan, chosen=None), "motion"),
    "the ending": (lambda plan: with_motion(plan, ending=Ending.SINGULAR), "singular end"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", ALTERATIONS)
def test_an_altered_value_is_a_discrepancy(planar, name, monkeypatch):
    """Without the check of ranges of headings, which takes longer than all others."""
    untried = Check("ranges of headings", True)
    monkeypatch.setattr(robustness, "_heading_check", lambda *_: untried)
    change, check = ALTERATIONS[name]
    assert check in failed(change(planar))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "check"),
    [
        (lambda plan: replace(plan, robust_radius=3.0 * plan.robust_radius), "robust radius"),
        (lambda plan: replace(plan, tolerance=replace(
            plan.tolerance, momentum=6.0 * plan.tolerance.momentum)), "tolerance: the momentum ["),
        (lambda plan: replace(plan, tolerance=replace(
            plan.tolerance, longest=2.0 * plan.tolerance.longest)), "tolerance: the duration 5"),
        (lambda plan: replace(plan, tolerance=replace(
            plan.tolerance, shortest=plan.tolerance.longest)), "tolerance: "),
        (moved("joints", slice(None), 3, 1e-3), "end-effector orientation"),
        (lambda p: with_problem(p, margin=replace(p.problem.margin, threshold=60.0)),
         "|in-plane factor|"),
    ],
    ids=["robust radius", "momentum", "longest", "shortest", "joints", "margin"],
)  # fmt: skip
def test_robustness_in_space_is_verified(spatial, change, check):
    assert any(entry.reason.startswith(check) for entry in ff.check(change(spatial)).discrepancies)


@pytest.mark.slow
def test_mujoco_alone_finds_a_motion_that_violates_the_equations(spatial):
    """The spacecraft rotates by a percent more than the joints make it."""
    attitudes = Rotation.from_quat(spatial.chosen.motion.attitudes)
    rotations = (attitudes[0].inv() * attitudes).as_rotvec()
    other = (attitudes[0] * Rotation.from_rotvec(1.01 * rotations)).as_quat()
    names = failed(with_motion(spatial, attitudes=other), engine="mujoco")
    assert {
        "mujoco: end-effector position", "mujoco: angular momentum", "mujoco: wrench on the base",
        "mujoco: final attitude",
    } <= names  # fmt: skip


@pytest.fixture(scope="module")
def simulated():
    """The paper's first example from a heading that leads into a singularity."""
    problem = ff.load_scenario("planar_3dof/parabola_nonstop").problem()
    half = np.deg2rad(140.0) / 2.0
    simulation = ff.simulate(problem, [0, 0, np.sin(half), np.cos(half)], branch=0)
    assert simulation.chosen.motion.ending is Ending.SINGULAR
    return simulation


@pytest.mark.slow
def test_a_result_without_a_motion_is_infeasible_as_it_states():
    """One that states to be feasible is a discrepancy."""
    line = ff.paths.PolynomialCurve.line([2.2, 0.0, 0.0], [2.6, 0.0, 0.0])
    plan = ff.plan(ff.Problem("planar_2dof", path=line, duration=20, margin=("gjm", 0.1)))
    for stated, name in ((plan, "feasible"), (replace(plan, feasible=True), "motion")):
        (missing,) = (check for check in ff.check(stated).checks if not check.passed)
        assert missing.name == name


def test_a_singular_motion_is_verified_to_be_singular(simulated):
    report = ff.check(simulated, "mujoco")
    assert report.discrepancies == ()
    assert [entry.bound for entry in report.certificate.minima] == [0.0] * 3
    assert "singular end" in [check.name for check in report.checks]


@pytest.mark.slow
def test_a_singular_motion_cut_short_is_neither_singular_nor_complete(simulated):
    assert "singular end" in failed(shortened(0, -40)(simulated))
    assert "whole motion" in failed(shortened(0, -40, ending=Ending.COMPLETED)(simulated))


@pytest.mark.slow
def test_a_motion_whose_last_joint_would_spin_is_verified_to_end_there():
    """Wheels, momentum, another arm: det S* of a pointing arm need not vanish at its end."""
    problem = ff.load_scenario("servicing/two_arms").problem()
    problem = problem.replace(momentum=[1.0, -2.0, 1.5], wheel_momentum=[0.0, 4.0, 1.0])
    simulation = ff.simulate(problem, [0, 0, 0, 1], branch=2)
    assert simulation.chosen.motion.ending is Ending.SINGULAR
    assert ff.check(simulation).discrepancies == ()
    assert "singular end" in failed(shortened(0, -40)(simulation))


def test_a_motion_that_ends_where_it_begins_is_verified_to_be_singular_there():
    problem = ff.load_scenario("planar_2dof/line").problem()
    attitude = [0.0, 0.0, 0.0, 1.0]
    elbow = brentq(lambda q: problem.margin.measure([0.3, q]), -1, 1)
    start = problem.model.end_effector_pose(attitude, [0.3, elbow])
    line = ff.paths.PolynomialCurve.line(start.position, 0.8 * start.position)
    path = ff.EndEffectorPath(line, ff.paths.FixedOrientation(start.rotation))
    problem = problem.replace(path=ff.TimedPath(path, problem.path.timing), limits=None)
    singular, regular = (ff.simulate(problem, attitude, branch=k) for k in (0, 1))
    assert not singular.motion.panels
    assert ff.check(singular).discrepancies == ()
    stopped = regular.motion.cut(0.0, Ending.SINGULAR)
    chosen = replace(regular.chosen, motion=stopped)
    assert failed(replace(regular, chosen=chosen)) == {"singular start"}


@pytest.mark.parametrize(("seed", "direction"), [(0, "x"), (5, "y")])
def test_a_map_with_singular_motions_is_verified_after_a_rounding(seed, direction, tmp_path):
    """The file states the path as polynomials; the last steps to a singularity differ."""
    problem = planar_problem(seed, "+++", turn_to(direction), "planar-pose", "gjm")
    found = ff.attitude_map(problem, 180)
    assert (found.results.motions.endings == SINGULAR).any()
    ff.save(found, tmp_path / "map.h5")
    assert ff.check(ff.load(tmp_path / "map.h5")).discrepancies == ()


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "motion.h5"
    path.write_bytes(plans()[0])
    return path


@pytest.mark.slow
def test_the_command_prints_checks_or_json(file):
    result = run("check", file)
    assert (result.exit_code, result.stderr) == (0, "")
    assert "end-effector position" in result.stdout
    printed = document("check", file)
    assert printed["proved"] is True
    assert printed["file"] == str(file)
    assert printed["checks"][0].keys() >= {"name", "passed", "told", "found", "allowed", "time"}


def test_maps_and_unknown_engines_are_input_errors(simulated):
    assert error_key(ff.check, simulated.chosen.motion.problem) == "result"
    assert error_key(ff.check, simulated, "bullet") == "engine"


@pytest.mark.slow
def test_a_start_of_a_redundant_arm_that_joint_values_choose_is_verified(tmp_path):
    """Also where they are the values of an arm branch, which has another number in the file."""
    problem = ff.load_scenario("panda_servicer/line").problem()
    attitude = problem.attitude([0.0, 0.0, 0.0, 1.0])
    joints = problem.branches(attitude)[3].joints
    simulation = ff.simulate(problem.replace(start_joints=joints), attitude)
    assert simulation.chosen.branch.joints == pytest.approx(joints, abs=1e-9)
    ff.save(simulation, tmp_path / "motion.h5")
    report = ff.check(ff.load(tmp_path / "motion.h5"))
    assert report.passed, report.discrepancies


TURNED = [0.06961854, 0.47314084, -0.1914662, 0.85710657]
FOLDED = [1.53074254, 0.64349786, -1.78187367, 0.63674743, 3.14009785, -2.72809319, 2.00500715]
"""A present state of the bundled Canadarm2, whose quietest motion hardly keeps the margin."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "fraction", "search"),
    [
        ("emulator/line", 3.3, ff.Search(samples=8)),  # a range lies between the headings tried
        ("ssrms/sweep", 1.0, ff.Search("still", TURNED, samples=128, seed=997, joints=FOLDED)),
    ],
)
def test_narrow_ranges_and_margins_nearly_used_up_are_verified(name, fraction, search):
    problem = bundled(name)
    margin = ff.Margin(problem.margin.measure, fraction * problem.margin.threshold)
    assert failed(ff.plan(problem.replace(margin=margin), search)) == set()
