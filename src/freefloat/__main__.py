"""The ``freefloat`` command, also run by ``python -m freefloat``."""

import atexit
import gc
import signal

_ALLOCATIONS = 300_000
"""Allocations between searches for cyclic garbage: imports make many objects and few cycles."""


def main() -> None:
    """Run the command line and exit.

    Ctrl-C while its modules are loaded ends the process without a traceback.
    """
    gc.set_threshold(_ALLOCATIONS)
    atexit.register(gc.freeze)  # the end of the process need not search all objects for cycles
    interrupt = signal.getsignal(signal.SIGINT)
    if interrupt is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from freefloat.cli.app import main as run

    signal.signal(signal.SIGINT, interrupt)
    run()


if __name__ == "__main__":
    main()
