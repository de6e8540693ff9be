"""Places in which an arm can become singular."""
