"""Pages in a real browser, without a network."""

from __future__ import annotations

import base64
import io
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from playwright.sync_api import Browser, Page

FLAGS = ["--no-sandbox", "--enable-unsafe-swiftshader", "--disable-background-networking"]
PATIENCE = 60.0


@dataclass
class Shown:
    """A page that is ready, and what it did on the way.

    Attributes:
        page: Playwright's handle.
        seconds: From going there to ready.
        errors: Of its console.
        requests: Addresses it asked for.
    """

    page: Page
    seconds: float = 0.0
    errors: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    def ask(self, expression: str, argument: Any = None) -> Any:
        """Evaluate an expression, or a function of one argument, in the page."""
        return self.page.evaluate(expression, argument)

    def at(self, time: float) -> None:
        self.ask("t => freefloat.seek(t)", time)

    def position(self, path: str) -> np.ndarray:
        return np.array(self.ask("p => freefloat.position(p)", f"meshcat/{path}"))

    def quaternion(self, path: str) -> np.ndarray:
        return np.array(self.ask("p => freefloat.quaternion(p)", f"meshcat/{path}"))

    def visible(self, path: str) -> bool:
        return bool(self.ask("p => freefloat.visible(p)", f"meshcat/{path}"))

    def toggle(self, name: str, visible: bool) -> None:
        self.ask("([name, on]) => freefloat.toggle(name, on)", [name, visible])

    def only(self, *names: str) -> None:
        """Hide everything but some items."""
        for item in self.ask("freefloat.about.items"):
            self.toggle(item["name"], item["name"] in names)

    def as_at_first(self) -> None:
        """Back to the scene, the time and the items with which a page opens."""
        about = self.ask("freefloat.about")
        self.ask("title => freefloat.show(title)", about["scenes"][0]["title"])
        self.at(0.0)
        for item in about["items"]:
            self.toggle(item["name"], item["visible"])

    def picture(self) -> np.ndarray:
        """What is seen, panels left out: red, green, blue, shape (height, width, 3)."""
        data = self.ask("freefloat.picture()").split(",")[1]
        image = Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB")
        return np.asarray(image).astype(int)


def differing(first: np.ndarray, second: np.ndarray) -> int:
    """Number of pixels that differ clearly."""
    return int((np.abs(first - second).sum(axis=2) > 60).sum())


@contextmanager
def shown(
    browser: Browser, address: str | Path, size: tuple[int, int] = (640, 480)
) -> Iterator[Shown]:
    """Open a file or an address and wait until it is ready."""
    local = isinstance(address, Path)
    context = browser.new_context(
        viewport={"width": size[0], "height": size[1]}, offline=local, accept_downloads=True
    )
    seen = Shown(context.new_page())
    seen.page.on("pageerror", lambda error: seen.errors.append(str(error)))
    seen.page.on(
        "console",
        lambda message: message.type == "error" and seen.errors.append(message.text),
    )
    seen.page.on("request", lambda request: seen.requests.append(request.url))
    begin = time.monotonic()
    try:
        seen.page.goto(address.as_uri() if isinstance(address, Path) else address)
        while not seen.ask("Boolean(window.freefloat || window.freefloatError)"):
            assert time.monotonic() - begin < PATIENCE, "the page does not get ready"
            seen.page.wait_for_timeout(20)
        seen.seconds = time.monotonic() - begin
        assert not seen.ask("window.freefloatError || ''")
        yield seen
    finally:
        context.close()
