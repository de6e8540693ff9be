"""One page, served to this machine alone for as long as it is looked at."""

from __future__ import annotations

import gzip
import hmac
import os
import re
import signal
import socket
import sys
import threading
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cached_property
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from queue import SimpleQueue
from socketserver import TCPServer
from typing import Any

from freefloat.errors import InputError

_TRIES = 20
"""Ports looked at, one after the other, when the first is taken."""
_HOST = "127.0.0.1"
_PATIENCE = 30.0
"""Seconds a connection may keep silent."""
_LARGEST = 64_000_000
"""Bytes of what a page may send back at a time; a large picture has a tenth of that."""

Receive = Callable[[str, bytes], HTTPStatus]
"""Takes what a page sends: the part of the address below the page's, and the body."""


@contextmanager
def served(
    make_page: Callable[[str], str],
    port: int = 0,
    path: str = "/",
    receive: Receive | None = None,
) -> Iterator[str]:
    """Serve a page on 127.0.0.1 while the block runs.

    Only this machine can connect. Requests that name another host are refused: a web page that
    makes its own name lead here learns nothing. No thread is left behind.

    Args:
        make_page: The HTML text, given the page's address.
        port: Where to listen; when it is taken, at the next free one. Zero for any free one.
        path: Of the page, beginning with a slash; every other is answered with 404.
        receive: Called, in another thread, with what the page posts to its address, a slash and
            some more.

    Yields:
        The page's address.

    Raises:
        InputError: If there is no free port.
    """
    server = _bound(port)
    server.path, server.receive = path, receive
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.1})
    try:
        address = f"http://{_HOST}:{server.server_port}{path}"
        server.page = make_page(address).encode()
        thread.start()
        yield address
    finally:
        if thread.is_alive():
            server.shutdown()
            thread.join()
        server.hang_up()
        server.server_close()


def _bound(port: int) -> _Server:
    """A server at a port, or at the next free one."""
    last = port if port == 0 else min(port + _TRIES, 65536) - 1
    for candidate in range(port, last + 1):
        try:
            return _Server((_HOST, candidate), _Handler)
        except PermissionError:
            told = f"{candidate} is for administrators"
            raise InputError("port", told, "1024 or more") from None
        except OSError:
            continue
    raise InputError("port", f"all from {port} to {last} are taken", "another one, or 0 for any")


class _Server(ThreadingHTTPServer):
    """Serves :attr:`page` at :attr:`path` and knows who is connected."""

    daemon_threads = False  # so that closing waits for them
    page = b""
    path = "/"
    receive: Receive | None = None

    def __init__(self, *arguments: Any) -> None:
        """Bind to an address."""
        self._connected: set[socket.socket] = set()
        super().__init__(*arguments)

    @cached_property
    def packed(self) -> bytes:
        """The page, compressed."""
        return gzip.compress(self.page, 5, mtime=0)

    def server_bind(self) -> None:
        """Bind without asking the network for this machine's name."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = _HOST, int(self.socket.getsockname()[1])

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer in a thread of its own."""
        self._connected.add(request)
        super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:
        """End a connection."""
        self._connected.discard(request)
        super().shutdown_request(request)

    def hang_up(self) -> None:
        """End connections that browsers keep open and say nothing on."""
        for request in list(self._connected):
            with suppress(OSError):
                request.shutdown(socket.SHUT_RDWR)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that leaves in the middle of an answer is nothing to tell of."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    """Answers one request."""

    server: _Server
    server_version, sys_version = "freefloat", ""
    timeout = _PATIENCE

    def do_GET(self) -> None:
        """Send the page."""
        self._answer(body=True)

    def do_HEAD(self) -> None:
        """Send what is known of the page."""
        self._answer(body=False)

    def do_POST(self) -> None:
        """Take what the page sends."""
        inner = self._wanted().removeprefix(self.server.path + "/")
        length = self.headers.get("Content-Length", "")
        if not (self._is_local() and self._is_own_page()):
            self._send(HTTPStatus.FORBIDDEN)
        elif self.server.receive is None or inner == self._wanted():
            self._send(HTTPStatus.NOT_FOUND)
        elif not length.isdecimal() or len(length) > 9 or int(length) > _LARGEST:
            self._send(HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
        else:
            content = self.rfile.read(int(length))
            whole = len(content) == int(length)
            self._send(self.server.receive(inner, content) if whole else HTTPStatus.BAD_REQUEST)

    def _answer(self, body: bool) -> None:
        if not self._is_local():
            self._send(HTTPStatus.FORBIDDEN)
        elif hmac.compare_digest(self._wanted().encode(), self.server.path.encode()):
            packed = self._takes_gzip()
            content = self.server.packed if packed else self.server.page
            headers = {"Content-Type": "text/html; charset=utf-8", "Vary": "Accept-Encoding"}
            self._send(HTTPStatus.OK, content, headers | _PACKED if packed else headers, body)
        else:  # browsers ask for an icon on their own
            icon = self._wanted() == "/favicon.ico"
            self._send(HTTPStatus.NO_CONTENT if icon else HTTPStatus.NOT_FOUND)

    def _wanted(self) -> str:
        return self.path.partition("?")[0]

    def _is_local(self) -> bool:
        host = self.headers.get("Host", "").lower()
        return host in (f"{name}:{self.server.server_port}" for name in (_HOST, "localhost"))

    def _is_own_page(self) -> bool:
        own = f"http://{self.headers['Host']}"
        return bool(self.headers.get("Origin", own) == own)

    def _takes_gzip(self) -> bool:
        offers = self.headers.get("Accept-Encoding", "").replace(" ", "").lower().split(",")
        return any(re.fullmatch(r"gzip(;q=(1|0\.0*[1-9]).*)?", offer) for offer in offers)

    def _send(
        self,
        status: HTTPStatus,
        content: bytes = b"",
        headers: dict[str, str] | None = None,
        body: bool = True,
    ) -> None:
        self.send_response(status)
        for name, value in (_ALWAYS | (headers or {})).items():
            self.send_header(name, value)
        if status != HTTPStatus.NO_CONTENT:
            self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        if body:
            self.wfile.write(content)

    def log_message(self, *_: Any) -> None:
        """Say nothing of requests."""


_PACKED = {"Content-Encoding": "gzip"}
_ALWAYS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
}


@contextmanager
def until_stopped() -> Iterator[Callable[[], object]]:
    """Ctrl-C and SIGTERM only end the wait while the block runs; both are a proper end.

    Yields:
        A function that waits for either.
    """
    asked: SimpleQueue[int] = SimpleQueue()  # the one queue that signal handlers may use
    stops = (signal.SIGINT, signal.SIGTERM)
    before = {stop: signal.signal(stop, lambda number, _: asked.put(number)) for stop in stops}
    try:
        yield asked.get
    finally:
        for stop, handler in before.items():
            signal.signal(stop, handler)


def open_browser(address: str) -> bool:
    """Show a page in the user's browser, where there is a screen to show it on."""
    screens = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    if sys.platform == "linux" and not any(os.environ.get(name) for name in screens):
        return False  # else a browser for terminals would take this one over
    return webbrowser.open(address)
