"""Scenario files that are broken while the studio runs are refused, and its session goes on."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from freefloat.robot.names import find_scenario
from tests.studio.client import EDIT, answer, connected, in_a_loop
from tests.studio.conftest import Studio

GOOD = find_scenario("planar_2dof/line").read_text("utf-8")
BROKEN = {
    "empty": "",
    "no YAML": "path: [1, ",
    "timing null": re.sub("timing: .*", "timing:", GOOD),
    "duration a word": GOOD.replace("duration: 30", "duration: '30'"),
    "momentum NaN": f"{GOOD}\nmomentum: [0, 0, .nan]\n",
    "robot missing": GOOD.replace("planar_2dof", "missing"),
    "momentum across": f"{GOOD}\nmomentum: [1, 0, 0]\n",
}
"""Texts that a scenario file on disk may have by mistake."""


@pytest.mark.slow
def test_a_file_that_was_broken_is_refused_and_the_session_goes_on(
    start_studio: Callable[..., Studio], tmp_path: Path
) -> None:
    file = tmp_path / "own.yaml"
    file.write_text(GOOD, "utf-8")
    studio = start_studio(str(file))
    opening = json.dumps({"type": "open", "scenario": str(file)})
    duration = {"type": "duration", "value": 31.0, **EDIT}
    handle = {"type": "handle", "handle": 1, "position": [0.5, 1.2, 0.0], **EDIT}
    margin = {"type": "margin", "value": 0.1, **EDIT}

    async def talk() -> None:
        async with connected(studio) as connection:
            await answer(connection, "outline")
            for text in BROKEN.values():
                file.write_text(text, "utf-8")
                await connection.write_message(opening)
                assert (await answer(connection, "error", "problem"))["text"]
                for edit in (duration, handle, margin):
                    await connection.write_message(json.dumps(edit))
            file.write_text(GOOD, "utf-8")
            await connection.write_message(opening)
            await answer(connection, "state", wanted=lambda m: m["text"] == GOOD)
            await answer(connection, "outline")
            await connection.write_message(json.dumps(duration))
            await answer(connection, "outline", wanted=lambda m: m["duration"] == 31.0)
        assert studio.worker().is_running()

    in_a_loop(talk())
