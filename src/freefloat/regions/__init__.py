"""The paper's curves and areas: margin curves, and where an arm can be singular."""
