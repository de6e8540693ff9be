"""Certified boxes of the joint space agree with det A of Pinocchio's matrices."""

from __future__ import annotations

import numpy as np
import pytest

import freefloat as ff
from freefloat.beyond.joint_space.singularity_map import Kind, SingularityMap
from freefloat.dynamics.joint_space import joint_box
from tests.errors import error_key
from tests.motions import bundled
from tests.robots import random_robot

SIGNS = {Kind.POSITIVE: 1.0, Kind.NEGATIVE: -1.0}


def contradictions(
    found: SingularityMap, model: ff.FreeFloatingModel, task: str, count: int
) -> int:
    """Number of random configurations whose det A has another sign than their box."""
    lower, upper = joint_box(model)
    q = np.random.default_rng(4).uniform(lower, upper, (count, model.dof))
    for name, value in found.fixed.items():
        q[:, model.joint_names.index(name)] = value
    measure = ff.singularity_measure(model, task, "system")
    kinds = found.kinds(q)
    signs = {kind: np.sign([measure(row) for row in q[kinds == kind]]) for kind in SIGNS}
    return sum(int(np.count_nonzero(signs[kind] != SIGNS[kind])) for kind in SIGNS)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "resolution", "decided"), [
    ("planar_3dof/parabola", 0.1, 0.999), ("spatial_6dof/line", 2.0, 0.90),
])  # fmt: skip
def test_random_configurations_do_not_contradict_certified_boxes(
    name: str, resolution: float, decided: float
) -> None:
    problem = bundled(name)
    found = ff.singularity_map(problem.model, problem.task, np.radians(resolution))
    volumes = found.volumes
    assert sum(volumes.values()) == pytest.approx(1.0)
    assert volumes[Kind.POSITIVE] + volumes[Kind.NEGATIVE] > decided
    assert contradictions(found, problem.model, problem.task, 4000) == 0


def test_fixed_and_prismatic_joints() -> None:
    robot = random_robot(np.random.default_rng(9), "RPRRPR")
    model = ff.FreeFloatingModel.from_urdf(robot.text, robot.end_effector)
    fixed = {model.joint_names[0]: 0.3, model.joint_names[3]: -1.0}
    found = ff.singularity_map(model, resolution=np.radians(10.0), fixed=fixed)
    assert found.joints == [1, 2, 4]
    assert contradictions(found, model, "pose", 4000) == 0


@pytest.mark.parametrize(
    ("key", "changes"), [("fixed", {"fixed": {"elbow": 0.0}}), ("resolution", {"resolution": 0.0})]
)
def test_bad_input(key: str, changes: dict) -> None:
    problem = bundled("planar_2dof/line")
    assert error_key(ff.singularity_map, problem.model, problem.task, **changes) == key
