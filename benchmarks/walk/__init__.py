"""The parts of benchmarks/preview.py: landscapes that are walked through."""
