"""Touch points: states at which motions just keep their margin (Sections IV to VI)."""
