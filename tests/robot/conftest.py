"""What tests of robots share: readers of robot files without processes of their own."""

import json
from contextlib import chdir
from subprocess import CompletedProcess, TimeoutExpired
from types import SimpleNamespace
from typing import Any

import pytest

from freefloat.robot import reader_process


@pytest.fixture
def readers_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Readers answer in this process, which has imported them; tests of their processes do not."""

    def answered(words: list[str], *, input: bytes, cwd: str, **_: Any) -> CompletedProcess[bytes]:
        request = json.loads(input)
        with chdir(cwd):
            answer = reader_process._answer(request["module"], request["arguments"])
        return CompletedProcess(words, 0, json.dumps(answer).encode(), b"")

    processes = SimpleNamespace(run=answered, TimeoutExpired=TimeoutExpired)
    monkeypatch.setattr(reader_process, "subprocess", processes)
