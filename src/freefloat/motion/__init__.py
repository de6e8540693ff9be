"""One motion: the problem it solves, its record, how it is followed."""
