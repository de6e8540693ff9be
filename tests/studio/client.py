"""A client of the studio's socket."""

import asyncio
import json
from collections.abc import AsyncIterator, Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from typing import Any

from tornado.httpclient import HTTPRequest
from tornado.websocket import WebSocketClientConnection, websocket_connect

from tests.studio.conftest import Studio

EDIT = {"gesture": "1", "done": True}


def in_a_loop(coroutine: Coroutine[Any, Any, Any]) -> Any:
    """Run a coroutine in a thread: browsers of other tests have a loop in this one."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(asyncio.run, coroutine).result()


@asynccontextmanager
async def connected(studio: Studio, **headers: str) -> AsyncIterator[WebSocketClientConnection]:
    url = f"ws://127.0.0.1:{studio.port}/{studio.token}/socket"
    connection = await websocket_connect(HTTPRequest(url, headers=headers))
    try:
        yield connection
    finally:
        ended = connection.protocol.client_terminated
        connection.close()
        if not ended:
            await closed(connection)


async def closed(connection: WebSocketClientConnection) -> None:
    """Wait until a connection is closed."""
    while await asyncio.wait_for(connection.read_message(), 60) is not None:
        pass


async def answer(
    connection: WebSocketClientConnection,
    *kinds: str,
    wanted: Callable[[dict[str, Any]], bool] = lambda message: True,
) -> dict[str, Any]:
    """The next message of some types with a property: a slow reader receives only the newest."""
    while True:
        text = await asyncio.wait_for(connection.read_message(), 60)
        assert text is not None, "the connection was closed"
        message = json.loads(text)
        if message["type"] in kinds and wanted(message):
            return dict(message)
