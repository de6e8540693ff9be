"""What ``scripts/attack_claims.py`` attacks, and how."""
