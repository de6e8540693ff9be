"""The work of one command each, and how it speaks meanwhile."""
