"""Who is admitted to the studio, and what is accepted."""

import http.client
import json
import socket
import stat
from collections.abc import Callable
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from tornado.httpclient import HTTPClientError

from tests.commands import error
from tests.studio.client import EDIT, answer, closed, connected, in_a_loop
from tests.studio.conftest import Studio

MALFORMED = [
    "", "no JSON", "[]", '{"type": "shutdown"}', '{"type": "undo", "more": 1}', "{" * 3000,
    '{"type": "duration", "value": NaN, "gesture": "1", "done": true}',
    json.dumps({"type": "duration", "value": "100", **EDIT}),
    json.dumps({"type": "momentum", "value": [0.0, 0.0], **EDIT}),
    json.dumps({"type": "handle", "handle": 99, "position": [0.0, 0.0, 0.0], **EDIT}),
    json.dumps({"type": "open", "scenario": "../../secret.yaml"}),
]  # fmt: skip


@pytest.fixture(scope="module")
def studio(start_studio: Callable[..., Studio]) -> Studio:
    return start_studio("planar_2dof/line")


def status(studio: Studio, path: str, **headers: str) -> int:
    """The status of a request; ``Host`` replaces the right one."""
    connection = http.client.HTTPConnection("127.0.0.1", studio.port, timeout=60)
    connection.request("GET", path, headers=headers)
    response = connection.getresponse()
    response.read()
    connection.close()
    return response.status


def test_the_scenario_must_exist() -> None:
    assert error("studio", "no/scenario")["key"] == "scenario"


def test_the_page_and_its_files_need_the_token(studio: Studio) -> None:
    token = f"/{studio.token}/"
    assert status(studio, token) == 200
    for file in ("viewer.js", "player.js", "studio.js", "controls.js", "studio.css"):
        assert status(studio, token + file) == 200
    assert status(studio, f"{token}server.py") == 404
    assert status(studio, f"{token}..%2fserver.py") == 404
    wrong = ("/", "/studio.js", f"/{studio.token[:-1]}/", f"/{studio.token}x/", "/é/", "//", "/x/y")
    for path in (*wrong, f"/{'0' * len(studio.token)}/socket"):
        assert status(studio, path.replace("é", "%C3%A9")) == 403


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1:1", ""])
def test_other_hosts_are_refused(studio: Studio, host: str) -> None:
    assert status(studio, f"/{studio.token}/", Host=host) == 403
    assert status(studio, f"/{studio.token}/", Host=f"localhost:{studio.port}") == 200


def test_pages_of_other_origins_cannot_connect(studio: Studio) -> None:
    async def attempt(**headers: str) -> int:
        try:
            async with connected(studio, **headers):
                return 101
        except HTTPClientError as refusal:
            return refusal.code

    own = f"http://127.0.0.1:{studio.port}"
    assert in_a_loop(attempt(Origin=own)) == 101
    for origin in ("http://evil.example", "null", f"https://127.0.0.1:{studio.port}"):
        assert in_a_loop(attempt(Origin=origin)) == 403
    assert in_a_loop(attempt(Host="evil.example")) == 403


@pytest.mark.slow
def test_malformed_messages_are_refused_and_the_session_goes_on(studio: Studio) -> None:
    async def talk() -> None:
        async with connected(studio) as connection:
            before = await answer(connection, "state")
            await answer(connection, "outline")
            for text in MALFORMED:
                await connection.write_message(text)
                assert (await answer(connection, "error"))["text"]
            edit = {"type": "duration", "value": 31.0, **EDIT}
            await connection.write_message(json.dumps(edit))
            assert "duration: 31" in (await answer(connection, "state"))["text"]
            await connection.write_message(json.dumps({"type": "undo"}))
            assert (await answer(connection, "state"))["text"] == before["text"]

    in_a_loop(talk())


def test_what_is_refused_by_the_planner_leaves_the_studio_ready(studio: Studio) -> None:
    async def talk() -> None:
        async with connected(studio) as connection:
            await answer(connection, "outline")
            edit = {"type": "momentum", "value": [1.0, 0.0, 0.0], **EDIT}
            await connection.write_message(json.dumps(edit))
            text = (await answer(connection, "problem"))["text"]
            assert "momentum" in text
            assert "/" not in text  # no folder of the installation
            await answer(connection, "status", wanted=lambda m: not m["busy"])
            await connection.write_message(json.dumps({"type": "undo"}))
            await answer(connection, "outline")

    in_a_loop(talk())


def test_a_message_that_is_too_long_closes_its_connection_alone(studio: Studio) -> None:
    async def talk() -> None:
        async with connected(studio) as connection, connected(studio) as other:
            await connection.write_message("x" * 100_000)
            await closed(connection)
            assert (await answer(other, "state"))["scenario"] == "planar_2dof/line"

    in_a_loop(talk())


@pytest.mark.slow
def test_two_hundred_slow_connections_do_not_stop_it(studio: Studio) -> None:
    """Half send nothing, half a part of a request."""
    slow = [socket.create_connection(("127.0.0.1", studio.port)) for _ in range(200)]
    try:
        for connection in slow[::2]:
            connection.sendall(f"GET /{studio.token}/ HTTP/1.1\r\nHost: ".encode())
        assert status(studio, f"/{studio.token}/") == 200

        async def talk() -> None:
            async with connected(studio) as connection:
                assert await answer(connection, "state")

        in_a_loop(talk())
    finally:
        for connection in slow:
            connection.close()


@pytest.mark.slow
def test_it_ends_with_exit_code_zero_and_its_worker_with_it(start_studio):
    studio = start_studio("planar_2dof/line", "--json")
    worker = studio.worker()
    assert studio.stop() == 0
    worker.wait(5)
    assert not worker.is_running()
    assert not studio.browser.exists()


@pytest.mark.slow
def test_the_browser_is_told_a_private_page_that_is_deleted_at_the_end(start_studio):
    studio = start_studio("planar_2dof/line")
    assert studio.token not in studio.told()  # arguments, which all users can read
    page = Path(urlsplit(studio.told()).path)
    assert stat.S_IMODE(page.stat().st_mode) == 0o600
    assert studio.address in page.read_text("utf-8")
    assert studio.stop() == 0
    assert list(studio.folder.iterdir()) == []
