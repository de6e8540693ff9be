"""Certified boxes of the joint space agree with det A of Pinocchio's matrices."""

from pathlib import Path

import numpy as np
import pytest

import freefloat as ff
from freefloat.beyond.joint_space.singularity_map import Kind, SingularityMap
from freefloat.dynamics.joint_space import joint_box
from freefloat.io.verified_hdf5 import AlteredFileError
from tests.motions import bundled
from tests.result_files import altered, replaced
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
def test_random_configurations_do_not_contradict_certified_boxes(name, resolution, decided):
    problem = bundled(name)
    found = ff.singularity_map(problem.model, problem.task, np.radians(resolution))
    volumes = found.volumes
    assert sum(volumes.values()) == pytest.approx(1.0)
    assert volumes[Kind.POSITIVE] + volumes[Kind.NEGATIVE] > decided
    assert contradictions(found, problem.model, problem.task, 4000) == 0


@pytest.fixture(scope="module")
def fixed() -> SingularityMap:
    """Of an arm with prismatic joints, two joints fixed."""
    model = random_robot(np.random.default_rng(9), "RPRRPR").model()
    values = {model.joint_names[0]: 0.3, model.joint_names[3]: -1.0}
    return ff.singularity_map(model, resolution=np.radians(20.0), fixed=values)


def test_fixed_and_prismatic_joints(fixed: SingularityMap) -> None:
    assert fixed.joints == [1, 2, 4]
    assert contradictions(fixed, fixed.model, "pose", 4000) == 0


def with_kinds(nodes: np.ndarray) -> np.ndarray:
    return np.where(nodes == Kind.NEGATIVE, Kind.POSITIVE, nodes).astype(np.uint8)


@pytest.mark.parametrize("change", [
    replaced("result/nodes", lambda nodes: nodes[:-1]),
    replaced("result/nodes", with_kinds),
    replaced("result/polynomial/coefficients", lambda c: 1.001 * c),
], ids=["last", "kinds", "values"])  # fmt: skip
def test_a_tree_that_does_not_fit_is_refused(fixed: SingularityMap, tmp_path: Path, change) -> None:
    file = tmp_path / "map.h5"
    ff.save(fixed, file)
    file.write_bytes(altered(file.read_bytes(), change))
    with pytest.raises(AlteredFileError):
        ff.load(file)
