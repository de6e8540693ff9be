"""Blocks of code in README and docs: run in order, and their output compared with what is shown."""

import os
import re
import signal
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from contextlib import redirect_stdout, suppress
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any

import yaml
from pydantic import TypeAdapter

from freefloat.io.scenario.schema import ScenarioFile
from freefloat.studies.study_file import StudyFile
from tests.commands import run, without_progress

ROOT = Path(__file__).resolve().parents[1]
PAGES = {
    str(file.relative_to(ROOT)): file.read_text("utf-8")
    for file in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(ROOT.glob("docs/**/*.md")))
    if file.is_file()
}
_FENCE = re.compile(
    r"^(?:<!-- ci: (?P<ci>\w+) -->\n)?"
    r"(?P<indent> *)```(?P<language>\w*)(?P<rest>[^\n]*)\n(?P<text>.*?)^(?P=indent)```$",
    re.MULTILINE | re.DOTALL,
)
_FILE = re.compile(r"\A\W+ file: (\S+?)(?: \W+)?\n")
_NUMBER = re.compile(r"([-+]?\d[\d,]*(?:\.\d+)?(?:e[-+]\d+)?)")
_ROUNDING = 1e-6
"""Smaller numbers are errors of rounding, different on every computer."""
_SHELL = "set -E; trap 'code=$?; ((code < 2)) || exit $code' ERR\n"
"""Exit code 1 is an answer; others end the block, 2 where the message is shown."""
_FREEFLOAT = """freefloat() {{
    (IFS=$'\t'; echo "$*" >&{requests})
    local code; read -r code <&{answers}
    cat .stderr >&2; cat .stdout; return $code
}}
"""
"""Has this process run a command: words through one pipe, the exit code through another."""


@dataclass(frozen=True)
class Block:
    """A block of code.

    Attributes:
        language: ``python``, ``sh``, ``yaml``, ``text``, ...
        text: The code.
        shown: The output below it; None if there is none.
        line: Of the page.
        file: Name of the file that the block is; None if it is none.
        ci: Name of the block if .ci/run runs it instead.
    """

    language: str
    text: str
    shown: str | None
    line: int
    file: str | None
    ci: str | None


def blocks_of(page: str) -> list[Block]:
    """The blocks of a page."""
    text = PAGES[page]
    matches = list(_FENCE.finditer(text))
    following = [*matches[1:], None]
    return [_block(text, *pair) for pair in zip(matches, following, strict=True)]


def _block(page: str, match: re.Match[str], following: re.Match[str] | None) -> Block:
    text = textwrap.dedent(match["text"])
    shown = None
    if following and following["language"] in ("", "text"):
        between = page[match.end() : following.start()]
        shown = None if between.strip() else textwrap.dedent(following["text"])
    title = re.search(r'title="([^"]+)"', match["rest"]) or _FILE.search(text)
    line = page.count("\n", 0, match.start()) + 1
    return Block(match["language"], text, shown, line, title and title[1], match["ci"])


