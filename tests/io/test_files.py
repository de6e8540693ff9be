"""Output files: whole or not at all."""

import os
from pathlib import Path

import pytest

from freefloat.errors import InputError
from freefloat.io.files import refuse_same_files, written_beside


def test_an_interrupted_writer_leaves_the_old_file_alone(tmp_path):
    """Written beside and renamed: an error on the way changes nothing."""
    target = tmp_path / "plan.h5"
    target.write_text("old")

    def broken():
        with written_beside(target) as temporary:
            temporary.write_text("half")
            raise RuntimeError("power cut")

    with pytest.raises(RuntimeError, match="power cut"):
        broken()
    assert target.read_text() == "old"
    assert os.listdir(tmp_path) == ["plan.h5"]


def test_two_options_may_not_name_one_file(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "a")
    refuse_same_files(output=tmp_path / "a", html=tmp_path / "b", video=None)
    with pytest.raises(InputError, match="is the file of output, too") as caught:
        refuse_same_files(output=tmp_path / "a", html=tmp_path / "link")
    assert caught.value.key == "html"
