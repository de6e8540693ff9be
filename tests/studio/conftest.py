"""A studio that runs as the command does."""

import json
import os
import signal
import subprocess
import sys
import time
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
        browser: The arguments of its browser, where it has opened one.
    """

    process: subprocess.Popen[str]
    address: str
    folder: Path
    browser: Path

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

    def told(self) -> str:
        """What its browser was told to open."""
        end = time.monotonic() + 60.0
        while not self.browser.exists():
            assert time.monotonic() < end
            time.sleep(0.02)
        return self.browser.read_text("utf-8").strip()

    def stop(self) -> int:
        """End it as Ctrl-C does; return its exit code."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(60)


@pytest.fixture(scope="session")
def start_studio(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Studio]]:
    """Start the command with a scenario; it is ended after the tests.

    Its browser is a script that writes its arguments to a file.
    """
    started: list[Studio] = []
    browser = tmp_path_factory.mktemp("browser") / "browser"
    browser.write_text('#!/bin/sh\necho "$@" > "$OPENED.part" && mv "$OPENED.part" "$OPENED"\n')
    browser.chmod(0o700)

    def start(scenario: str, *options: str) -> Studio:
        folder = tmp_path_factory.mktemp("studio")
        opened = tmp_path_factory.mktemp("opened") / "arguments"
        words = [scenario, *options, "--port", "0", "-o", str(folder)]
        process = subprocess.Popen(
            [sys.executable, "-m", "freefloat", "studio", *words],
            stdout=subprocess.PIPE, text=True, start_new_session=True,
            env=os.environ | {"BROWSER": str(browser), "OPENED": str(opened)},
        )  # fmt: skip
        assert process.stdout is not None
        if "--json" in options:
            lines = iter(process.stdout.readline, "}\n")
            address = json.loads("".join([*lines, "}"]))["address"]
        else:
            address = process.stdout.readline().split()[0]
        started.append(Studio(process, address, folder, opened))
        return started[-1]

    yield start
    for studio in started:
        studio.process.kill()
        studio.process.communicate()
