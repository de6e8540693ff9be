"""``python -m freefloat``."""

from freefloat.cli import main

main()
