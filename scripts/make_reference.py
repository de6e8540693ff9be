"""Make the reference of the Python interface from its docstrings, as web pages.

``pip install '.[docs]' && python scripts/make_reference.py [FOLDER]`` writes build/reference, which
is not committed; begin with index.html.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pdoc
import pdoc.render

import freefloat


def main() -> None:
    """Write the pages: the public names in one, and their modules."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build/reference")
    modules = {getattr(freefloat, name).__module__ for name in freefloat.__all__}  # loads them all
    pdoc.render.configure(docformat="google", show_source=False)
    pdoc.pdoc("freefloat", *sorted(modules), output_directory=folder)
    print(f"{len(freefloat.__all__)} names, {len(modules)} modules: {folder / 'index.html'}")


if __name__ == "__main__":
    main()
