"""Map files over heading: numbers for others, and enough to draw the map."""

import json
import os
import shutil

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner

import freefloat as ff
from freefloat.cli.app import app
from freefloat.errors import InputError
from freefloat.io.map_file import load_map
from freefloat.planning.heading_map import sample_headings

pytestmark = pytest.mark.usefixtures("kernels")


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A map of twelve headings as the command writes it, and what it answered."""
    file = tmp_path_factory.mktemp("map") / "m.h5"
    arguments = ["map", "planar_3dof/parabola", "--samples", "12", "-o", str(file), "--json"]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.stderr
    return file, json.loads(result.stdout)


def test_the_map_command_writes_arrays(written):
    """S_min over heading per branch, as numbers."""
    file, document = written
    assert document.keys() >= {
        *("samples", "motions", "feasible_fraction", "motion_fraction", "best", "robust"),
        *("regions", "seconds"),
    }
    assert document["samples"] == 12
    with h5py.File(file) as content:
        assert content["least"].shape == (2, 12)
        assert np.degrees(content["heading"][()]) == pytest.approx(document["headings_deg"])


def test_a_map_over_heading_comes_back_with_a_row_for_every_attitude(written):
    """Attitudes, margins and endings are those of the map, in the order of maps in space."""
    file, document = written
    stored, problem = load_map(file), ff.load_scenario("planar_3dof/parabola").problem()
    found = sample_headings(problem, 12)
    assert stored.planar
    assert stored.attitudes[3] == pytest.approx([0, 0, np.sin(np.pi / 4), np.cos(np.pi / 4)])
    assert stored.branches.tolist() == [0, 1]
    assert np.array_equal(stored.least, np.nan_to_num(found.least.T))
    assert {0, 1} <= set(stored.endings.ravel().tolist()) <= {-1, 0, 1}
    assert np.array_equal(stored.endings == -1, np.isnan(found.least.T))
    assert ((stored.least == 0.0) == (stored.endings != 0)).all()
    assert (stored.margin, stored.measure, stored.unit) == (5.0, "system", "m^4 kg")
    assert stored.document == document
    assert np.array_equal(stored.problem().path.pose(20.0).position, problem.path.pose(20).position)
    with pytest.raises(ValueError, match="read-only"):
        stored.least[0, 0] = 1.0


def test_files_that_are_no_maps_are_refused(written, tmp_path):
    """Arrays that do not fit together, a truncated file, other text: one message with the file."""
    file, _ = written
    (tmp_path / "text.h5").write_text("hello")
    (tmp_path / "cut.h5").write_bytes(file.read_bytes()[:-4000])
    shutil.copy(file, tmp_path / "torn.h5")
    with h5py.File(tmp_path / "torn.h5", "r+") as content:
        del content["ending"]
        content["ending"] = np.zeros((2, 11))
    for name in sorted(os.listdir(tmp_path)):
        with pytest.raises(InputError, match=name) as caught:
            load_map(tmp_path / name)
        assert "a map or attitude map file" in str(caught.value)
