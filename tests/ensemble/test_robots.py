"""Many robots with other masses and mounts: all about each equals that of its own model."""

from __future__ import annotations

import numpy as np
import pytest

import freefloat as ff
from freefloat.dynamics.link_frames import inertial_row
from freefloat.ensemble.robots import Robots
from tests.motions import GOOD, bundled

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


def disturbances(count: int) -> dict[str, object]:
    rng = np.random.default_rng(3)
    return {
        "momenta": rng.uniform(-1.0, 1.0, (count, 3)),
        "scale_mass": {name: rng.uniform(0.7, 1.4, count) for name in FACTORS},
    }


@pytest.mark.slow
@pytest.mark.parametrize("measure", ["arm", "sigma"])
def test_motions_are_those_of_models_of_their_own(spatial: ff.Problem, measure: str) -> None:
    margin = ff.Margin(ff.singularity_measure(spatial.model, spatial.task, measure), 0.05)
    problem, values = spatial.replace(margin=margin), disturbances(6)
    motions = ff.simulate_many(problem, GOOD, branch=0, **values)
    for k in range(6):
        factors = {name: float(factor[k]) for name, factor in values["scale_mass"].items()}
        model = ff.FreeFloatingModel.from_urdf("spatial_6dof", "end_effector", scale_mass=factors)
        own = problem.replace(model=model, momentum=values["momenta"][k])
        chosen = ff.simulate(own, GOOD, branch=0).chosen
        assert motions.joints[k] == pytest.approx(chosen.branch.joints, abs=1e-9)
        assert motions.minimum_margins[k] == pytest.approx(chosen.minimum_margin, rel=1e-4)
        assert bool(motions.feasible[k]) == chosen.feasible
    best = ff.simulate_many(problem, GOOD, **disturbances(1))
    assert best.minimum_margins[0] >= motions.minimum_margins[0] * (1.0 - 1e-4)
