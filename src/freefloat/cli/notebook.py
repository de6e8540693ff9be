"""What commands print of an answer, in cells of notebooks."""

from __future__ import annotations

import io

from rich.console import Console
from rich.text import Text

from freefloat.kinds import kind_of, named
from freefloat.planning.answer import Answer

_WIDTH = 120
_PAGE = '<pre style="line-height: 1.3; white-space: pre; overflow-x: auto">{code}</pre>'


def answer_html(answer: Answer) -> str:
    """The short tables of an answer as HTML."""
    console = Console(record=True, file=io.StringIO(), width=_WIDTH, highlight=False, markup=False)
    for renderable in named(kind_of(answer).tables)(answer.kind, answer, False):
        console.print(renderable, soft_wrap=isinstance(renderable, str | Text))
    return console.export_html(inline_styles=True, code_format=_PAGE)
