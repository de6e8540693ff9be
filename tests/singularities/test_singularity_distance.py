"""Distances to singularities agree with searches along the singular curve, and hold everywhere."""

import numpy as np
import pytest

import freefloat as ff
from freefloat.beyond.joint_space.distance import distance_to_singularity
from freefloat.rotations import rotation_matrix
from freefloat.so3 import heading_quaternion
from tests.errors import error_key
from tests.motions import bundled
from tests.robots import random_robot


def case(name: str, seed: int = 12) -> tuple[ff.FreeFloatingModel, ff.Task]:
    """Of a bundled scenario, or a random robot of a structure."""
    if "/" in name:
        problem = bundled(name)
        return problem.model, problem.task
    robot = random_robot(np.random.default_rng(seed), name)
    return robot.model(), ff.Task.POSE


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ur5_servicer/arc", "RPRRPR"])
def test_no_configuration_within_the_bound_has_the_other_sign(name: str) -> None:
    model, task = case(name)
    measure = ff.singularity_measure(model, task, "system")
    rng = np.random.default_rng(5)
    largest = max(abs(measure(q)) for q in rng.uniform(-2.0, 2.0, (500, model.dof)))
    q = rng.uniform(-0.5, 0.5, model.dof)
    found = distance_to_singularity(model, q, task)
    assert found.joints is not None
    assert found.direction is not None
    assert found.lower_bound >= 0.95 * found.distance
    assert np.linalg.norm(found.joints - q) == pytest.approx(found.distance)
    assert abs(measure(found.joints)) < 1e-8 * largest
    offsets = rng.normal(size=(5000, model.dof))
    offsets *= found.lower_bound / np.linalg.norm(offsets, axis=1, keepdims=True)
    offsets[::2] *= rng.uniform(size=(2500, 1))
    sign = np.sign(measure(q))
    assert all(np.sign(measure(q + offset)) == sign for offset in offsets)
    S = ff.generalized_jacobian(model, found.joints, task)
    assert np.linalg.norm(found.direction) == pytest.approx(1.0)
    assert np.abs(found.direction @ S).max() < 1e-6 * np.abs(S).max()


def test_the_printed_singularity_of_papadopoulos_and_dubowsky() -> None:
    problem = bundled("planar_2dof/line")
    q = np.radians([-65.0, -11.41080])
    heading = 0.4
    found = distance_to_singularity(
        problem.model, q, problem.task, attitude=heading_quaternion(heading)
    )
    assert found.distance < 1e-6
    assert found.direction == pytest.approx([-0.12213, 0.99251], abs=2e-5)
    R = rotation_matrix(heading_quaternion(heading))[:2, :2]
    assert found.inertial_direction == pytest.approx(R @ found.direction)


@pytest.mark.parametrize(("key", "name", "joints"), [
    ("robot", "panda_servicer/line", [0.1] * 7), ("joints", "RPRRPR", [0.0, 99.0, 0, 0, 0, 0]),
])  # fmt: skip
def test_bad_input(key: str, name: str, joints: list[float]) -> None:
    model, task = case(name)
    assert error_key(distance_to_singularity, model, joints, task) == key
