"""Pages that play motions."""
