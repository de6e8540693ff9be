"""Many disturbed motions and robots at once: each equals that with its own values."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.dynamics.denavit_hartenberg import inertial_row
from freefloat.ensemble.disturbed_verdicts import ManyMotions
from freefloat.ensemble.robots import Robots
from freefloat.motion.problem import Problem
from freefloat.planning.motions import SimulatedBranch
from tests.errors import error_key
from tests.motions import GOOD, bundled

pytestmark = pytest.mark.usefixtures("kernels")

LINE = ff.load_scenario("spatial_6dof/line").problem()
ATTITUDE = np.array([0.46008, 0.09337, 0.73519, -0.48898])
NONSTOP = ff.load_scenario("planar_3dof/parabola_nonstop").problem()
COUNT = 24


def disturbances(count: int, seed: int) -> dict[str, np.ndarray]:
    """Of the paper's Example 2: every argument that can differ between motions."""
    rng = np.random.default_rng(seed)
    turns = Rotation.from_rotvec(rng.uniform(-0.3, 0.3, (count, 3)))
    return {
        "attitudes": (turns * Rotation.from_quat(ATTITUDE)).as_quat(),
        "momenta": LINE.momentum + rng.uniform(-1.0, 1.0, (count, 3)),
        "wheels": rng.uniform(-0.2, 0.2, (count, 3)),
        "drifts": rng.uniform(-1e-3, 1e-3, (count, 3)),
        "durations": rng.uniform(50.0, 200.0, count),
        "scale_mass": rng.uniform(0.8, 1.2, count),
        "thresholds": rng.uniform(2.0, 12.0, count),
    }


def disturbed(values: dict[str, np.ndarray], k: int) -> Problem:
    """The problem of motion k, with a robot and a path of its own."""
    robot = {"urdf": "spatial_6dof", "end_effector": "end_effector"}
    axes = {"x": [0.4683, 1.1683, -0.7], "z": [1.5, -0.8, -0.33]}
    line = {"from": [1, 0, 0], "to": [-0.5, 0.8, 0.33]}
    return ff.load_scenario({
        "robot": robot | {"scale_mass": values["scale_mass"][k]},
        "task": "pose",
        "path": {"line": line, "attitude": {"fixed": {"axes": axes}}},
        "momentum": values["momenta"][k],
        "wheels": {"momentum": values["wheels"][k]},
        "drift": values["drifts"][k],
        "timing": {"duration": values["durations"][k]},
        "margin": {"measure": "arm", "value": values["thresholds"][k]},
    }).problem()  # fmt: skip


def assert_same(motions: ManyMotions, k: int, chosen: SimulatedBranch) -> None:
    problem = chosen.motion.problem
    assert bool(motions.feasible[k]) == chosen.feasible
    assert bool(motions.completed[k]) == chosen.motion.completed
    assert motions.branches[k] == chosen.branch.index
    assert motions.joints[k] == pytest.approx(chosen.branch.joints, abs=1e-9)
    assert motions.minimum_margins[k] == pytest.approx(chosen.minimum_margin, rel=1e-4)
    late = (motions.minimum_times[k], chosen.closest_approach.time)
    assert late[0] == pytest.approx(late[1], abs=1e-3 * problem.path.duration)
    assert motions.ended_at[k] == pytest.approx(chosen.motion.final.time, rel=1e-6)


@pytest.mark.slow
def test_disturbed_motions_are_those_of_robots_and_paths_of_their_own() -> None:
    values = disturbances(COUNT, seed=5)
    start = ff.simulate(LINE, ATTITUDE).chosen.branch.joints
    motions = ff.simulate_many(LINE, joints=start, **values)
    for k, attitude in enumerate(values["attitudes"]):
        problem = disturbed(values, k)
        branches = problem.branches(attitude)
        distances = [problem.model.joint_distance(b.joints, start) for b in branches]
        branch = branches[int(np.argmin(distances))].index
        assert_same(motions, k, ff.simulate(problem, attitude, branch=branch).chosen)
    assert 0 < motions.feasible.sum() < COUNT


@pytest.mark.slow
def test_without_a_branch_the_best_one_counts() -> None:
    headings = np.radians([20.0, 100.0, 140.0, 200.0])
    motions = ff.simulate_many(NONSTOP, headings=headings)
    for k, heading in enumerate(headings):
        assert_same(motions, k, ff.simulate(NONSTOP, heading=heading).chosen)


def test_motions_near_the_threshold_are_decided_precisely() -> None:
    """The paper's Example 2 with its minimum margin, and slightly less, as thresholds."""
    least = ff.simulate(LINE, ATTITUDE).chosen
    joints, margin = least.branch.joints, least.minimum_margin
    thresholds = margin * np.array([0.9, 1.0 - 5e-5, 1.0 - 2e-6, 1.0, 1.0 + 2e-6])
    motions = ff.simulate_many(LINE, ATTITUDE, joints=joints, thresholds=thresholds)
    assert motions.deciders.tolist() == [0, 1, 3, 3, 3]
    assert motions.feasible.tolist() == [True, True, True, True, False]


