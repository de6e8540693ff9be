"""What a search makes as large, or as small, as possible."""
