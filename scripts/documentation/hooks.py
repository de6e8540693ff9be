"""Events of MkDocs that add what is generated: tutorials, tables, included files, MathJax."""

from __future__ import annotations

import os
import re
from importlib.resources import files as resources
from pathlib import Path
from typing import Any

import tables
import tutorials
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
MATHJAX = "javascripts/tex-svg-full.js"
INCLUDE = re.compile(r"^<!-- include: (\S+) -->$", re.MULTILINE)
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\((?!\w+:|#)([^)#\s]+)(#[\w-]+)?\)")


def on_files(files: Files, *, config: Any) -> Files:
    """Add the tutorials and MathJax."""
    mathjax = resources("mathjax") / "static" / "mathjax" / "es5" / Path(MATHJAX).name
    files.append(File.generated(config, MATHJAX, abs_src_path=str(mathjax)))
    for name, content in tutorials.pages(ROOT / "scripts").items():
        files.append(File.generated(config, f"tutorials/{name}", content=content))
    return files


def on_page_markdown(markdown: str, *, page: Any, config: Any, files: Files) -> str:
    """Fill in included files and tables, and adapt links to files."""
    folder = (DOCS / page.file.src_uri).parent
    if page.file.src_uri.startswith("tutorials/"):
        return markdown
    markdown = with_site_links(markdown, folder, folder)
    included = INCLUDE.sub(
        lambda match: with_site_links((ROOT / match[1]).read_text("utf-8"), ROOT, folder), markdown
    )
    return tables.filled(included)


def with_site_links(markdown: str, source: Path, folder: Path) -> str:
    """A text with its links to pages as seen from a page's folder; of other files the name stays.

    Args:
        markdown: The text.
        source: The folder that its links are relative to.
        folder: The folder of the page that shows it.
    """

    def replaced(match: re.Match[str]) -> str:
        picture, text, target, anchor = match.groups("")
        file = (source / target).resolve()
        if file.is_relative_to(DOCS):
            return f"{picture}[{text}]({os.path.relpath(file, folder)}{anchor})"
        return text if file.exists() else match[0]

    return LINK.sub(replaced, markdown)
