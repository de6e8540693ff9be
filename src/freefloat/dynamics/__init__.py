"""How momentum and joint rates move a free-floating robot."""
