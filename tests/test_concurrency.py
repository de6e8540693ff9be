"""Chunks on threads, and requests for memory."""

import signal
import threading

import pytest

from freefloat.concurrency import require_memory, run_chunks
from tests.errors import error_key


@pytest.mark.parametrize("chunks", [1, 4])
def test_an_interruption_does_not_wait_for_a_running_chunk(chunks: int) -> None:
    running, end = threading.Event(), threading.Event()
    ended: list[int] = []

    def work(chunk: int) -> None:
        running.set()
        end.wait(20.0)
        ended.append(chunk)

    def interrupt() -> None:
        running.wait(20.0)
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    threading.Thread(target=interrupt).start()
    with pytest.raises(KeyboardInterrupt):
        run_chunks(work, range(chunks), 1)
    assert ended == []
    end.set()


def test_requests_for_more_than_half_of_the_memory_are_refused() -> None:
    require_memory("samples", 1000, 1000)
    assert error_key(require_memory, "samples", 10**400, 1000) == "samples"
