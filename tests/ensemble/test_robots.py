"""Many robots with other masses and mounts: all about each equals that of its own model."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import freefloat as ff
from freefloat.dynamics.link_frames import inertial_row, link_frames
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.ensemble.robots import Robots
from freefloat.motion.revolutions import mean_inertia
from freefloat.robot.parts import Mount
from tests.motions import GOOD, bundled
from tests.robots import random_robot

COUNT = 3
FACTORS = ("spacecraft", "link_2", "link_3", "link_6")


def assert_same(robots: Robots) -> None:
    """Tables, centre of mass, reach and inertia of each robot are those of its model."""
    q = np.random.default_rng(0).uniform(-1.0, 1.0, robots.nominal.dof)
    attitude = np.array([0.1, 0.5, -0.5, 0.7])
    offsets = robots.with_paths_from(attitude, q).offsets
    base = robots.nominal.base_position(attitude, q)
    for k in range(len(robots)):
        model = robots.model(k)
        frames, virtual = link_frames(model), VirtualManipulator.of(model)
        np.testing.assert_allclose(robots.bodies[k], frames.bodies, rtol=0, atol=1e-9)
        np.testing.assert_allclose(robots.base[k, :3], frames.base[:3], rtol=0, atol=1e-12)
        np.testing.assert_allclose(robots.base[k, 3], frames.base[3], rtol=0, atol=1e-12)
        assert robots.reaches()[k] == pytest.approx(virtual.reach, rel=1e-12)
        assert robots.mean_inertias[k] == pytest.approx(mean_inertia(model), rel=1e-12)
        np.testing.assert_allclose(
            offsets[k], model.base_position(attitude, q) - base, rtol=0, atol=1e-12
        )


@pytest.mark.parametrize("chain", ["RRRRRR", "PRCFP", "RFP"])
def test_factors_on_links(chain: str, rng: np.random.Generator) -> None:
    robot = random_robot(rng, chain, "FR")
    model = ff.FreeFloatingModel.from_urdf(robot.text, robot.end_effector)
    factors = {name: rng.uniform(0.5, 2.0, COUNT) for name in model.link_places}

    def model_of(k: int) -> ff.FreeFloatingModel:
        return model.scaled({name: float(factor[k]) for name, factor in factors.items()})

    assert_same(Robots.of(model, np.arange(COUNT), model_of, factors=factors))


def test_spacecraft_payload_and_mount(rng: np.random.Generator) -> None:
    mass, com = rng.uniform(100.0, 300.0, COUNT), rng.uniform(-0.1, 0.1, (COUNT, 3))
    moments = np.array([rng.uniform(10.0, 12.0, 3) for _ in range(COUNT)])
    mounts = [Mount(*rng.uniform(-0.5, 0.5, (2, 3))) for _ in range(COUNT)]

    def model_of(k: int) -> ff.FreeFloatingModel:
        return ff.FreeFloatingModel.from_urdf(
            "example-robot-data:ur5", "tool0",
            spacecraft=ff.Spacecraft(mass[k], moments[k], mounts[k], com=com[k]),
            payload=ff.Payload(mass[k] / 9.0, moments[k], com[k]),
        )  # fmt: skip

    matrices = moments[:, :, None] * np.eye(3)
    rows = {"spacecraft": inertial_row(mass, com, matrices),
            "payload": inertial_row(mass / 9.0, com, matrices)}  # fmt: skip
    poses = [mount.pose for mount in mounts]
    positions, rotations = (np.array([getattr(pose, name) for pose in poses])
                            for name in ("position", "rotation"))  # fmt: skip
    robots = Robots.of(
        model_of(0), np.arange(COUNT), model_of, factors={}, rows=rows,
        mounts=(poses[0], positions, rotations),
    )  # fmt: skip
    for k, base in enumerate(robots.base):  # the x axis of frame 0 is any normal of the first axis
        frame = link_frames(robots.model(k)).base
        np.testing.assert_allclose(base[2:], frame[2:], rtol=0, atol=1e-12)
        np.testing.assert_allclose(base[:3] @ base[:3].T, np.eye(3), rtol=0, atol=1e-12)
        state = np.array([0.1, 0.5, -0.5, 0.7]), np.full(6, 0.3)
        first, own = (robots.model(number).base_position(*state) for number in (0, k))
        offset = robots.with_paths_from(*state).offsets[k]
        np.testing.assert_allclose(offset, own - first, rtol=0, atol=1e-12)
        assert robots.mean_inertias[k] == pytest.approx(mean_inertia(robots.model(k)), rel=1e-12)


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


def test_results_depend_on_the_own_robot_alone(spatial: ff.Problem) -> None:
    """Bit for bit: not on the number of motions, their order or the number of threads."""
    values = disturbances(200)
    every = ff.simulate_many(spatial, GOOD, branch=0, threads=2, **values)
    few = slice(None, None, -13)
    some = {"momenta": values["momenta"][few],
            "scale_mass": {name: f[few] for name, f in values["scale_mass"].items()}}  # fmt: skip
    fewer = ff.simulate_many(spatial, GOOD, branch=0, threads=1, **some)
    expected = arrays_of(every)
    for name, array in arrays_of(fewer).items():
        assert np.array_equal(array, expected[name][few], equal_nan=True), name


def arrays_of(motions: Any) -> dict[str, Any]:
    values = dict(vars(motions))
    return values | values.pop("limits")._asdict()
