"""One motion: problem, integration, simulation, certificate."""
