"""Maps of the joint space return from files as they were saved; altered ones are refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import freefloat as ff
from freefloat.io.records.hdf5 import AlteredFileError
from freefloat.io.records.singularity_file import write_singularity_map
from freefloat.robot.model import FreeFloatingModel
from freefloat.singularities.singularity_map import Kind, SingularityMap
from tests.robots import random_robot


@pytest.fixture(scope="module")
def found() -> SingularityMap:
    robot = random_robot(np.random.default_rng(9), "RPRRPR")
    model = FreeFloatingModel.from_urdf(robot.text, robot.end_effector)
    fixed = {model.joint_names[0]: 0.3, model.joint_names[3]: -1.0}
    return ff.singularity_map(model, resolution=np.radians(20.0), fixed=fixed)


def test_a_map_returns_as_it_was_saved(found: SingularityMap, tmp_path: Path) -> None:
    ff.save(found, tmp_path / "map.h5")
    loaded = ff.load(tmp_path / "map.h5")
    assert isinstance(loaded, SingularityMap)
    assert loaded.to_dict() == found.to_dict()
    q = np.random.default_rng(0).uniform(-3.0, 3.0, (500, 6))
    assert (loaded.kinds(q) == found.kinds(q)).all()
    assert (loaded.polynomial.values(q) == found.polynomial.values(q)).all()
    assert loaded.model.joint_names == found.model.joint_names
    report = ff.check(loaded)
    assert report.passed, report.discrepancies
    assert report.checks[0].name == "polynomial"


@pytest.mark.parametrize("change", ["last", "code", "coefficients", "values", "kinds", "robot"])
def test_a_tree_that_does_not_fit_is_refused(
    found: SingularityMap, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: str
) -> None:
    def altered(file: object, result: SingularityMap, document: object) -> None:
        write_singularity_map(file, result, document)
        nodes, coefficients = file["nodes"][()], file["coefficients"][()]
        if change == "last":
            del file["nodes"]
            file["nodes"] = nodes[:-1]
        elif change == "code":
            nodes[0] = 3  # a joint that is fixed
            file["nodes"][...] = nodes
        elif change == "values":
            file["coefficients"][...] = 1.001 * coefficients
        elif change == "kinds":
            nodes[nodes == Kind.NEGATIVE] = Kind.POSITIVE
            file["nodes"][...] = nodes
        elif change == "robot":
            text = file["robot"][()].decode()
            del file["robot"]
            file["robot"] = text.replace('<mass value="', '<mass value="1', 1)
        else:
            del file["coefficients"]
            file["coefficients"] = coefficients[..., :1, :]

    monkeypatch.setattr("freefloat.io.records.results.write_singularity_map", altered)
    ff.save(found, tmp_path / "map.h5")
    with pytest.raises(AlteredFileError):
        ff.load(tmp_path / "map.h5")
