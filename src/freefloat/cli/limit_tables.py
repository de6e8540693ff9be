"""Tables."""

from typing import Any

from freefloat.cli.console import table as plain_table

Document = dict[str, Any]
__all__ = ["Document", "plain_table"]
