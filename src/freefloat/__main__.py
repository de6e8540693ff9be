"""The ``freefloat`` command, also run by ``python -m freefloat``."""

import signal


def main() -> None:
    """Run the command line and exit.

    Ctrl-C while its modules are loaded ends the process without a traceback.
    """
    interrupt = signal.getsignal(signal.SIGINT)
    if interrupt is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from freefloat.cli.app import main as run

    signal.signal(signal.SIGINT, interrupt)
    run()


if __name__ == "__main__":
    main()
