"""HTTP server of the studio: on 127.0.0.1, for those who know the token in its address."""

from __future__ import annotations

import asyncio
import hmac
import json
import secrets
import signal
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from tornado.httpserver import HTTPServer
from tornado.httputil import HTTPServerRequest
from tornado.netutil import bind_sockets
from tornado.web import Application, HTTPError, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from freefloat.beyond.studio.session import Session
from freefloat.visualization.page.playback import PLAYER, VIEWER, licences
from freefloat.visualization.page.server import HOST, first_free, local_hosts

_HERE = Path(__file__).parent
_FILES = {
    "viewer.js": VIEWER,
    **{file.name: file for file in [*PLAYER, *_HERE.glob("*.js"), *_HERE.glob("*.css")]},
}  # fmt: skip
_TYPES = {".js": "text/javascript", ".css": "text/css"}
_HEADERS = {
    "Cache-Control": "no-store", "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff", "X-Frame-Options": "DENY",
}  # fmt: skip
_TOKEN_BYTES = 24
_IDLE = 20.0
"""Time in which a request must be complete [s]."""
_PING = 30.0
"""Time between two pings of a browser; one that does not answer is disconnected [s]."""
_LARGEST_MESSAGE, _LARGEST_HEADER = 16_384, 16_384
_MOST_BROWSERS = 16


def serve_studio(scenario: str, folder: Path, port: int, ready: Callable[[str], object]) -> None:
    """Serve the studio to this machine until Ctrl-C or SIGTERM.

    It opens a file or a bundled name, and saves plans in the folder. Where the port is in use, the
    next free one is taken; for zero any free one. ``ready`` is called with the address when the
    server listens. Raises an InputError if no port is free, or there is no such scenario.
    """
    terminate = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        asyncio.run(_serve(scenario, folder, port, ready))
    except KeyboardInterrupt:
        pass
    finally:
        signal.signal(signal.SIGTERM, terminate)


async def _serve(scenario: str, folder: Path, port: int, ready: Callable[[str], object]) -> None:
    (socket,) = first_free(port, lambda free: bind_sockets(free, HOST))
    studio = _Studio(scenario, folder, socket.getsockname()[1])
    server = HTTPServer(
        studio.application(), idle_connection_timeout=_IDLE, body_timeout=_IDLE,
        max_body_size=_LARGEST_MESSAGE, max_header_size=_LARGEST_HEADER,
    )  # fmt: skip
    server.add_socket(socket)
    try:
        ready(studio.address)
        await asyncio.Event().wait()
    finally:
        studio.session.worker.close()
        server.stop()


class _Studio:
    """The session, the browsers that look at it, and who is admitted."""

    def __init__(self, scenario: str, folder: Path, port: int) -> None:
        self._token = secrets.token_urlsafe(_TOKEN_BYTES)
        self._hosts = local_hosts(port)
        self.address = f"http://{HOST}:{port}/{self._token}/"
        self.browsers: set[_Socket] = set()
        self.session = Session(scenario, folder, self._broadcast)

    def application(self) -> Application:
        """The pages by their address."""
        return Application(
            [
                (r"/[^/]+/", _Page, {"studio": self}),
                (r"/[^/]+/socket", _Socket, {"studio": self}),
                (r"/[^/]+/motion\.html", _MotionHandler, {"studio": self}),
                (r"/[^/]+/([a-z]+\.[a-z]+)", _File, {"studio": self}),
            ],
            default_handler_class=_StudioHandler, default_handler_args={"studio": self},
            log_function=lambda handler: None, websocket_ping_interval=_PING,
            websocket_max_message_size=_LARGEST_MESSAGE,
        )  # fmt: skip

    def admits(self, request: HTTPServerRequest) -> bool:
        """Whether a request has the token and comes from a page of this server, or from none."""
        host, origin = request.headers.get("Host", "").lower(), request.headers.get("Origin")
        token = request.path.split("/")[1] if "/" in request.path else ""
        known = hmac.compare_digest(token.encode(), self._token.encode())
        return known and host in self._hosts and origin in (None, f"http://{host}")

    def _broadcast(self, message: dict[str, Any]) -> None:
        for browser in self.browsers:
            browser.tell(message)


class _StudioHandler(RequestHandler):
    def initialize(self, studio: _Studio) -> None:
        self.studio = studio

    def set_default_headers(self) -> None:
        for name, value in _HEADERS.items():
            self.set_header(name, value)

    def prepare(self) -> None:
        """Refuse whoever is not admitted, before anything else is looked at."""
        if not self.studio.admits(self.request):
            raise HTTPError(403)

    def get(self, *_: str) -> None:
        raise HTTPError(404)


class _Page(_StudioHandler):
    def get(self, *_: str) -> None:
        page = (_HERE / "page.html").read_text(encoding="utf-8")
        self.finish(page.replace("@LICENCES@", licences()))


class _File(_StudioHandler):
    def get(self, *names: str) -> None:
        file = _FILES.get(names[0])
        if file is None:
            raise HTTPError(404)
        self.set_header("Content-Type", f"{_TYPES[file.suffix]}; charset=utf-8")
        self.finish(file.read_bytes())


class _MotionHandler(_StudioHandler):
    async def get(self, *_: str) -> None:  # type: ignore[override]
        page = await self.studio.session.page()
        if page is None:
            raise HTTPError(404, reason="There is no motion")
        self.finish(page)


class _Socket(WebSocketHandler):
    def initialize(self, studio: _Studio) -> None:
        self.studio = studio
        self._outbox: dict[str, dict[str, Any]] = {}
        self._sender: asyncio.Task[None] | None = None

    def prepare(self) -> None:
        if not self.studio.admits(self.request):
            raise HTTPError(403)
        if len(self.studio.browsers) >= _MOST_BROWSERS:
            raise HTTPError(503)

    def open(self, *_: str, **__: str) -> None:
        self.studio.browsers.add(self)
        for message in self.studio.session.newest.values():
            self.tell(message)

    def on_message(self, message: str | bytes) -> None:
        self.studio.session.receive(message, self.tell)

    def on_close(self) -> None:
        self.studio.browsers.discard(self)
        self.studio.session.release()

    def tell(self, message: dict[str, Any]) -> None:
        """Send a message; a slow browser receives only the newest one of each type."""
        self._outbox.pop(message["type"], None)
        self._outbox[message["type"]] = message
        if self._sender is None or self._sender.done():
            self._sender = asyncio.create_task(self._send())

    async def _send(self) -> None:
        with suppress(WebSocketClosedError):
            while self._outbox:
                message = self._outbox.pop(next(iter(self._outbox)))
                await self.write_message(json.dumps(message, allow_nan=False))
