"""A saved plan proved again."""
