"""The ``freefloat`` command, also run by ``python -m freefloat``."""

import atexit
import gc
import os
import signal

_NUMBA = {"NUMBA_OPT": "2", "NUMBA_LOOP_VECTORIZE": "0", "NUMBA_SLP_VECTORIZE": "0"}
"""Less optimization than Numba's default: kernels, which compute with vectors as they are written,
compile in nine tenths of the time and are as fast. Python leaves this setting to the user."""

_ALLOCATIONS = 300_000
"""Allocations between searches for cyclic garbage: imports make many objects and few cycles."""


def main() -> None:
    """Run the command line and exit.

    Ctrl-C while its modules are loaded ends the process without a traceback.
    """
    gc.set_threshold(_ALLOCATIONS)
    atexit.register(gc.freeze)  # the end of the process need not search all objects for cycles
    for name, value in _NUMBA.items():
        os.environ.setdefault(name, value)
    interrupt = signal.getsignal(signal.SIGINT)
    if interrupt is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from freefloat.cli.app import main as run

    signal.signal(signal.SIGINT, interrupt)
    run()


if __name__ == "__main__":
    main()
