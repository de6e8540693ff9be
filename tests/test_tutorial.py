"""The tutorial scripts end in the expected number."""

from pathlib import Path

import pytest

from tests.tutorials import ENDS, MISSION, SCRIPTS, completed


def test_the_scripts_are_short() -> None:
    assert [script.stem for script in SCRIPTS] == sorted(ENDS)
    for script in SCRIPTS:
        lines = script.read_text(encoding="utf-8").splitlines()
        assert len(lines) < 60
        assert f"python scripts/{script.name}" in "\n".join(lines[:6])


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted({*ENDS} - {MISSION.stem}))
def test_a_script_ends_in_its_number(name: str, tmp_path: Path) -> None:
    """That of the mission is run by the tests of its plan."""
    (script,) = (script for script in SCRIPTS if script.stem == name)
    completed(script, tmp_path)
