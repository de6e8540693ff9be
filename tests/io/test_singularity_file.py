"""Maps of the joint space return from files as they were saved; altered ones are refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import freefloat as ff
from freefloat.beyond.joint_space.singularity_map import Kind, SingularityMap
from freefloat.io.hdf5 import AlteredFileError
from freefloat.robot.model import FreeFloatingModel
from tests.result_files import altered, replaced
from tests.robots import random_robot


@pytest.fixture(scope="module")
def found() -> SingularityMap:
    robot = random_robot(np.random.default_rng(9), "RPRRPR")
    model = FreeFloatingModel.from_urdf(robot.text, robot.end_effector)
    fixed = {model.joint_names[0]: 0.3, model.joint_names[3]: -1.0}
    return ff.singularity_map(model, resolution=np.radians(20.0), fixed=fixed)


def with_kinds(nodes: np.ndarray) -> np.ndarray:
    return np.where(nodes == Kind.NEGATIVE, Kind.POSITIVE, nodes).astype(np.uint8)


CHANGES = {
    "last": replaced("result/nodes", lambda nodes: nodes[:-1]),
    "kinds": replaced("result/nodes", with_kinds),
    "values": replaced("result/polynomial/coefficients", lambda c: 1.001 * c),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_tree_that_does_not_fit_is_refused(
    found: SingularityMap, tmp_path: Path, change: str
) -> None:
    ff.save(found, tmp_path / "map.h5")
    content = altered((tmp_path / "map.h5").read_bytes(), CHANGES[change])
    (tmp_path / "map.h5").write_bytes(content)
    with pytest.raises(AlteredFileError):
        ff.load(tmp_path / "map.h5")
