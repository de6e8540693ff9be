"""Where an arm can become singular."""
