"""A studio that runs as the command does."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import psutil
import pytest


@dataclass
class Studio:
    """A running command.

    Attributes:
        process: The server.
        address: Of its page.
        folder: Where it saves plans.
    """

    process: subprocess.Popen[str]
    address: str
    folder: Path

    @property
    def port(self) -> int:
        return int(self.address.split("/")[2].split(":")[1])

    @property
    def token(self) -> str:
        return self.address.split("/")[3]

    def worker(self) -> psutil.Process:
        """The process that plans."""
        (worker,) = (
            child
            for child in psutil.Process(self.process.pid).children()
            if "spawn_main" in " ".join(child.cmdline())
        )
        return worker

    def stop(self) -> int:
        """End it as Ctrl-C does; return its exit code."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(10)


@pytest.fixture(scope="session")
def start_studio(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[str], Studio]]:
    """Start the command with a scenario; it is ended after the tests."""
    started: list[Studio] = []

    def start(scenario: str) -> Studio:
        folder = tmp_path_factory.mktemp("studio")
        words = [scenario, "--json", "--port", "0", "-o", str(folder)]
        process = subprocess.Popen(
            [sys.executable, "-m", "freefloat", "studio", *words],
            stdout=subprocess.PIPE, text=True, env=os.environ, start_new_session=True,
        )  # fmt: skip
        assert process.stdout is not None
        lines = iter(process.stdout.readline, "}\n")
        address = json.loads("".join([*lines, "}"]))["address"]
        started.append(Studio(process, address, folder))
        return started[-1]

    yield start
    for studio in started:
        studio.process.kill()
        studio.process.communicate()
