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
from threading import Thread
from typing import Any, TypeVar

from freefloat.errors import InputError

HOST = "127.0.0.1"
"""The only address that pages are served on."""
_PORTS_TRIED = 20
_PATIENCE = 5.0
"""Time for which a request may send nothing [s]."""
_Bound = TypeVar("_Bound")


def serve(html: str, port: int, ready: Callable[[str], object]) -> None:
    """Serve a page to this machine until Ctrl-C or SIGTERM, on a port as of :func:`first_free`.

    Requests whose Host header names another host are refused (DNS rebinding). When the server
    listens, ``ready`` is called with the address of the page.

    Raises:
        InputError: If no port is free.
    """
    with first_free(port, lambda free: _Server((HOST, free), _PageHandler)) as server:
        server.page = html.encode()
        terminate = signal.signal(signal.SIGTERM, signal.default_int_handler)
        try:
            ready(f"http://{HOST}:{server.server_port}/")
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


class _PageHandler(BaseHTTPRequestHandler):
    server: _Server
    timeout = _PATIENCE

    def do_GET(self) -> None:
        """Send the page."""
        if self.headers.get("Host", "").lower() not in local_hosts(self.server.server_port):
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


def local_hosts(port: int) -> tuple[str, str]:
    """The Host headers of requests to this machine: others come from a page of another host."""
    return f"{HOST}:{port}", f"localhost:{port}"


def first_free(port: int, bind: Callable[[int], _Bound]) -> _Bound:
    """Bind a port, or the next free one if it is in use; zero for any free port.

    ``bind`` raises OSError for a port that is in use.

    Raises:
        InputError: If no port is free.
    """
    last = port if port == 0 else min(port + _PORTS_TRIED, 65536) - 1
    for candidate in range(port, last + 1):
        with suppress(OSError):
            return bind(candidate)
    raise InputError("port", f"no free port from {port} to {last}", "another port, or 0 for any")


def has_display() -> bool:
    """Whether a browser can be opened: a text browser would occupy the terminal."""
    screens = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    return sys.platform != "linux" or any(os.environ.get(name) for name in screens)


def open_browser(address: str) -> bool:
    """Open a page in a browser if there is a display; return whether it was opened."""
    return has_display() and webbrowser.open(address)


def open_beside(address: str) -> None:
    """Open a page in a browser while the page is served: some browsers are waited for."""
    Thread(target=open_browser, args=(address,), daemon=True).start()
