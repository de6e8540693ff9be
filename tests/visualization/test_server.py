"""The loopback server: one page, this machine alone, a clean end."""

from __future__ import annotations

import gzip
import http.client
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from http import HTTPStatus
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from freefloat.errors import InputError
from freefloat.visualization.server import open_browser, served

PAGE = "<!DOCTYPE html><p>Größe: " + "x" * 5000
TEXT = PAGE.encode()


@pytest.fixture
def port() -> Iterator[int]:
    with served(lambda address: PAGE) as address:
        yield urlsplit(address).port or 0


def ask(
    port: int,
    path: str = "/",
    method: str = "GET",
    body: bytes | None = None,
    **headers: str,
) -> tuple[int, dict[str, str], bytes]:
    """A request as a browser makes it, and its answer."""
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=10)) as connection:
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        connection.request(method, path, body, named)
        answer = connection.getresponse()
        return answer.status, {k.lower(): v for k, v in answer.getheaders()}, answer.read()


def listening(port: int) -> set[str]:
    """Local addresses, of both kinds, that listen at a port, as Linux tells them."""
    lines = [line.split() for name in ("tcp", "tcp6")
             for line in Path(f"/proc/net/{name}").read_text().splitlines()[1:]]  # fmt: skip
    pairs = [line[1].split(":") for line in lines if line[3] == "0A"]
    return {address for address, number in pairs if int(number, 16) == port}


def test_the_page_comes_whole_and_packed_where_that_is_taken(port: int) -> None:
    status, headers, content = ask(port)
    assert (status, content) == (200, TEXT)
    assert headers["content-type"] == "text/html; charset=utf-8"
    assert "content-encoding" not in headers
    for offer in ("gzip, deflate, br", "br;q=1.0, GZIP;q=0.8"):
        status, headers, content = ask(port, Accept_Encoding=offer)
        assert (status, headers["content-encoding"]) == (200, "gzip")
        assert gzip.decompress(content) == TEXT
        assert len(content) < 200
    assert ask(port, Accept_Encoding="gzip;q=0, br")[2] == TEXT
    assert ask(port, "/?t=12")[2] == TEXT


def test_head_tells_the_same_without_the_page(port: int) -> None:
    status, headers, content = ask(port, method="HEAD")
    assert (status, content) == (200, b"")
    assert headers["content-length"] == str(len(TEXT))


def test_nothing_else_is_there_and_an_icon_is_no_error(port: int) -> None:
    assert ask(port, "/favicon.ico")[0] == 204
    for path in ("/index.html", "/../etc/passwd", "/%00", "/x" * 1000):
        assert ask(port, path)[0] == 404, path
    assert ask(port, method="POST", body=b"x")[0] == 404
    assert ask(port, method="DELETE")[0] == 501


@pytest.mark.parametrize("host", ["evil.example", "evil.example:{}", "127.0.0.1", "0.0.0.0:{}", ""])
def test_other_hosts_are_refused(port: int, host: str) -> None:
    """A page of the web whose name was made to lead here names itself."""
    assert ask(port, Host=host.format(port))[0] == 403
    assert ask(port, method="POST", body=b"", Host=host.format(port))[0] == 403
    assert ask(port, Host=f"LocalHost:{port}")[0] == 200


def test_only_loopback_is_bound(port: int) -> None:
    """In the kernel's own table, and by trying this machine's other addresses."""
    assert listening(port) == {"0100007F"}
    others = {"127.0.0.2", socket.gethostbyname(socket.gethostname())} - {"127.0.0.1"}
    for address in others:
        with pytest.raises(OSError):  # noqa: PT011
            socket.create_connection((address, port), timeout=2).close()


def test_a_taken_port_leads_to_the_next_one() -> None:
    with served(lambda _: PAGE) as first:
        taken = urlsplit(first).port or 0
        with served(lambda _: "second", taken) as second:
            port = urlsplit(second).port or 0
            assert taken < port <= taken + 19
            assert ask(port)[2] == b"second"


def test_ports_that_cannot_be_had_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as other:
        taken = other.getsockname()[1]
        monkeypatch.setattr("freefloat.visualization.server._TRIES", 1)
        with (
            pytest.raises(InputError, match=f"port: all from {taken} to {taken} are taken"),
            served(lambda _: PAGE, taken),
        ):
            pass


def test_afterwards_no_thread_is_left_and_the_port_is_free() -> None:
    """Also not by a browser that connected ahead of time and says nothing."""
    before = threading.active_count()
    with served(lambda _: PAGE) as address:
        port = urlsplit(address).port or 0
        silent = socket.create_connection(("127.0.0.1", port))
        ask(port)
        start = time.monotonic()
    assert time.monotonic() - start < 2.0
    assert threading.active_count() == before
    assert listening(port) == set()
    silent.close()
    with served(lambda _: "again", port) as address:
        assert urlsplit(address).port == port


def test_a_page_that_cannot_be_made_leaves_nothing_behind() -> None:
    before = threading.active_count()
    with pytest.raises(ZeroDivisionError), served(lambda _: str(1 / 0)):
        pass
    assert threading.active_count() == before


def test_a_page_may_send_back_below_its_own_address_alone() -> None:
    sent: list[tuple[str, bytes]] = []

    def receive(path: str, content: bytes) -> HTTPStatus:
        sent.append((path, content))
        return HTTPStatus.NO_CONTENT

    with served(lambda _: PAGE, path="/secret", receive=receive) as address:
        port = urlsplit(address).port or 0
        assert ask(port, "/secret")[2] == TEXT
        assert ask(port, "/")[0] == 404
        assert ask(port, "/secret/7", "POST", b"PNG")[0] == 204
        own = f"http://127.0.0.1:{port}"
        assert ask(port, "/secret/8", "POST", b"x", Origin=own)[0] == 204
        assert ask(port, "/secret/8", "POST", b"x", Origin="http://evil.example")[0] == 403
        for path in ("/7", "/secret", "/secretly/7", "/other/7"):
            assert ask(port, path, "POST", b"x")[0] == 404, path
        for length in ("-1", "1e3", "", "999999999999"):
            assert ask(port, "/secret/7", "POST", b"", Content_Length=length)[0] == 413
        assert sent == [("7", b"PNG"), ("8", b"x")]


LOOK = """
from freefloat.visualization.server import served, until_stopped
with until_stopped() as wait, served(lambda _: "page", 0) as address:
    print(address, flush=True)
    wait()
print("ended", flush=True)
"""


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_is_a_proper_end(stop: signal.Signals, tmp_path: Path) -> None:
    """Exit code 0, nothing on stderr, the port free; a second signal changes nothing."""
    with subprocess.Popen(
        [sys.executable, "-c", LOOK],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        port = urlsplit(process.stdout.readline()).port or 0
        assert ask(port)[0] == 200
        process.send_signal(stop)
        process.send_signal(stop)
        rest, errors = process.communicate(timeout=20)
    assert (process.returncode, rest, errors) == (0, "ended\n", "")
    assert listening(port) == set()


def test_without_a_screen_no_browser_takes_over_the_terminal(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda address: opened.append(address) is None)
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    if sys.platform == "linux":
        assert not open_browser("http://127.0.0.1:1/")
        assert opened == []
    monkeypatch.setitem(os.environ, "BROWSER", "firefox")
    assert open_browser("http://127.0.0.1:1/")
    assert opened == ["http://127.0.0.1:1/"]
