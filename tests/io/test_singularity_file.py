"""Maps of the joint space return from files as they were saved; altered ones are refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import freefloat as ff
from freefloat.io.records.hdf5 import AlteredFileError
from freefloat.robot.model import FreeFloatingModel
from freefloat.singularities.singularity_map import Kind, SingularityMap
from tests.result_files import altered, replaced
from tests.robots import random_robot

FIXED = np.uint8(3)
"""A joint that is fixed, across which nothing is cut."""


@pytest.fixture(scope="module")
def found() -> SingularityMap:
    robot = random_robot(np.random.default_rng(9), "RPRRPR")
    model = FreeFloatingModel.from_urdf(robot.text, robot.end_effector)
    fixed = {model.joint_names[0]: 0.3, model.joint_names[3]: -1.0}
    return ff.singularity_map(model, resolution=np.radians(20.0), fixed=fixed)


def test_a_loaded_map_passes_its_check(found: SingularityMap, tmp_path: Path) -> None:
    ff.save(found, tmp_path / "map.h5")
    loaded = ff.load(tmp_path / "map.h5")
    assert isinstance(loaded, SingularityMap)
    q = np.random.default_rng(0).uniform(-3.0, 3.0, (500, 6))
    assert (loaded.kinds(q) == found.kinds(q)).all()
    assert (loaded.polynomial.values(q) == found.polynomial.values(q)).all()
    report = ff.check(loaded)
    assert report.passed, report.discrepancies
    assert report.checks[0].name == "polynomial"


def with_kinds(nodes: np.ndarray) -> np.ndarray:
    return np.where(nodes == Kind.NEGATIVE, Kind.POSITIVE, nodes).astype(np.uint8)


CHANGES = {
    "last": replaced("result/nodes", lambda nodes: nodes[:-1]),
    "code": replaced("result/nodes", lambda nodes: np.where(np.arange(len(nodes)), nodes, FIXED)),
    "kinds": replaced("result/nodes", with_kinds),
    "coefficients": replaced("result/polynomial/coefficients", lambda c: c[..., :1, :]),
    "values": replaced("result/polynomial/coefficients", lambda c: 1.001 * c),
    "robot": replaced("robot", lambda text: text.replace('<mass value="', '<mass value="1', 1)),
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
