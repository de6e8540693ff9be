"""Output files: whole or not at all."""

import os

import pytest

from freefloat.io.files import written_beside


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
