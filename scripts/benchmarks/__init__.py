"""What ``scripts/benchmark.py`` measures, one noun each."""
