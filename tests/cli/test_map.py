"""``freefloat map``: documents, exit codes, and files that are whole or not there."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

import freefloat as ff
from tests.commands import document, error, run
from tests.scenarios import SEARCHED


@pytest.fixture(autouse=True)
def folder(folder: Path) -> Path:
    """A working folder with the scenarios."""
    for name, text in SEARCHED.items():
        (folder / f"{name}.yaml").write_text(text)
    return folder


@pytest.mark.slow
def test_a_map_is_printed_and_written() -> None:
    words = ("easy.yaml", "--nearest", "0", "0", "0", "1", "--boundary", "2")
    result = document("map", *words, "-o", "map.h5")
    assert (result["samples"], result["seed"], result["motions"]) == (64, 3, 512)
    assert result["feasible_fraction"] == result["motion_fraction"] == 1.0
    assert result["best"]["value"] > 60.0
    assert result["nearest"] == {"attitude": [0, 0, 0, 1], "branch": 0, "deviation_deg": 0.0}
    assert result["boundary"] == []
    for region in result["regions"]:
        assert np.isclose(region["volume_rad3"], 8 * np.pi**2 * region["fraction"])
    assert [entry["label"] for entry in result["branches"]][3] == "shoulder+ elbow- wrist-"
    others = dict.fromkeys(("limited", "singular", "given_up", "unreached"), 0)
    assert result["endings"] == {"completed": 512, **others}
    loaded = ff.load("map.h5").to_dict()
    assert loaded == {key: result[key] for key in loaded}
    with h5py.File("map.h5") as file:
        assert json.loads(file["document"].asstr()[()])["best"] == result["best"]


def test_a_planar_map_has_regions_of_headings() -> None:
    words = ("map", "planar_3dof/parabola", "--samples", "36")
    result = document(*words)
    assert result["best"]["branch"] == 1
    assert result["robust"]["radius_deg"] == max(r["size_deg"] for r in result["regions"]) / 2.0
    assert "best: 250.000 deg, branch 1" in run(*words).stdout


@pytest.mark.parametrize("name", [pytest.param("hard", marks=pytest.mark.slow), "far"])
def test_a_map_without_a_feasible_attitude_exits_with_1(name: str) -> None:
    result = document("map", f"{name}.yaml", "--samples", "16", code=1)
    assert result["feasible_fraction"] == 0.0
    assert result["best"] is result["robust"] is None
    assert result["regions"] == []
    assert (result["motions"] == 0) is (result["out_of_reach"] is not None) is (name == "far")
    assert "no feasible attitude was found" in run("map", f"{name}.yaml", "--samples", "16").stdout


@pytest.mark.parametrize(
    ("words", "key"),
    [
        (("easy.yaml", "--nearest", "0", "0", "0", "0"), "nearest"),
        (("easy.yaml", "--samples", "1000000000000"), "samples"),
        (("planar_3dof/parabola", "--seed", "3"), "seed"),
        (("planar_3dof/parabola", "--touch", "3"), "touch"),
    ],
)
def test_bad_options_are_errors_that_name_no_file(words: tuple[str, ...], key: str) -> None:
    refusal = error("map", *words)
    assert (refusal["key"], refusal["file"]) == (key, None)
