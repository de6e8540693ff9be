"""Pages made of the numbered scripts: their comments as text, their code, output and pictures.

A comment that begins in the first column after an empty line begins a part of the page. Each
script runs as a user runs it, in an empty folder. Pictures and pages that it writes are shown below
the output that names them. With ``WITHOUT_OUTPUTS`` in the environment no script runs.
"""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path

MARK = "\x1e"
"""Printed between the outputs of two parts."""


@dataclass(frozen=True)
class Part:
    """Text and the code below it."""

    text: str
    code: str


def pages(folder: Path) -> dict[str, str | bytes]:
    """The pages of the scripts in a folder and the files that they show, by name."""
    scripts = sorted(folder.glob("[0-9][0-9]_*.py"))
    with ThreadPoolExecutor(os.cpu_count()) as executor:
        results = executor.map(_page, scripts, [script.read_text("utf-8") for script in scripts])
    return {name: content for files in results for name, content in files.items()}


def parts_of(source: str) -> tuple[str, list[Part]]:
    """The docstring of a script and its parts."""
    docstring = ast.get_docstring(ast.parse(source)) or ""
    lines = source.split('"""', 2)[2].strip("\n").splitlines()
    parts: list[tuple[list[str], list[str]]] = [([], [])]
    for number, line in enumerate(lines):
        comment = line.startswith("# ")
        if comment and number > 0 and not lines[number - 1]:
            parts.append(([], []))
        text, code = parts[-1]
        (text if comment and not code else code).append(line)
    return docstring, [
        Part("\n".join(line.removeprefix("# ") for line in text), "\n".join(code).strip("\n"))
        for text, code in parts
    ]


@cache  # mkdocs serve asks again after every change of any file
def _page(script: Path, source: str) -> dict[str, str | bytes]:
    docstring, parts = parts_of(source)
    title, usage, *introduction = docstring.replace("``", "`").split("\n\n")
    content = [f"# {title.rstrip('.')}", *introduction]
    files: dict[str, str | bytes] = {}
    with tempfile.TemporaryDirectory() as folder:
        run = "WITHOUT_OUTPUTS" not in os.environ
        outputs = _outputs(script, parts, Path(folder)) if run else [""] * len(parts)
        for part, output in zip(parts, outputs, strict=True):
            content += [part.text, part.code and f"```python\n{part.code}\n```"]
            if output.strip():
                content.append(f"```text\n{output.rstrip()}\n```")
            for file in _shown(Path(folder), output):
                name = f"{script.stem}/{file.name}"
                files[name] = file.read_bytes()
                page = f'<iframe src="{name}" title="{file.name}"></iframe>'
                content.append(page if file.suffix == ".html" else f"![{file.stem}]({name})")
    content += ["## The script", usage]
    return {f"{script.stem}.md": "\n\n".join(filter(None, content)) + "\n", **files}


def _outputs(script: Path, parts: list[Part], folder: Path) -> list[str]:
    """What each part of a script prints."""
    mark = f'\n__name__ == "__main__" and print({MARK!r}, end="", flush=True)\n'
    copy = folder / script.name
    copy.write_text(mark.join(part.code for part in parts), "utf-8")
    environment = os.environ | {"MPLBACKEND": "agg", "PYTHONWARNINGS": "error::UserWarning"}
    done = subprocess.run([sys.executable, copy.name], cwd=folder, env=environment,
                          capture_output=True, text=True, check=False)  # fmt: skip
    if done.returncode:
        raise RuntimeError(f"{script.name} failed:\n{done.stderr}")
    return done.stdout.split(MARK)


def _shown(folder: Path, output: str) -> list[Path]:
    """The pictures and pages in a folder that an output names."""
    written = sorted([*folder.rglob("*.png"), *folder.glob("*.html")])
    return [file for file in written if re.search(rf"\b{re.escape(file.name)}\b", output)]
