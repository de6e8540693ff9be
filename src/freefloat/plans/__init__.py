"""Plans: which attitude, why, within which limits, how robust."""
