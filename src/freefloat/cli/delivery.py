"""Delivery of results: tables, files, pages, figures, JSON, cells of notebooks; reading them."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console as RichConsole
from rich.console import RenderableType
from rich.text import Text

from freefloat.cli.console import Console, say
from freefloat.cli.options import prepare_outputs
from freefloat.errors import InputError
from freefloat.kinds import kind_of, named

if TYPE_CHECKING:
    from freefloat.motion.motion import Motion
    from freefloat.planning.answer import Answer

_WIDTH = 120
_PAGE = '<pre style="line-height: 1.3; white-space: pre; overflow-x: auto">{code}</pre>'


@dataclass(frozen=True)
class Delivery:
    """The console, and the files that a command is to write; None for those not wanted."""

    console: Console  # where tables or the JSON document are printed
    output: Path | None = None  # result file
    html: Path | None = None  # page
    plots: Path | None = None  # folder of figures
    threads: int | None = None  # number of cores that draw them; all when left out

    def prepare(self, *inputs: Path) -> None:
        """Check the files before the work, see :func:`~freefloat.cli.options.prepare_outputs`."""
        prepare_outputs(*inputs, output=self.output, html=self.html, folder=self.plots)

    def deliver(
        self,
        result: Any,
        tables: Iterable[RenderableType],
        name: str,
        document: dict[str, Any] | None = None,
    ) -> None:
        """Print a result and write its files.

        Args:
            result: The result.
            tables: Tables and lines of the result.
            name: Title of the page without a result file.
            document: JSON document that is printed; by default the result's own.
        """
        document = result.to_dict() if document is None else document
        self.console.tables(_not_read(name, result))
        self.console.tables(tables)
        if self.output is not None:
            self._save(result, self.output)
        if self.html is not None:
            title = name if self.output is None else self.output.stem
            document["html"] = self._write_page(result, self.html, title)
            page = document["html"] or "none, there is no motion to show"
            self.console.tables([f"Page: {page}"])
        if self.plots is not None:
            document["plots"] = self._draw(result, self.plots)
        self.console.json(document)

    def _save(self, result: Any, output: Path) -> None:
        from freefloat.io.results import save  # HDF5 is slow to import

        save(result, output)
        contact = getattr(result, "contact", None)
        if not (self.console.quiet or self.console.as_json):
            say(f"{output} was written" + ("" if contact is None else f", although {contact}"))

    def _write_page(self, result: Any, html: Path, title: str) -> str | None:
        """Write the page of a result; None where it has no motion."""
        from freefloat.visualization.page.playback import playback

        phases = getattr(result, "phases", None)
        if phases is not None and all(phase.motion is None for phase in phases):
            return None
        with self.console.progress("making the page"):
            return str(playback(result, title).save(html))

    def _draw(self, result: Any, folder: Path) -> list[str]:
        """Draw the figures of a result into a folder; print and return their files."""
        from freefloat.visualization.figure_style import save_figures
        from freefloat.visualization.figures import figures

        with self.console.progress("drawing") as progress:
            files = save_figures(folder, figures(result, threads=self.threads, progress=progress))
        names = ", ".join(dict.fromkeys(file.stem for file in files))
        self.console.tables([f"Figures in {folder}, as PDF and PNG: {names}"])
        return [str(file) for file in files]


def _not_read(name: str, result: Any) -> Iterator[str]:
    """One line on how much of a robot file freefloat does not use."""
    problem = getattr(result, "problem", None)  # of a map of joint space there is none
    count = 0 if problem is None else len(problem.model.not_read)
    if count:
        entries = "entry of its robot file is" if count == 1 else "entries of its robot file are"
        yield f"{name}: {count} {entries} not used; freefloat info {name} lists what"


def load_answer(file: Path) -> Answer:
    """The answer of a file.

    Raises:
        InputError: If the file holds a map, or an answer without any motion.
    """
    from freefloat.io.results import load

    result: Any = load(file)
    if not hasattr(result, "phases"):
        accepted = "files with motions, of plan or simulate; for view also a map alone"
        raise InputError("file", f"it is a {result.kind} file", accepted, str(file))
    if all(phase.motion is None for phase in result.phases):
        problem = f"it has no motion: {result.reason}"
        raise InputError("file", problem, "a file with a motion", str(file))
    answer: Answer = result
    return answer


def load_motion(file: Path) -> tuple[Motion, str]:
    """The motion of a file, and what it violates.

    Raises:
        InputError: If the file does not hold exactly one motion.
    """
    answer = load_answer(file)
    motions = [phase.motion for phase in answer.phases if phase.motion is not None]
    if len(motions) > 1:
        accepted = "files with one motion each, several together, or one of any kind"
        raise InputError("file", f"it is a {answer.kind} file", accepted, str(file))
    return motions[0], answer.violation


def answer_html(answer: Answer) -> str:
    """The short tables of an answer as HTML."""
    buffer = io.StringIO()
    console = RichConsole(
        record=True, file=buffer, width=_WIDTH, highlight=False, markup=False, force_jupyter=False
    )
    for renderable in named(kind_of(answer).tables)(answer.kind, answer, False):
        console.print(renderable, soft_wrap=isinstance(renderable, str | Text))
    return console.export_html(inline_styles=True, code_format=_PAGE)
