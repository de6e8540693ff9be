"""Pages in a headless browser without a network."""

import base64
import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from playwright.sync_api import Browser, Page

FLAGS = ["--no-sandbox", "--enable-unsafe-swiftshader", "--disable-background-networking"]

CONTRASTS = """() => {
  const parse = text => text.match(/[\\d.]+/g).map(Number);
  const style = (part, name) => parse(getComputedStyle(part)[name]);
  const over = ([r, g, b, a = 1], below) =>
    [r, g, b].map((part, i) => a * part + (1 - a) * below[i]);
  const light = colour => colour.map(part => part / 255)
    .map(part => part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4)
    .reduce((sum, part, i) => sum + part * [0.2126, 0.7152, 0.0722][i], 0);
  const found = [], texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (texts.nextNode()) {
    const text = texts.currentNode.data.trim(), part = texts.currentNode.parentElement;
    if (!text || !part.checkVisibility() || part.closest("script")) continue;
    const layers = [], last = part.closest("#pane"); // behind it is a white robot at worst
    for (let at = part; at && at !== last; at = at.parentElement) layers.unshift(at);
    const behind = layers.reduce(
      (below, layer) => over(style(layer, "backgroundColor"), below), Array(3).fill(last ? 255 : 0)
    );
    const [low, high] = [over(style(part, "color"), behind), behind].map(light)
      .sort((a, b) => a - b);
    found.push([text, (high + 0.05) / (low + 0.05)]);
  }
  return found;
}"""
"""Texts of a page with their contrast as WCAG defines it, over the brightest scene."""


@dataclass
class OpenPage:
    """A page that is ready.

    Attributes:
        page: Playwright's handle.
        errors: Of its console.
        requests: Addresses it asked for.
    """

    page: Page
    errors: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    def ask(self, expression: str, argument: Any = None) -> Any:
        """Evaluate an expression, or a function of one argument, in the page."""
        return self.page.evaluate(expression, argument)

    def position(self, path: str) -> np.ndarray:
        return np.array(self.ask("p => freefloat.position(p)", f"meshcat/{path}"))

    def visible(self, path: str) -> bool:
        return bool(self.ask("p => freefloat.visible(p)", f"meshcat/{path}"))

    def only(self, *names: str) -> None:
        """Hide everything but some items."""
        for item in self.ask("freefloat.about.items"):
            self.ask("([n, on]) => freefloat.toggle(n, on)", [item["name"], item["name"] in names])

    def picture(self) -> np.ndarray:
        """Red, green, blue of the 3D view, shape (height, width, 3)."""
        data = self.ask("freefloat.picture()").split(",")[1]
        image = Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB")
        return np.asarray(image).astype(int)


def differing(first: np.ndarray, second: np.ndarray) -> int:
    """Number of pixels that differ clearly."""
    return int((np.abs(first - second).sum(axis=2) > 60).sum())


@contextmanager
def opened(browser: Browser, file: Path) -> Iterator[OpenPage]:
    """Open a page and wait until it is ready."""
    context = browser.new_context(viewport={"width": 640, "height": 480}, offline=True)
    opened = OpenPage(context.new_page())
    page = opened.page
    page.on("pageerror", lambda error: opened.errors.append(str(error)))
    page.on("console", lambda m: m.type == "error" and opened.errors.append(m.text))
    page.on("request", lambda request: opened.requests.append(request.url))
    try:
        page.goto(file.as_uri())
        for _ in range(1200):
            if opened.ask("Boolean(window.freefloat || window.freefloatError)"):
                break
            page.wait_for_timeout(50)
        assert not opened.ask("window.freefloatError || ''")
        yield opened
    finally:
        context.close()
