"""Very many motions at once, in compiled form."""
