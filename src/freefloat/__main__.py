"""``python -m freefloat``."""

from freefloat.cli.app import main

main()
