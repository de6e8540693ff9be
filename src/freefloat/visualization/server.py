"""HTTP server of a single page on 127.0.0.1."""

from __future__ import annotations

import os
import signal
import sys
import webbrowser
from collections.abc import Callable
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from freefloat.errors import InputError

_HOST = "127.0.0.1"
_PORTS_TRIED = 20


def serve(html: str, port: int, ready: Callable[[str], object]) -> None:
    """Serve a page to this machine until Ctrl-C or SIGTERM.

    Requests whose Host header names another host are refused (DNS rebinding).

    Args:
        html: The page.
        port: Port, or the next free port if it is in use; zero for any free port.
        ready: Called with the page's address when the server listens.

    Raises:
        InputError: If no port is free.
    """
    with _bound(port) as server:
        server.page = html.encode()
        terminate = signal.signal(signal.SIGTERM, signal.default_int_handler)
        try:
            ready(f"http://{_HOST}:{server.server_port}/")
            server.serve_forever()
        except KeyboardInterrupt:
            pass
        finally:
            signal.signal(signal.SIGTERM, terminate)


class _Server(ThreadingHTTPServer):
    page = b""

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore browsers that close a connection early."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    server: _Server

    def do_GET(self) -> None:
        """Send the page."""
        hosts = [f"{name}:{self.server.server_port}" for name in (_HOST, "localhost")]
        if self.headers.get("Host", "").lower() not in hosts:
            self.send_error(HTTPStatus.FORBIDDEN)
        elif self.path != "/":
            self.send_error(HTTPStatus.NOT_FOUND)
        else:
            self.send_response(HTTPStatus.OK)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.send_header("Content-Length", str(len(self.server.page)))
            self.end_headers()
            self.wfile.write(self.server.page)

    def log_message(self, *_: Any) -> None:
        """Log no requests."""


def _bound(port: int) -> _Server:
    last = port if port == 0 else min(port + _PORTS_TRIED, 65536) - 1
    for candidate in range(port, last + 1):
        with suppress(OSError):
            return _Server((_HOST, candidate), _Handler)
    raise InputError("port", f"no free port from {port} to {last}", "another port, or 0 for any")


def open_browser(address: str) -> bool:
    """Open a page in a browser if there is a display; return whether it was opened."""
    screens = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    if sys.platform == "linux" and not any(os.environ.get(name) for name in screens):
        return False  # a text browser would occupy the terminal
    return webbrowser.open(address)