def test_a_start_out_of_reach_is_no_motion() -> None:
    far = ff.load_scenario("ur5_servicer/arc").problem()
    attitudes = np.array([[0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0]])
    motions = ff.simulate_many(far, attitudes)
    reached = [bool(far.branches(attitude)) for attitude in attitudes]
    assert motions.reached.tolist() == reached == [True, False]
    assert np.isnan(motions.joints[1]).all()
    assert (motions.branches[1], motions.feasible[1]) == (-1, False)


@pytest.mark.parametrize(
    ("keys", "key"),
    [
        ({"momenta": [1.0, 2.0]}, "momenta"),
        ({"momenta": np.zeros((3, 3)), "durations": np.ones(2)}, "durations"),
        ({"durations": 0.0}, "durations"),
        ({"scale_mass": [1.0, -1.0]}, "scale_mass"),
        ({"thresholds": -1.0}, "thresholds"),
        ({"wheels": [0.0, 0.1, 0.0]}, "wheels"),
        ({"drifts": [0.0, 0.0, 0.1]}, "drifts"),
        ({"momenta": [0.0, 0.0, 1e6]}, "momenta"),
        ({"momenta": np.zeros((0, 3))}, "momenta"),
        ({"momenta": [[0.0, 0.0, 1.0], [0.0]]}, "momenta"),
        ({"headings": []}, "headings"),
        ({"headings": [[0.1], [0.2]]}, "headings"),
        ({"durations": 1e300}, "durations"),
        ({"scale_mass": {"link_2": 1e12}}, "scale_mass.link_2"),
        ({"scale_mass": {"link_2": [1.0, -1.0]}}, "scale_mass.link_2"),
        ({"scale_mass": {"link_9": 1.0}}, "scale_mass.link_9"),
        ({"joints": [1.0]}, "joints"),
        ({"branch": 2}, "branch"),
        ({"branch": 1, "joints": [0.1, 0.2, 0.3]}, "branch"),
        ({"attitudes": [0.0, 0.0, 0.0, 1.0]}, "heading"),
    ],
)
def test_invalid_input_is_named(keys: dict[str, Any], key: str) -> None:
    assert error_key(ff.simulate_many, NONSTOP, **({"headings": 0.1} | keys)) == key


FACTORS = ("spacecraft", "link_2", "link_3", "link_6")


def test_robots_without_the_plane_of_their_measure_or_task() -> None:
    """Half of a symmetric pair of masses beside the plane leaves it with a factor of its own."""
    problem = bundled("spatial_6dof/line")
    row = inertial_row(10.0, np.array([0.0, 0.05, 0.0]), 0.1 * np.eye(3))
    rows = {"link_3": np.array([row, row * 0.0])}
    model = problem.model
    robots = Robots.of(model, np.arange(2), lambda k: model, factors={}, rows=rows)
    assert robots.suit(problem).tolist() == [False, True]
    planar = bundled("planar_3dof/parabola")
    above = inertial_row(np.full(2, 10.0), np.array([[0, 0, 0.1], [0.1, 0, 0]]), 0.1 * np.eye(3))
    robots = Robots.of(planar.model, np.arange(2), lambda k: planar.model, factors={},
                       rows={"link_2": above})  # fmt: skip
    assert robots.suit(planar).tolist() == [False, True]


@pytest.fixture(scope="module")
def spatial(kernels: None) -> ff.Problem:
    return bundled("spatial_6dof/line")


def masses(count: int) -> dict[str, object]:
    rng = np.random.default_rng(3)
    return {
        "momenta": rng.uniform(-1.0, 1.0, (count, 3)),
        "scale_mass": {name: rng.uniform(0.7, 1.4, count) for name in FACTORS},
    }


@pytest.mark.slow
@pytest.mark.parametrize("measure", ["arm", "sigma"])
def test_motions_are_those_of_models_of_their_own(spatial: ff.Problem, measure: str) -> None:
    margin = ff.Margin(ff.singularity_measure(spatial.model, spatial.task, measure), 0.05)
    problem, values = spatial.replace(margin=margin), masses(6)
    motions = ff.simulate_many(problem, GOOD, branch=0, **values)
    for k in range(6):
        factors = {name: float(factor[k]) for name, factor in values["scale_mass"].items()}
        model = ff.FreeFloatingModel.from_urdf("spatial_6dof", "end_effector", scale_mass=factors)
        own = problem.replace(model=model, momentum=values["momenta"][k])
        chosen = ff.simulate(own, GOOD, branch=0).chosen
        assert motions.joints[k] == pytest.approx(chosen.branch.joints, abs=1e-9)
        assert motions.minimum_margins[k] == pytest.approx(chosen.minimum_margin, rel=1e-4)
        assert bool(motions.feasible[k]) == chosen.feasible
    best = ff.simulate_many(problem, GOOD, **masses(1))
    assert best.minimum_margins[0] >= motions.minimum_margins[0] * (1.0 - 1e-4)
