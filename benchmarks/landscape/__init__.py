"""Parts of benchmarks/tiles.py."""
