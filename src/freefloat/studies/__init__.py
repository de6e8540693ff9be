"""Studies: cases drawn, run, kept and told."""
