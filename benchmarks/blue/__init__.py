"""Parts of benchmarks/blue_surfels.py."""
