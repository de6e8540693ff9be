"""``python -m freefloat``."""

from freefloat.cli.entry import main

main()