@dataclass
class Page:
    """Runs the blocks of one page, in the present folder."""

    name: str
    names: dict[str, Any] = field(default_factory=lambda: {"__name__": "__main__"})
    sessions: list[int] = field(default_factory=list)

    def run(self, block: Block) -> None:
        """Run a block; raise an error if it fails or prints something else than is shown."""
        if block.ci is not None:
            commands = (ROOT / ".ci" / "run").read_text("utf-8")
            assert f"documented_command {block.ci})" in commands
            return
        if block.file is not None:
            Path(block.file).parent.mkdir(parents=True, exist_ok=True)
            Path(block.file).write_text(block.text, "utf-8")
        elif block.language in ("yaml", "yml"):
            check_fragment(block.text)
        runners = {"python": self._python, "sh": self._shell}
        if block.language in runners:
            printed = runners[block.language](block)
            if block.shown is not None:
                assert_shown(block.shown, printed)

    def close(self) -> None:
        """End what blocks left running."""
        for session in self.sessions:
            with suppress(ProcessLookupError):
                os.killpg(session, signal.SIGTERM)

    def _python(self, block: Block) -> str:
        padded = "\n" * block.line + block.text  # errors have the line of the page
        with redirect_stdout(StringIO()) as output:
            exec(compile(padded, str(ROOT / self.name), "exec"), self.names)
        return output.getvalue()

    def _shell(self, block: Block) -> str:
        scripts = str(Path(sys.executable).parent)
        environment = os.environ | {"PATH": f"{scripts}{os.pathsep}{os.environ['PATH']}"}
        output = Path(f".output-{block.line}")  # a pipe would wait for processes left running
        (asked, requests), (answers, answered) = os.pipe(), os.pipe()
        function = _FREEFLOAT.format(requests=requests, answers=answers)
        with output.open("w") as file:
            shell = subprocess.Popen(
                ["bash", "-c", _SHELL + function + block.text],
                stdout=file,
                stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL,
                env=environment,
                start_new_session=True,
                pass_fds=(requests, answers),
            )
            self.sessions.append(shell.pid)
            os.close(requests)
            os.close(answers)
            _answer(asked, answered)
            status = shell.wait(timeout=300)
        printed = output.read_text("utf-8")
        output.unlink()
        assert status < 2 or (status == 2 and block.shown), printed
        return printed


def _answer(asked: int, answered: int) -> None:
    """Run the commands that a shell asks for, until it ends."""
    with os.fdopen(asked) as requests, os.fdopen(answered, "w", buffering=1) as answers:
        for words in requests:
            result = run(*words.rstrip("\n").split("\t"))
            Path(".stdout").write_bytes(result.stdout_bytes)
            Path(".stderr").write_text(without_progress(result.stderr))
            answers.write(f"{result.exit_code}\n")


def check_fragment(text: str) -> None:
    """Check that YAML is a part of a scenario or study file."""
    for key, value in yaml.safe_load(text).items():
        file = ScenarioFile if key in ScenarioFile.model_fields else StudyFile
        TypeAdapter(file.model_fields[key].annotation).validate_python(value)


def assert_shown(shown: str, printed: str) -> None:
    """Check that text was printed; a line ``...`` stands for any lines, gaps have any width."""
    chunks = [chunk.splitlines() for chunk in re.split(r"^\.\.\.\n", shown, flags=re.MULTILINE)]
    lines = printed.splitlines()
    start = 0
    for number, chunk in enumerate(chunks):
        last = len(lines) - len(chunk)
        first = last if number == len(chunks) - 1 and number > 0 else start
        places = range(first, (last if number else min(start, last)) + 1)
        place = next((place for place in places if _same(chunk, lines[place:])), None)
        assert place is not None, f"shown:\n{chr(10).join(chunk)}\nprinted:\n{printed}"
        start = place + len(chunk)
    assert start == len(lines), f"shown:\n{shown}\nprinted:\n{printed}"


def _same(shown: list[str], printed: list[str]) -> bool:
    pairs = zip(shown, printed, strict=False)
    return len(shown) <= len(printed) and all(_same_line(*pair) for pair in pairs)


def _same_line(shown: str, printed: str) -> bool:
    """Whether two lines are the same but for gaps and the digits of numbers that are not shown."""
    first, second = (list(_parts(line)) for line in (shown, printed))
    return len(first) == len(second) and all(
        _close(*pair) if index % 2 else pair[0] == pair[1]
        for index, pair in enumerate(zip(first, second, strict=True))
    )


def _parts(line: str) -> Iterator[str]:
    """Texts and, between two of them, numbers."""
    for index, part in enumerate(_NUMBER.split(re.sub(r"─+", "─", line.strip()))):
        yield part if index % 2 else " ".join(part.split())


def _close(shown: str, printed: str) -> bool:
    """Whether a number has the digits shown, the last one rounded either way; integers all."""
    first, second = (float(text.replace(",", "")) for text in (shown, printed))
    if max(abs(first), abs(second)) < _ROUNDING:
        return True
    mantissa, _, exponent = shown.partition("e")
    _, point, decimals = mantissa.partition(".")
    exact = not point and not exponent
    unit = 0.0 if exact else 10.0 ** (int(exponent or 0) - len(decimals))
    return abs(first - second) <= 1.001 * unit
