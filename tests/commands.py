"""Commands run in this process: their results, documents and errors."""

import json
import re
from typing import Any
from unittest.mock import patch

from typer.testing import CliRunner

from freefloat.cli.app import app


def run(*words: object) -> Any:
    """The result of a command, without lines on progress: a slow machine would have more."""
    with patch.multiple("freefloat.cli.console", REPORTS=1e5, _PATIENCE=1e5):
        return CliRunner().invoke(app, [str(word) for word in words])


def without_progress(text: str) -> str:
    """What a process printed on stderr, without lines on progress and on written files."""
    progress = r"^freefloat: .*(: \d+ %(, about .* left)?| \.\.\.| was written)\n"
    return re.sub(progress, "", text, flags=re.MULTILINE)


def document(*words: object, code: int = 0) -> dict[str, Any]:
    """The JSON document of a command that prints it and nothing else."""
    result = run(*words, "--json")
    assert (result.exit_code, result.stderr) == (code, ""), result.output
    return dict(json.loads(result.stdout))


def error(*words: object) -> dict[str, Any]:
    """The error of a command: exit code 2, one line on stderr, one JSON document on stdout."""
    result = run(*words, "--json")
    assert result.exit_code == 2, result.output
    (line,) = result.stderr.splitlines()
    document = json.loads(result.stdout)["error"]
    assert line == f"freefloat: {document['message']}"
    return dict(document)
