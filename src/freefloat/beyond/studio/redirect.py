"""A private page that leads a browser to a secret address.

All users of a machine can read the arguments of its processes, and an address that a browser is
told to open is one. The page is told instead; its owner alone can read it.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Timer

_LIFETIME = 60.0
"""Time that a browser has to read the page [s]."""
_PAGE = """<!DOCTYPE html>
<meta charset="utf-8">
<meta http-equiv="refresh" content="0; url={address}">
<title>freefloat studio</title>
<a href="{address}">freefloat studio</a>
"""


@contextmanager
def redirect_page(address: str, folder: Path) -> Iterator[Path]:
    """A page that leads to an address; it is deleted after a minute, or at the end of the context.

    Args:
        address: The address, with nothing that HTML would escape.
        folder: Where the page is written, with mode 0600.

    Yields:
        The file, an absolute path.
    """
    handle, name = tempfile.mkstemp(".html", "freefloat-studio-", folder.resolve())
    page = Path(name)
    expiry = Timer(_LIFETIME, page.unlink, kwargs={"missing_ok": True})
    expiry.daemon = True
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(_PAGE.format(address=address))
        expiry.start()
        yield page
    finally:
        expiry.cancel()
        page.unlink(missing_ok=True)
