"""One look for all figures, and files that are whole or not there."""

from __future__ import annotations

import os
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from freefloat.errors import InputError
from freefloat.visualization.figure_style import (
    STROKES,
    axis_label,
    digits,
    figure_folder,
    new_figure,
    save_figures,
    styled,
)


@styled
def drawing(height: float = 1.0) -> Figure:
    figure = new_figure()
    axes = figure.add_subplot()
    axes.plot([0.0, 1.0], [0.0, height])
    axes.set_xlabel(axis_label("time", "s"))
    return figure


def test_every_figure_is_written_whole_as_drawing_and_image(tmp_path: Path) -> None:
    files = save_figures(tmp_path / "new" / "folder", {"one": drawing(), "two": drawing()})
    assert [file.name for file in files] == ["one.pdf", "one.png", "two.pdf", "two.png"]
    assert sorted(os.listdir(tmp_path / "new" / "folder")) == [file.name for file in files]
    for file in files:
        whole = file.read_bytes()
        if file.suffix == ".pdf":
            assert whole.startswith(b"%PDF-")
            assert whole.rstrip().endswith(b"%%EOF")
        else:
            assert whole.startswith(b"\x89PNG")
            assert whole.endswith(b"IEND\xaeB`\x82")


def test_the_same_figure_gives_the_same_bytes(tmp_path: Path) -> None:
    first, second = (save_figures(tmp_path / name, {"figure": drawing()}) for name in "ab")
    assert [f.read_bytes() for f in first] == [f.read_bytes() for f in second]


def test_fonts_are_embedded_as_outlines_that_can_be_read(tmp_path: Path) -> None:
    pdf = save_figures(tmp_path, {"figure": drawing()})[0].read_bytes()
    assert b"/Type42" in pdf or b"/CIDFontType2" in pdf
    assert b"/Type3" not in pdf


def test_nothing_appears_when_a_figure_cannot_be_drawn(tmp_path: Path) -> None:
    broken = drawing()
    broken.axes[0].set_title(r"$\nonsense{$")
    (tmp_path / "good.png").write_bytes(b"what was there before")
    with pytest.raises(ValueError, match="nonsense"):
        save_figures(tmp_path, {"good": drawing(), "broken": broken})
    assert os.listdir(tmp_path) == ["good.png"]
    assert (tmp_path / "good.png").read_bytes() == b"what was there before"


def test_a_file_where_the_folder_should_be_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.touch()
    for folder in (file, file / "below"):
        with pytest.raises(InputError) as caught:
            figure_folder(folder)
        assert caught.value.key == "plots"


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="wants a folder nobody may write to")
def test_a_folder_that_may_not_be_written_to_is_refused() -> None:
    with pytest.raises(InputError) as caught:
        save_figures("/proc/self/figures", {"one": drawing()})
    assert caught.value.key == "plots"


def test_a_folder_in_place_of_a_figure_is_told_as_plots(tmp_path: Path) -> None:
    (tmp_path / "one.png").mkdir()
    with pytest.raises(InputError) as caught:
        save_figures(tmp_path, {"one": drawing()})
    assert caught.value.key == "plots"
    assert os.listdir(tmp_path) == ["one.png"]


def test_drawing_leaves_the_settings_of_others_alone() -> None:
    before = dict(matplotlib.rcParams)
    drawing()
    assert dict(matplotlib.rcParams) == before


def test_curves_differ_without_colour() -> None:
    assert len({str(dashes) for _, dashes in STROKES}) == len(STROKES)
    on_white = [1.05 / (0.05 + _luminance(colour)) for colour, _ in STROKES]
    assert min(on_white) > 1.9


def _luminance(colour: str) -> float:
    light = np.array(to_rgb(colour))
    linear = np.where(light > 0.04045, ((light + 0.055) / 1.055) ** 2.4, light / 12.92)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def test_numbers_are_short_and_their_minus_signs_are() -> None:
    assert [digits(value) for value in (-107.6958, 0.05, -1e-17)] == ["−107.7", "0.05", "0"]


def test_labels_carry_units_with_raised_powers() -> None:
    assert axis_label("S", "m^4 kg") == "S [m$^{4}$ kg]"
    assert axis_label("time", "s") == "time [s]"
